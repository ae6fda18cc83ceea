"""Compares the lengths found with the optimal lengths that come with a dataset."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap
from llm_astar_planner.search.methods import EXACT

from llm_astar_lab.results.row import Row, Variant

# Reference lengths are printed with at least two digits.
ABSOLUTE_TOLERANCE, RELATIVE_TOLERANCE = 0.005, 1e-6
# With these heuristics A* never overestimates the remaining length.
ADMISSIBLE = frozenset({'euclidean', 'octile', 'chebyshev'})


@dataclass(frozen=True)
class Agreement:
    """How many rows of a variant have the reference length.

    `first` describes the first row that has not; it is empty where all agree.
    """

    variant: Variant
    rows: int
    agreeing: int
    first: str = ''

    def __str__(self) -> str:
        """Return it as one line."""
        text = (
            f'{self.variant}: {self.agreeing} of {self.rows} rows agree with the optimal length '
            'in the dataset'
        )
        return f'{text}; the first that does not: {self.first}' if self.first else text


def agrees(length: float, reference: float) -> bool:
    """Tell whether a length equals the reference, up to the printed digits."""
    return abs(length - reference) <= ABSOLUTE_TOLERANCE + RELATIVE_TOLERANCE * length


def reference_lengths(maps: Iterable[ProblemMap]) -> dict[tuple[int, int], float]:
    """Return the reference lengths by map id and pair; barrier maps have none."""
    return {
        (item.id, pair): length
        for item in maps
        for pair, length in enumerate(getattr(item, 'optimal_lengths', ()))
        if length == length  # noqa: PLR0124 - NaN
    }


def compare_with_reference(
    rows: Iterable[Row], lengths: Mapping[tuple[int, int], float], heuristic: str
) -> list[Agreement]:
    """Compare the rows of the exact methods with the reference lengths, variant by variant.

    Only rows at scale 1 are: finer maps have other lengths. A row without a path does not agree.
    `astar` is exact only with an admissible heuristic.
    """
    exact = {EXACT, 'astar'} if heuristic in ADMISSIBLE else {EXACT}
    compared: dict[Variant, int] = {}
    # How many rows do not agree, and the first of them.
    off: dict[Variant, tuple[int, str]] = {}
    for row in rows:
        reference = lengths.get((row.map, row.pair))
        if row.method not in exact or row.scale != 1 or reference is None:
            continue
        compared[row.variant] = compared.get(row.variant, 0) + 1
        if not (row.found and agrees(row.length, reference)):
            count, first = off.get(row.variant, (0, describe(row, reference)))
            off[row.variant] = count + 1, first
    agreements = []
    for variant, count in compared.items():
        differing, first = off.get(variant, (0, ''))
        agreements.append(Agreement(variant, count, count - differing, first))
    return agreements


def describe(row: Row, reference: float) -> str:
    """Say which row it is and what it has instead of the reference length."""
    found = f'length {row.length:.6f}' if row.found else row.code
    return f'map {row.map}, pair {row.pair}, {found}, in the dataset {reference:g}'
