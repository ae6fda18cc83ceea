"""Statistics and summaries of results."""
