"""How work grows with the map: growth factors over scales and their log-log slopes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from llm_astar_planner.benchmark.results import Row, Variant

QUANTITIES = ('operation', 'storage')


@dataclass(frozen=True)
class Growth:
    """The growth of one variant in one quantity, over the `samples` solved at every scale."""

    variant: Variant
    quantity: str
    samples: int
    scales: tuple[int, ...]
    factors: tuple[float, ...]
    slope: float


def growth(rows: Sequence[Row]) -> list[Growth]:
    """Return the growth of every variant that was run at more than one scale.

    Only samples with a valid path at every scale of the variant count, so that all its factors
    are over the same samples.
    """
    solved: dict[Variant, dict[int, dict[tuple[int, int], Row]]] = defaultdict(dict)
    for row in rows:
        if row.found and row.operation > 0:
            solved[row.variant].setdefault(row.scale, {})[row.map, row.pair] = row
    found = []
    for variant, by_scale in solved.items():
        if len(by_scale) < 2 or 1 not in by_scale:
            continue
        scales = tuple(sorted(by_scale))
        samples = sorted(set.intersection(*(set(of_scale) for of_scale in by_scale.values())))
        for quantity in QUANTITIES:
            columns = {
                scale: [float(getattr(by_scale[scale][sample], quantity)) for sample in samples]
                for scale in scales
            }
            factors = tuple(growth_factor(columns[scale], columns[1]) for scale in scales)
            slope = log_log_slope(scales, factors) if samples else float('nan')
            found.append(Growth(variant, quantity, len(samples), scales, factors, slope))
    return found


def growth_factor(scaled: ArrayLike, base: ArrayLike) -> float:
    """Return (1/n) sum_i scaled_i / base_i, the paper's mean growth of n samples from scale 1."""
    ratios = np.asarray(scaled, dtype=float) / np.asarray(base, dtype=float)
    return float(ratios.mean()) if ratios.size else float('nan')


def log_log_slope(scales: ArrayLike, growth: ArrayLike) -> float:
    """Fit log(growth) = slope log(scale) + c by least squares and return the slope.

    1 is linear in the scale, 2 is proportional to the area of the map. NaN for a single scale.
    """
    xs, ys = np.asarray(scales, dtype=float), np.asarray(growth, dtype=float)
    if len(np.unique(xs)) < 2:
        return float('nan')
    return float(np.polyfit(np.log(xs), np.log(ys), 1)[0])
