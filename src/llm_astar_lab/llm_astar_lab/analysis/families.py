"""The figures of a variant by family of maps, and means that leave out one family at a time.

In a mean over families each family weighs the same, however many samples it has. What changes
when one is left out shows how much of a figure hangs on it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from llm_astar_lab.analysis.statistics import (
    UNKNOWN,
    Interval,
    bootstrap_means,
    mean_interval,
    middle_of,
    ratio_interval,
)


@dataclass(frozen=True)
class FamilySummary:
    """A variant on the maps of one family.

    `valid` is the share of the samples with a valid path; `operation` and `length` are geometric
    means of the ratios to A*, over the samples that both solved.
    """

    samples: int
    maps: int
    valid: Interval
    operation: Interval
    length: Interval


@dataclass(frozen=True)
class FamilyMeans:
    """Geometric means of the families' operation ratios: of all, and without each one of them."""

    every: Interval = UNKNOWN
    without: Mapping[str, Interval] = field(default_factory=dict)


class Grouped:
    """Numbers [n] with the map and the family [n] of each; families are whole numbers."""

    def __init__(self, values: ArrayLike, maps: ArrayLike, families: ArrayLike) -> None:
        """Take arrays of one length."""
        self._values = np.asarray(values, dtype=float)
        self._maps, self._families = np.asarray(maps), np.asarray(families)

    def of(self, family: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the numbers of a family and their maps."""
        chosen = self._families == family
        return self._values[chosen], self._maps[chosen]


def family_summaries(
    names: Mapping[str, int], valid: Grouped, operation: Grouped, length: Grouped, seed: int
) -> dict[str, FamilySummary]:
    """Summarise the samples of each family that has some; `names` has the families' numbers.

    `valid` has a number a sample, 1 where there is a valid path; `operation` and `length` have
    ratios to A*, for the samples that both solved.
    """
    found = {}
    for name, number in names.items():
        flags, maps = valid.of(number)
        if not len(flags):
            continue
        ratios = [ratio_interval(*part.of(number), seed) for part in (operation, length)]
        found[name] = FamilySummary(
            len(flags), len(np.unique(maps)), mean_interval(flags, maps, seed), *ratios
        )
    return found


def family_means(
    summaries: Mapping[str, FamilySummary], names: Mapping[str, int], ratios: Grouped, seed: int
) -> FamilyMeans:
    """Return the mean of two or more families' ratios, and the means without each of them.

    The intervals are by bootstrap over the maps of every family. Without a ratio in one of the
    families the means are unknown: they would be of other families than those of other variants.
    """
    if len(summaries) < 2 or not all(item.operation.value > 0 for item in summaries.values()):
        return FamilyMeans()
    logs = {name: np.log(item.operation.value) for name, item in summaries.items()}
    draws = {}
    for name in summaries:
        values, maps = ratios.of(names[name])
        draws[name] = bootstrap_means(np.log(values), maps, (seed, names[name]))

    def mean_without(left_out: str | None) -> Interval:
        kept = [name for name in summaries if name != left_out]
        means = np.mean([draws[name] for name in kept], axis=0)
        mean = middle_of(float(np.mean([logs[name] for name in kept])), means)
        return Interval(*(float(np.exp(end)) for end in mean))

    return FamilyMeans(mean_without(None), {name: mean_without(name) for name in summaries})
