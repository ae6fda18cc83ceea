"""A summary holds every metric; variants are ordered as in the paper."""

import math

import pytest
from benchmark_samples import A_STAR, MODEL, NONE, ORACLE, row
from llm_astar_planner.benchmark.analysis.summary import (
    Price,
    report_order,
    summarise,
)
from llm_astar_planner.benchmark.results import Variant


def test_a_summary_holds_each_metric():
    rows = [
        row(A_STAR, 100.0, 10.0),
        row(A_STAR, 100.0, 10.0, pair=1),
        row(A_STAR, 100.0, 10.0, map_id=1),
        row(MODEL, 25.0, 10.0, verdicts='accepted;occupied', waypoints='1,2;3,4', prompt_tokens=9),
        row(MODEL, 100.0, 12.0, pair=1, completion_tokens=1, source_status='TIMEOUT'),
        row(MODEL, 10.0, math.nan, map_id=1, code='NO_VALID_PATH'),
    ]
    summary = summarise(rows, price=Price(1e5, 1e6))[1]
    assert summary.variant == MODEL
    assert (summary.samples, summary.maps, summary.unanswered) == (3, 2, 1)
    assert summary.valid.value == pytest.approx(2 / 3)
    assert summary.operation.mean.value == pytest.approx(0.5)
    assert summary.operation.spread.worst == 1.0
    assert summary.length.mean.value == pytest.approx(math.sqrt(1.2))
    assert summary.optimal == 0.5
    assert summary.verdicts == {'accepted': 0.5, 'occupied': 0.5}
    assert summary.waypoints == pytest.approx(2 / 3)
    assert summary.cost == pytest.approx(0.9 + 1.0)


def test_variants_are_ordered_as_in_the_paper_with_baselines_below_models():
    alone, guided = Variant('waypoints_only', 'oracle'), Variant('guided')
    variants = [ORACLE, guided, NONE, MODEL, alone, A_STAR]
    assert sorted(variants, key=report_order) == [
        A_STAR, alone, MODEL, NONE, ORACLE, guided,
    ]  # fmt: skip
