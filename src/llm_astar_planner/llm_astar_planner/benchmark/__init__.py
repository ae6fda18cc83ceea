"""Benchmarks: datasets, runs over samples, analysis and reports."""
