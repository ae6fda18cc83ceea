"""The benchmark: samples, runs over them, figures with their uncertainty, and reports."""
