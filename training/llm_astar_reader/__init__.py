"""Trains the small model that reads instructions (docs/reader.md)."""
