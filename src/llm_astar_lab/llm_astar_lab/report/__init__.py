"""Writes reports: Markdown, HTML, figures."""
