"""Reports: Markdown, HTML, figures."""
