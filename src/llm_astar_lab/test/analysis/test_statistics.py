"""Statistics equal their formulas; intervals draw whole maps and widen for correlated samples."""

import math
import tracemalloc

import numpy as np
import pytest
from llm_astar_lab.analysis.statistics import (
    is_optimal,
    mean_interval,
    ratio_interval,
    spread,
    wilson_interval,
)


def values(rng, maps, pairs, within):
    """Return values and maps: each map has its own level, its samples spread by `within`."""
    levels = np.repeat(rng.normal(size=maps), pairs)
    return levels + within * rng.normal(size=maps * pairs), np.repeat(np.arange(maps), pairs)


def test_the_estimate_is_the_mean_and_lies_inside():
    interval = mean_interval([1.0, 2.0, 3.0, 6.0], [0, 0, 1, 1])
    assert interval.value == 3.0
    assert interval.low <= 3.0 <= interval.high


def test_the_same_seed_draws_the_same_maps():
    data = values(np.random.default_rng(0), 20, 5, 1.0)
    assert mean_interval(*data, seed=4) == mean_interval(*data, seed=4)
    assert mean_interval(*data, seed=4) != mean_interval(*data, seed=5)


def test_samples_of_one_map_do_not_count_as_independent():
    numbers, maps = values(np.random.default_rng(1), 40, 10, 0.1)
    clustered = mean_interval(numbers, maps)
    alone = mean_interval(numbers, np.arange(len(numbers)))
    assert clustered.high - clustered.low > 2 * (alone.high - alone.low)


def test_the_draws_of_many_maps_are_made_in_parts_which_changes_no_interval(monkeypatch):
    data = values(np.random.default_rng(0), 3000, 1, 1.0)
    tracemalloc.start()
    interval = mean_interval(*data)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 45e6  # all draws at once take 48 MB twice
    monkeypatch.setattr('llm_astar_lab.analysis.statistics.MAX_DRAWN', 10**9)
    assert mean_interval(*data) == pytest.approx(interval, rel=1e-12)


def test_the_interval_over_very_many_maps_is_what_the_draws_approach(monkeypatch):
    random = np.random.default_rng(3)
    groups = random.integers(0, 900, 3000)
    data = 5.0 + random.normal(size=900)[groups] + random.normal(size=3000), groups
    drawn = mean_interval(*data)
    monkeypatch.setattr('llm_astar_lab.analysis.statistics.MOST_MAPS', 800)
    normal = mean_interval(*data)
    assert normal.value == drawn.value
    width = drawn.high - drawn.low
    assert normal.low == pytest.approx(drawn.low, abs=0.06 * width)
    assert normal.high == pytest.approx(drawn.high, abs=0.06 * width)
    assert normal != drawn


def test_about_95_of_100_intervals_hold_the_truth():
    rng = np.random.default_rng(2)
    intervals = [mean_interval(*values(rng, 60, 3, 0.5), seed=i) for i in range(200)]
    hits = sum(interval.low <= 0.0 <= interval.high for interval in intervals)
    assert 0.88 <= hits / 200 <= 0.99


def test_ratios_are_averaged_geometrically():
    interval = ratio_interval([0.5, 2.0, 0.5, 2.0], [0, 1, 2, 3])
    assert interval.value == pytest.approx(1.0)
    assert interval.low < 1.0 < interval.high
    assert ratio_interval([0.5, 1.0, 4.0], [0, 1, 2]).value == pytest.approx(2.0 ** (1 / 3))


def test_a_single_map_gives_no_interval_and_no_value_gives_no_mean():
    alone = mean_interval([1.0, 3.0], [7, 7])
    assert alone.value == 2.0
    assert math.isnan(alone.low)
    assert math.isnan(alone.high)
    assert math.isnan(mean_interval([1.0], [7]).low)
    assert mean_interval([1.0, 1.0], [7, 7]) == (1.0, 1.0, 1.0)
    assert all(math.isnan(value) for value in mean_interval([], []))


def test_no_values_give_no_figures():
    assert all(math.isnan(value) for value in spread([]))


def test_spread_names_mean_median_p95_and_worst():
    assert spread(range(101)) == (50.0, 50.0, 95.0, 100.0)


def test_optimal_allows_rounding_alone():
    assert is_optimal([10.0, 10.0 + 1e-12, 10.001], [10.0] * 3).tolist() == [True, True, False]


@pytest.mark.parametrize(
    ('count', 'total', 'low', 'high'),
    # The first two are the example of Newcombe (1998), table I: 81 of 263 and 0 of 20.
    [(81, 263, 0.2553, 0.3662), (0, 20, 0.0, 0.1611), (20, 20, 0.8389, 1.0)],
)
def test_the_interval_of_a_share_is_that_of_wilson(count, total, low, high):
    interval = wilson_interval(count, total)
    assert interval.value == count / total
    assert (interval.low, interval.high) == pytest.approx((low, high), abs=1e-4)
    assert np.isnan(wilson_interval(0, 0).value)
