# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Statistics of one metric: spread, shares, and confidence intervals by bootstrap over maps.

The samples of one map share its barriers, so they are not independent. The bootstrap therefore
draws whole maps with replacement, as many as there are, and the interval is the middle 95 % of
the means of the draws. Of few maps it would be too narrow: there, and where runs are compared, a
mean has Student's t with the standard error over maps. Several tests at once are adjusted by
Holm's method.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import nctdtr, stdtr, stdtrit

Floats = NDArray[np.float64]
DRAWS = 2000
# Numbers of maps that are drawn at a time, over all draws.
MAX_DRAWN = 2_000_000
# Over more maps a mean has the interval that its draws approach: they would take minutes.
MOST_MAPS = 4000
LEVEL = 0.95
# Over fewer maps a ratio has the interval of Student's t: with three maps 13 of 100 of the
# bootstrap's missed the truth on one side.
FEW_MAPS = 20
# A standard error of values that are equal but for their last digits.
ROUNDING = 1e-12
# Lengths that differ by less than this share count as equal.
LENGTH_TOLERANCE = 1e-9


class Interval(NamedTuple):
    """An estimate with the limits of its confidence interval."""

    value: float
    low: float
    high: float


class Spread(NamedTuple):
    """Mean, median, 95th percentile and maximum of some values; NaN where there are none."""

    mean: float
    median: float
    p95: float
    worst: float


@dataclass(frozen=True)
class Ratio:
    """Ratios of two variants on the same samples: geometric mean with interval, and spread."""

    mean: Interval
    spread: Spread


UNKNOWN = Interval(float('nan'), float('nan'), float('nan'))
NO_SPREAD = Spread(*[float('nan')] * 4)


def mean_interval(values: ArrayLike, groups: ArrayLike, seed: int = 0) -> Interval:
    """Return the mean of `values` [n] with its interval; `groups` [n] is the map of each value.

    Values of a single map give no interval (NaN), unless there are several and all are equal.
    """
    numbers = np.asarray(values, dtype=float)
    if numbers.size == 0:
        return UNKNOWN
    if len(np.unique(groups)) > MOST_MAPS:
        return estimate(numbers, groups).interval()
    return middle_of(float(numbers.mean()), bootstrap_means(numbers, groups, seed))


def bootstrap_means(values: ArrayLike, groups: ArrayLike, seed: int | Sequence[int]) -> Floats:
    """Return the means [DRAWS] of `values` [n], n > 0, over maps drawn with replacement.

    They are NaN for values of a single map, unless there are several and all are equal.
    """
    numbers = np.asarray(values, dtype=float)
    _, group = np.unique(np.asarray(groups), return_inverse=True)
    sums, counts = np.bincount(group, weights=numbers), np.bincount(group)
    if len(sums) == 1 and (len(numbers) == 1 or np.ptp(numbers) > 0):
        return np.full(DRAWS, np.nan)
    means = []
    # Of many maps few draws at a time: all would take gigabytes.
    block = max(1, MAX_DRAWN // len(sums))
    every = drawn_maps(len(sums), seed if isinstance(seed, int) else tuple(seed))
    for begin in range(0, DRAWS, block):
        times = every[begin : begin + block].astype(float)
        means.append(times @ sums / (times @ counts))
    return np.concatenate(means)


@lru_cache(maxsize=2)
def drawn_maps(count: int, seed: int | tuple[int, ...]) -> NDArray[np.uint16]:
    """Return how often each of `count` maps is in each draw: [DRAWS, count].

    The same seed draws the same maps, so that methods run on the same maps stay paired. The draws
    are kept: the figures of a report are many, and to draw takes longer than to average.
    """
    random = np.random.default_rng(seed)
    times = np.empty((DRAWS, count), dtype=np.uint16)
    block = max(1, MAX_DRAWN // count)
    for begin in range(0, DRAWS, block):
        part = times[begin : begin + block]
        part[:] = random.multinomial(count, np.full(count, 1.0 / count), size=len(part))
    return times


def middle_of(value: float, means: Floats) -> Interval:
    """Return a value with the middle of the means of bootstrap draws as its interval."""
    low, high = np.quantile(means, ((1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0))
    return Interval(value, float(low), float(high))


class Estimate(NamedTuple):
    """A mean, its standard error over maps, and the degrees of freedom: one less than maps.

    The error of a single map is NaN.
    """

    value: float
    error: float
    degrees: int

    def interval(self) -> Interval:
        """Return the mean with the 95 % interval of Student's t, NaN of a single map."""
        half = float(stdtrit(self.degrees, (1.0 + LEVEL) / 2.0)) * self.error
        return Interval(self.value, self.value - half, self.value + half)

    def p_above(self, limit: float) -> float:
        """Return the one-sided p-value of a mean of at most `limit`; NaN of a single map."""
        if self.error == 0.0:
            return 0.0 if self.value > limit else 1.0
        return float(stdtr(self.degrees, (limit - self.value) / self.error))

    def power(self, beyond: float, level: float) -> float:
        """Return how probably a mean that lies so far `beyond` the limit has p < `level`."""
        if self.error == 0.0:
            return 1.0
        needed = stdtrit(self.degrees, 1.0 - level)
        return float(1.0 - nctdtr(self.degrees, beyond / self.error, needed))


def estimate(values: ArrayLike, groups: ArrayLike) -> Estimate:
    """Return the mean of `values` [n] with its error; `groups` [n] is the map of each value.

    With s and c the sum and the number of the values of one of G maps the mean is
    r = sum(s) / sum(c), and its standard error the delta method's for a ratio of sums:
    sqrt(G / (G - 1) sum((s - r c)^2)) / sum(c).
    """
    numbers = np.asarray(values, dtype=float)
    if numbers.size == 0:
        return Estimate(math.nan, math.nan, 0)
    _, group = np.unique(np.asarray(groups), return_inverse=True)
    sums, counts = np.bincount(group, weights=numbers), np.bincount(group)
    mean, degrees = float(numbers.mean()), len(sums) - 1
    squares = float(np.square(sums - mean * counts).sum())
    factor = len(sums) / degrees if degrees else math.nan
    error = math.sqrt(factor * squares) / len(numbers)
    return Estimate(mean, 0.0 if error < ROUNDING else error, degrees)


def holm(p_values: Sequence[float]) -> list[float]:
    """Return p-values adjusted for being several; those that are NaN are no tests.

    That any of them is below a level although nothing differs has at most that probability,
    however the tests depend on each other (Holm, 1979).
    """
    adjusted, least = list(p_values), 0.0
    tests = sorted((p, index) for index, p in enumerate(p_values) if not math.isnan(p))
    for rank, (p, index) in enumerate(tests):
        least = max(least, min(1.0, (len(tests) - rank) * p))
        adjusted[index] = least
    return adjusted


def wilson_interval(count: int, total: int) -> Interval:
    """Return the share `count` of `total` with Wilson's score interval, NaN of nothing.

    Unlike the bootstrap's it has a width where none or all are counted.
    """
    if total == 0:
        return UNKNOWN
    z = NormalDist().inv_cdf((1.0 + LEVEL) / 2.0)
    share_of, spread_of = count / total, z * z / total
    middle = (share_of + spread_of / 2.0) / (1.0 + spread_of)
    half = math.sqrt(share_of * (1.0 - share_of) * spread_of + spread_of**2 / 4.0)
    half /= 1.0 + spread_of
    return Interval(share_of, max(middle - half, 0.0), min(middle + half, 1.0))


def known(values: ArrayLike, groups: ArrayLike) -> tuple[Floats, NDArray[Any]]:
    """Return the values that are not NaN, and their groups."""
    array = np.asarray(values, dtype=float)
    return array[~np.isnan(array)], np.asarray(groups)[~np.isnan(array)]


def ratio_interval(ratios: ArrayLike, groups: ArrayLike, seed: int = 0) -> Interval:
    """Return the geometric mean (r_1 r_2 ... r_n)^(1/n) of the known ratios with its interval."""
    values, kept = known(ratios, groups)
    is_few, logs = 1 < len(np.unique(kept)) < FEW_MAPS, np.log(values)
    mean = estimate(logs, kept).interval() if is_few else mean_interval(logs, kept, seed)
    return Interval(*(float(value) for value in np.exp(mean)))


def spread(values: ArrayLike) -> Spread:
    """Return mean = sum(v) / n, median, p95 (linear between ranks) and max(v) of known values."""
    array = np.asarray(values, dtype=float)
    array = array[~np.isnan(array)]
    if array.size == 0:
        return NO_SPREAD
    median, p95 = np.percentile(array, (50, 95))
    return Spread(float(array.mean()), float(median), float(p95), float(array.max()))


def ratio_of(ratios: ArrayLike, groups: ArrayLike, seed: int) -> Ratio:
    """Return mean and spread of the known ratios and the interval of the mean."""
    return Ratio(ratio_interval(ratios, groups, seed), spread(ratios))


def is_optimal(lengths: ArrayLike, best: ArrayLike) -> NDArray[np.bool_]:
    """Tell which lengths are at most those of A* (`best`), up to rounding."""
    found, reference = np.asarray(lengths, dtype=float), np.asarray(best, dtype=float)
    return np.asarray(found <= reference * (1.0 + LENGTH_TOLERANCE))
