"""Growth factors and slopes equal their formulas worked out by hand."""

import math

import numpy as np
import pytest
from benchmark_samples import A_STAR, ORACLE, row, rows_with
from llm_astar_planner.benchmark.analysis.scalability import growth, growth_factor, log_log_slope
from llm_astar_planner.benchmark.report.sentences import growth_sentence


def test_no_values_give_no_growth():
    assert math.isnan(growth_factor([], []))


def test_growth_is_the_arithmetic_mean_of_each_sample_s_growth():
    assert growth_factor([20.0, 90.0], [10.0, 30.0]) == 2.5


def test_the_slope_is_one_for_linear_and_two_for_area():
    scales = np.arange(1, 11)
    assert log_log_slope(scales, 3.0 * scales) == pytest.approx(1.0)
    assert log_log_slope(scales, scales**2) == pytest.approx(2.0)
    assert math.isnan(log_log_slope([1], [1.0]))


def test_growth_is_over_the_samples_solved_at_every_scale():
    rows = [row(A_STAR, 10.0 * scale**2, scale=scale) for scale in (1, 2, 4)]
    rows += [row(A_STAR, 1.0, pair=1), row(A_STAR, 99.0, pair=1, scale=2)]
    rows += [row(ORACLE, 7.0 * scale, scale=scale) for scale in (1, 2, 4)]
    area, _, linear, _ = growth(rows)
    assert (area.samples, area.scales, area.factors) == (1, (1, 2, 4), (1.0, 4.0, 16.0))
    assert area.slope == pytest.approx(2.0)
    assert linear.slope == pytest.approx(1.0)
    assert growth_sentence(growth(rows)).endswith(
        'over 1 sample: near linear in the scale, which would be slope 1.'
    )
    assert growth(rows_with(1.0)) == []
