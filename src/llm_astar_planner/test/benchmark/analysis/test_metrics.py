"""Each figure equals its formula worked out by hand."""

import math

import numpy as np
import pytest
from llm_astar_planner.benchmark.analysis.metrics import (
    growth_factor,
    log_log_slope,
    optimal,
    share,
    spread,
)


def test_no_values_give_no_figures():
    assert math.isnan(share([]))
    assert math.isnan(growth_factor([], []))
    assert all(math.isnan(value) for value in spread([]))


def test_spread_names_mean_median_p95_and_worst():
    assert spread(range(101)) == (50.0, 50.0, 95.0, 100.0)


def test_shares_count_flags_and_optimal_allows_rounding_alone():
    assert share([True, True, False, False]) == 0.5
    assert optimal([10.0, 10.0 + 1e-12, 10.001], [10.0] * 3).tolist() == [True, True, False]


def test_growth_is_the_arithmetic_mean_of_each_sample_s_growth():
    assert growth_factor([20.0, 90.0], [10.0, 30.0]) == 2.5


def test_the_slope_is_one_for_linear_and_two_for_area():
    scales = np.arange(1, 11)
    assert log_log_slope(scales, 3.0 * scales) == pytest.approx(1.0)
    assert log_log_slope(scales, scales**2) == pytest.approx(2.0)
    assert math.isnan(log_log_slope([1], [1.0]))
