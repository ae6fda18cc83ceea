"""Confidence intervals by bootstrap over maps.

The samples of one map share its barriers and are not independent, so whole maps are drawn, with
replacement, as many as there are; the interval is the middle 95 % of the means of the draws.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

DRAWS = 2000
LEVEL = 0.95


class Interval(NamedTuple):
    """An estimate with the ends of its confidence interval."""

    value: float
    low: float
    high: float


NOTHING = Interval(float('nan'), float('nan'), float('nan'))


def mean_interval(values: ArrayLike, groups: ArrayLike, seed: int = 0) -> Interval:
    """Return the mean of `values` [n] with its interval; `groups` [n] names each value's map.

    One map says nothing of others: its interval is NaN, unless it has values that are all alike.
    """
    numbers = np.asarray(values, dtype=float)
    if numbers.size == 0:
        return NOTHING
    _, group = np.unique(np.asarray(groups), return_inverse=True)
    sums, counts = np.bincount(group, weights=numbers), np.bincount(group)
    if len(sums) == 1 and (len(numbers) == 1 or np.ptp(numbers) > 0):
        return Interval(float(numbers.mean()), float('nan'), float('nan'))
    # The same seed draws the same maps, so methods run on the same maps stay paired.
    random = np.random.default_rng(seed)
    times = random.multinomial(len(sums), np.full(len(sums), 1.0 / len(sums)), size=DRAWS)
    means = times @ sums / (times @ counts)
    low, high = np.quantile(means, ((1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0))
    return Interval(float(numbers.mean()), float(low), float(high))


def ratio_interval(ratios: ArrayLike, groups: ArrayLike, seed: int = 0) -> Interval:
    """Return (r_1 r_2 ... r_n)^(1/n) of `ratios` [n], all above 0, with its interval."""
    logs = mean_interval(np.log(np.asarray(ratios, dtype=float)), groups, seed)
    return Interval(*(float(value) for value in np.exp(logs)))
