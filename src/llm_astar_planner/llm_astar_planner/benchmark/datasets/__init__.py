"""Datasets: loaded, selected, generated, validated."""
