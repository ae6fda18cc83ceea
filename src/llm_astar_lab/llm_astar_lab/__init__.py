"""What a person at a desk runs: benchmarks, evaluation of bags, reports, pictures, the page."""
