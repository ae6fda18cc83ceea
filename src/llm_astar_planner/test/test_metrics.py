"""Each figure equals its formula worked out by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from llm_astar_planner.benchmark.metrics import (
    geometric_mean,
    growth_factor,
    log_log_slope,
    optimal,
    share,
    spread,
)

RATIOS = st.lists(st.floats(1e-3, 1e3), min_size=1, max_size=30)


def test_the_geometric_mean_is_the_nth_root_of_the_product():
    assert geometric_mean([2.0, 8.0]) == pytest.approx(4.0)
    assert geometric_mean([0.5, 1.0, 4.0]) == pytest.approx(2.0 ** (1 / 3))


@given(RATIOS)
def test_the_geometric_mean_of_inverses_is_the_inverse(ratios):
    assert geometric_mean(1.0 / np.array(ratios)) == pytest.approx(1.0 / geometric_mean(ratios))


@pytest.mark.parametrize('bad', [0.0, -1.0, math.nan])
def test_a_ratio_that_is_not_above_zero_is_refused(bad):
    with pytest.raises(ValueError, match='above 0'):
        geometric_mean([1.0, bad])


def test_no_values_give_no_figures():
    assert math.isnan(geometric_mean([]))
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
