"""Fixtures of the benchmark's tests."""

from dataclasses import replace

import pytest
from benchmark_samples import HALL
from llm_astar_lab.datasets.generate import generate
from llm_astar_msgs_adapter.maps.problem_maps import save_maps


@pytest.fixture
def dataset(tmp_path):
    path = tmp_path / 'maps.json'
    save_maps([HALL, *(replace(m, id=m.id + 10) for m in generate(1, 3))], path)
    return path
