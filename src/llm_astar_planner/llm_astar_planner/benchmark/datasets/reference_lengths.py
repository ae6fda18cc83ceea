"""Lengths found held against the optimal lengths that a dataset publishes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from llm_astar_planner.benchmark.datasets.samples import ProblemMap
from llm_astar_planner.benchmark.results import Case, Row
from llm_astar_planner.search.paper import EXACT

# Published lengths are printed with two digits or more.
ABSOLUTE, RELATIVE = 0.005, 1e-6
# With these A* never estimates more than is left to go.
ADMISSIBLE = frozenset({'euclidean', 'octile', 'chebyshev'})


@dataclass(frozen=True)
class Agreement:
    """How many of a case's rows have the published length, and the first that has not."""

    case: Case
    rows: int
    agreeing: int
    first: str = ''

    def __str__(self) -> str:
        """Say it in a line."""
        text = (
            f'{self.case}: {self.agreeing} of {self.rows} rows agree with the published '
            'optimal length'
        )
        return f'{text}; the first that does not: {self.first}' if self.first else text


def agrees(length: float, published: float) -> bool:
    """Tell whether a length is the published one, up to the digits it is printed with."""
    return abs(length - published) <= ABSOLUTE + RELATIVE * length


def published_lengths(maps: Iterable[ProblemMap]) -> dict[tuple[int, int], float]:
    """Return the published lengths by map id and pair; barrier maps have none."""
    return {
        (item.id, pair): length
        for item in maps
        for pair, length in enumerate(getattr(item, 'optimal_lengths', ()))
        if length == length  # noqa: PLR0124 - NaN
    }


def compare_published(
    rows: Sequence[Row], lengths: Mapping[tuple[int, int], float], heuristic: str
) -> list[Agreement]:
    """Hold the rows of the exact methods against the published lengths, case by case.

    A row without a path does not agree. `astar` is exact with a heuristic that never overrates.
    """
    exact = {EXACT, 'astar'} if heuristic in ADMISSIBLE else {EXACT}
    held = [row for row in rows if row.method in exact and (row.map, row.pair) in lengths]
    return [
        _agreement(case, [row for row in held if row.case == case], lengths)
        for case in dict.fromkeys(row.case for row in held)
    ]


def _agreement(
    case: Case, rows: Sequence[Row], lengths: Mapping[tuple[int, int], float]
) -> Agreement:
    off = [
        row for row in rows if not (row.found and agrees(row.length, lengths[row.map, row.pair]))
    ]
    first = ''
    if off:
        row = off[0]
        found = f'length {row.length:.6f}' if row.found else row.code
        published = lengths[row.map, row.pair]
        first = f'map {row.map}, pair {row.pair}, {found}, published {published:g}'
    return Agreement(case, len(rows), len(rows) - len(off), first)
