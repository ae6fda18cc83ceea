"""Measures how well instructions are understood, enforced and reported, on suites of them."""
