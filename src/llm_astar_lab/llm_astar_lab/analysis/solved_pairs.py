"""The samples that two variants of a run both solved, and the ratios of their figures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from llm_astar_lab.analysis.columns import VariantColumns
from llm_astar_lab.analysis.statistics import (
    UNKNOWN,
    Interval,
    Spread,
    ratio_interval,
    spread,
)


@dataclass(frozen=True)
class Ratio:
    """Ratios of two variants on the same samples: geometric mean with interval, and spread."""

    mean: Interval
    spread: Spread


@dataclass(frozen=True)
class SolvedPairs:
    """The n samples on which two variants both found a path.

    `places` are the indices [n] of their rows among those of the first variant and the second.
    """

    rows: VariantColumns
    base: VariantColumns
    places: tuple[NDArray[np.intp], NDArray[np.intp]]

    @classmethod
    def of(cls, rows: VariantColumns, base: VariantColumns | None) -> SolvedPairs:
        """Pair the rows of two variants by sample; no pair without a second variant."""
        nowhere = np.zeros(0, dtype=np.intp)
        if base is None:
            return cls(rows, rows, (nowhere, nowhere))
        solved = [np.flatnonzero(columns.flags('found')) for columns in (rows, base)]
        _, first, second = np.intersect1d(
            rows.samples()[solved[0]],
            base.samples()[solved[1]],
            assume_unique=True,
            return_indices=True,
        )
        return cls(rows, base, (solved[0][first], solved[1][second]))

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.places[0])

    @property
    def maps(self) -> NDArray[np.float64]:
        """The map of each sample [n]."""
        return self.rows.column('map')[self.places[0]]

    def columns(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return a column [n] of the first variant and of the second."""
        first, second = self.places
        return self.rows.column(name)[first], self.base.column(name)[second]

    def quotients(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return first / second of a column where both are above 0, and the maps of these."""
        return quotients(*self.columns(name), self.maps)

    def ratio(self, name: str, seed: int) -> Ratio:
        """Return the ratios of a column."""
        return ratio_of(*self.quotients(name), seed)


def quotients(
    values: NDArray[np.float64], base: NDArray[np.float64], groups: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return values / base where both are above 0, and what `groups` [..., n] has for these."""
    usable = (values > 0) & (base > 0)
    return values[usable] / base[usable], groups[..., usable]


def ratio_of(values: NDArray[np.float64], maps: NDArray[np.float64], seed: int) -> Ratio:
    """Return mean and spread of ratios and the interval of the mean."""
    return Ratio(ratio_interval(values, maps, seed) if len(values) else UNKNOWN, spread(values))
