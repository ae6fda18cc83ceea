"""Growth factors and slopes equal their formulas worked out by hand."""

import math

import numpy as np
import pytest
from llm_astar_planner.benchmark.analysis.scalability import growth_factor, log_log_slope


def test_no_values_give_no_growth():
    assert math.isnan(growth_factor([], []))


def test_growth_is_the_arithmetic_mean_of_each_sample_s_growth():
    assert growth_factor([20.0, 90.0], [10.0, 30.0]) == 2.5


def test_the_slope_is_one_for_linear_and_two_for_area():
    scales = np.arange(1, 11)
    assert log_log_slope(scales, 3.0 * scales) == pytest.approx(1.0)
    assert log_log_slope(scales, scales**2) == pytest.approx(2.0)
    assert math.isnan(log_log_slope([1], [1.0]))
