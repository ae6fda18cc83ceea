"""The benchmark's figures, each with its formula. Ratios are x / A*'s x on the same sample.

The paper's are the geometric means of the ratios, the valid path ratio and the growth factor
(sec. 4.3 and its appendix); the spread beside each mean is ours. The geometric means are in
`statistics`, with their intervals.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Lengths that differ by less than this part are the same length.
LENGTH_TOLERANCE = 1e-9


class Spread(NamedTuple):
    """Mean, median, 95th percentile and largest of some values; NaN where there are none."""

    mean: float
    median: float
    p95: float
    worst: float


NO_SPREAD = Spread(*[float('nan')] * 4)


def spread(values: ArrayLike) -> Spread:
    """Give mean = sum(v) / n, median, p95 (linear between ranks) and worst = max(v)."""
    array = np.asarray(values, dtype=float)
    if array.size == 0:
        return NO_SPREAD
    median, p95 = np.percentile(array, (50, 95))
    return Spread(float(array.mean()), float(median), float(p95), float(array.max()))


def share(flags: ArrayLike) -> float:
    """Give k / n, how many of n flags are set; of found paths that is the valid path ratio."""
    array = np.asarray(flags, dtype=bool)
    return float(array.mean()) if array.size else float('nan')


def optimal(lengths: ArrayLike, best: ArrayLike) -> NDArray[np.bool_]:
    """Tell which lengths are no longer than A*'s (`best`); the share of these is optimal share."""
    found, reference = np.asarray(lengths, dtype=float), np.asarray(best, dtype=float)
    return np.asarray(found <= reference * (1.0 + LENGTH_TOLERANCE))


def growth_factor(scaled: ArrayLike, base: ArrayLike) -> float:
    """(1/n) sum_i scaled_i / base_i: the mean growth of n samples from their map at scale 1."""
    ratios = np.asarray(scaled, dtype=float) / np.asarray(base, dtype=float)
    return float(ratios.mean()) if ratios.size else float('nan')


def log_log_slope(scales: ArrayLike, growth: ArrayLike) -> float:
    """Fit log(growth) = slope log(scale) + c by least squares and return the slope.

    1 is linear in the scale, 2 is in step with the area of the map. NaN for a single scale.
    """
    xs, ys = np.asarray(scales, dtype=float), np.asarray(growth, dtype=float)
    if len(np.unique(xs)) < 2:
        return float('nan')
    return float(np.polyfit(np.log(xs), np.log(ys), 1)[0])
