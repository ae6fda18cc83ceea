"""Replaying samples: datasets, metrics, statistics and reports."""
