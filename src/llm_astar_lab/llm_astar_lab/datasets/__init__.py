"""Loads, selects, generates and validates datasets."""
