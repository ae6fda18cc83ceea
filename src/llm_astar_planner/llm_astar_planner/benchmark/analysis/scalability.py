"""How work grows with the map: growth factors over scales and their log-log slopes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from llm_astar_planner.benchmark.analysis.metrics import growth_factor, log_log_slope
from llm_astar_planner.benchmark.results import Case, Row

QUANTITIES = ('operation', 'storage')


@dataclass(frozen=True)
class Growth:
    """One case's growth in one quantity, on the `samples` solved at every scale."""

    case: Case
    quantity: str
    samples: int
    scales: tuple[int, ...]
    factors: tuple[float, ...]
    slope: float


def growth(rows: Sequence[Row]) -> list[Growth]:
    """Return the growth of every case that ran at more than one scale.

    Only samples with a valid path at each of the case's scales count, so that all factors are
    over the same samples.
    """
    values: dict[Case, dict[int, dict[tuple[int, int], Row]]] = defaultdict(dict)
    for row in rows:
        if row.found and row.operation > 0:
            values[row.case].setdefault(row.scale, {})[row.map, row.pair] = row
    return [
        _growth(case, quantity, by_scale)
        for case, by_scale in values.items()
        if len(by_scale) > 1 and 1 in by_scale
        for quantity in QUANTITIES
    ]


def _growth(case: Case, quantity: str, by_scale: dict[int, dict[tuple[int, int], Row]]) -> Growth:
    scales = tuple(sorted(by_scale))
    samples = sorted(set.intersection(*(set(rows) for rows in by_scale.values())))
    columns = {
        scale: [float(getattr(by_scale[scale][sample], quantity)) for sample in samples]
        for scale in scales
    }
    factors = tuple(growth_factor(columns[scale], columns[1]) for scale in scales)
    slope = log_log_slope(scales, factors) if samples else float('nan')
    return Growth(case, quantity, len(samples), scales, factors, slope)
