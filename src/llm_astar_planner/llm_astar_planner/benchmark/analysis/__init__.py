"""Metrics, statistics and summaries of results."""
