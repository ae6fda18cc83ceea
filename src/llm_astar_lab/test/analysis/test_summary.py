"""A summary holds every metric, also growth; variants are ordered as in the paper."""

import math

import numpy as np
import pytest
from benchmark_samples import A_STAR, MODEL, NONE, ORACLE, row, rows_with
from llm_astar_lab.analysis.summary import (
    growth,
    growth_factor,
    log_log_slope,
    summarise,
)
from llm_astar_lab.report.sentences import growth_sentence
from llm_astar_lab.report.table import Table
from llm_astar_lab.results.row import Variant


def test_a_summary_holds_each_metric():
    rows = [
        row(A_STAR, 100.0, 10.0),
        row(A_STAR, 100.0, 10.0, pair=1),
        row(A_STAR, 100.0, 10.0, map_id=1),
        row(MODEL, 25.0, 10.0, verdicts='accepted;occupied', waypoints='1,2;3,4', prompt_tokens=9),
        row(MODEL, 100.0, 12.0, pair=1, completion_tokens=1, source_status='TIMEOUT'),
        row(MODEL, 10.0, math.nan, map_id=1, code='NO_VALID_PATH'),
    ]
    summary = summarise(rows)[1]
    assert summary.variant == MODEL
    assert (summary.samples, summary.maps, summary.unanswered) == (3, 2, 1)
    assert summary.valid.value == pytest.approx(2 / 3)
    assert summary.operation.mean.value == pytest.approx(0.5)
    assert summary.operation.spread.worst == 1.0
    assert summary.length.mean.value == pytest.approx(math.sqrt(1.2))
    assert summary.optimal.value == 0.5
    assert summary.verdicts == {'accepted': 0.5, 'occupied': 0.5}
    assert summary.waypoints == pytest.approx(2 / 3)


def test_the_share_of_optimal_paths_has_an_interval_over_the_maps():
    maps = range(10)
    rows = [row(A_STAR, length=10.0, map_id=number) for number in maps]
    rows += [row(NONE, length=10.0 + (number < 4), map_id=number) for number in maps]
    astar, none = summarise(rows)
    assert astar.optimal == (1.0, 1.0, 1.0)
    assert none.optimal.value == 0.6
    assert 0.2 < none.optimal.low < 0.5 < 0.7 < none.optimal.high < 1.0
    heads = [column.head for column in Table.of('main', [none]).columns]
    assert Table.of('main', [none]).rows[0][heads.index('Optimal paths ↑ (%)')] == none.optimal


def test_variants_are_ordered_as_in_the_paper_with_baselines_below_models():
    alone, guided = Variant('waypoints_only', 'oracle'), Variant('guided')
    variants = [ORACLE, guided, NONE, MODEL, alone, A_STAR]
    assert sorted(variants, key=lambda variant: variant.report_order) == [
        A_STAR, alone, MODEL, NONE, ORACLE, guided,
    ]  # fmt: skip


def test_no_values_give_no_growth():
    assert math.isnan(growth_factor([], []))


def test_growth_is_the_arithmetic_mean_of_each_sample_s_growth():
    assert growth_factor([20.0, 90.0], [10.0, 30.0]) == 2.5


def test_the_slope_is_one_for_linear_and_two_for_area():
    scales = np.arange(1, 11)
    assert log_log_slope(scales, 3.0 * scales) == pytest.approx(1.0)
    assert log_log_slope(scales, scales**2) == pytest.approx(2.0)
    assert math.isnan(log_log_slope([1], [1.0]))


def test_waypoints_without_a_search_have_no_growth():
    alone = Variant('waypoints_only', 'oracle')
    rows = [row(alone, math.nan, pair=pair, scale=scale) for pair in (0, 1) for scale in (1, 2)]
    assert growth(rows) == []


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
