"""Figures by family of maps, and means without one family, against a recomputation by hand."""

import math
import statistics
from itertools import chain

import numpy as np
import pytest
from llm_astar_lab.analysis.statistics import UNKNOWN, Interval
from llm_astar_lab.analysis.summary import FamilySummary, family_means, summarise
from llm_astar_lab.report.table import family_tables, markdown
from llm_astar_lab.results.row import Row

# Operation of llm_astar over that of A*, by family and map.
RATIOS = {'rooms': [[0.2, 0.3], [0.4, 0.5], [0.3, 0.2]], 'mazes': [[1.1, 1.2], [1.4, 1.3]]}


def rows_of(ratios, code='NONE'):
    numbers = iter(range(100))
    for family, maps in ratios.items():
        for of_map in maps:
            number = next(numbers)
            for pair, ratio in enumerate(of_map):
                place = number, pair, 1
                yield Row(*place, 'astar', 'none', '', '', 'NONE', 50, 50, 9, family=family)
                found = {'operation': 50 * ratio, 'storage': 1, 'length': 9 + ratio}
                yield Row(*place, 'llm_astar', 'none', '', '', code, **found, family=family)


def summary_of(rows):
    return next(item for item in summarise(rows) if item.variant.method == 'llm_astar')


def geometric(values):
    return math.exp(statistics.fmean(map(math.log, values)))


def test_each_family_has_its_own_means():
    summary = summary_of(rows_of(RATIOS))
    for family, maps in RATIOS.items():
        found, values = summary.families[family], [*chain(*maps)]
        assert (found.samples, found.maps) == (len(values), len(maps))
        assert found.operation.value == pytest.approx(geometric(values))
        assert found.operation.low < found.operation.value < found.operation.high
        assert found.length.value == pytest.approx(geometric(1 + value / 9 for value in values))
        assert found.valid.value == 1.0


def test_in_a_mean_over_families_each_weighs_the_same_and_one_is_left_out():
    three = RATIOS | {'aisles': [[0.9, 0.8], [0.7, 0.9], [0.8, 0.8]]}
    means = summary_of(rows_of(three)).family_means
    values = {name: geometric([*chain(*maps)]) for name, maps in three.items()}
    assert means.every.value == pytest.approx(geometric(values.values()))
    for name, found in means.without.items():
        rest = geometric(value for other, value in values.items() if other != name)
        assert found.value == pytest.approx(rest)
        assert found.low < rest < found.high
    assert list(means.without) == list(three)


def test_the_interval_over_families_holds_the_truth_about_as_often_as_it_says():
    draw, hits, seeds = np.random.default_rng(0), 0, {'a': (0, 0), 'b': (0, 1)}
    for _ in range(60):
        logs = {'a': draw.normal(-1.0, 0.3, 30), 'b': draw.normal(0.0, 0.3, 40)}
        ratios = {name: (np.exp(values), np.arange(len(values))) for name, values in logs.items()}
        known = {
            name: FamilySummary(9, 9, UNKNOWN, Interval(math.exp(values.mean()), 0, 0), UNKNOWN)
            for name, values in logs.items()
        }
        means = family_means(known, ratios, seeds)
        hits += means.every.low <= math.exp(-0.5) <= means.every.high
    assert 52 <= hits < 60


def test_a_single_family_and_unsolved_ones_have_no_means():
    alone = summary_of(rows_of({'rooms': RATIOS['rooms']}))
    assert (alone.families, alone.family_means.without) == ({}, {})
    rows = [*rows_of(RATIOS, 'NO_VALID_PATH')]
    summary = summary_of(rows)
    assert summary.families['mazes'].valid.value == 0.0
    assert math.isnan(summary.family_means.every.value)
    operation, valid, left_out = family_tables(summarise(rows))
    # A* alone has ratios to A*, and the other one alone misses paths.
    assert [row[0] for row in operation.rows] == [row[0] for row in left_out.rows] == ['A*']
    assert [row[0] for row in valid.rows] == ['LLM-A*, no waypoints']


def test_only_the_first_families_are_shown():
    ratios = {f'family {number:02}': [[0.5], [0.6]] for number in range(14)}
    operation, _, left_out = family_tables(summarise(rows_of(ratios)))
    assert len(operation.columns) == 13
    assert len(left_out.columns) == 14
    assert operation.note.endswith('The first 12 of 14 families.')
    assert 'without family 11 (%)' in markdown(left_out)
    assert 'family 12' not in markdown(left_out)
