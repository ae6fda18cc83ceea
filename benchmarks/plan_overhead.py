"""Measure one call of Planner.plan: CPU microseconds by method, on a small map and a large one.

The variants take turns on the same queries, so that other load on the machine slows them all
alike. Of each query the median counts, of these the mean. Run it with
`python -m benchmarks.plan_overhead --help`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_msgs_adapter.maps.grid_map import OCCUPIED, GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.compile import compile_kernels
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.resources import find_file
from llm_astar_planner.search.methods import EXACT, GUIDED
from llm_astar_planner.search.paper import PAPER_METHODS
from llm_astar_planner.search.result import Cell

ROUNDS = 15
LARGE = 1000
# The graded costs of the large map are those of a robot of this size, in cells.
GRADED = CostmapConfig(robot_radius=2.0, inflation_radius=10.0)


class Query(NamedTuple):
    """A query on a map, with a planner that has landmarks and one that has none."""

    planner: Planner
    without_landmarks: Planner
    start: Cell
    goal: Cell


class Variant(NamedTuple):
    """One way to ask for a plan."""

    method: str
    landmarks: bool = False
    any_angle: bool = False
    expanded: bool = False


VARIANTS = (
    Variant(EXACT),
    Variant(EXACT, any_angle=True),
    Variant(EXACT, expanded=True),
    Variant(GUIDED),
    Variant(GUIDED, landmarks=True),
    Variant(GUIDED, landmarks=True, any_angle=True),
    *(Variant(method) for method in PAPER_METHODS),
)


@dataclass(frozen=True)
class OverheadRow:
    """One variant on one map: microseconds of CPU of a plan, and of wall time of its search."""

    case: str
    variant: Variant
    plan: float
    search: float


def barrier_queries(maps: int) -> list[Query]:
    """Return the queries of the first barrier maps of the demo, 51 by 31 cells each."""
    queries = []
    for barrier_map in load_barrier_maps(find_file('demo.json', 'maps'))[:maps]:
        grid_map = barrier_map.to_grid()
        ends = [
            (barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal))
            for sample in barrier_map.samples
        ]
        queries += queries_on(grid_map, CostmapConfig(corner_cutting=True), ends)
    return queries


def large_queries(size: int, config: CostmapConfig, count: int = 4) -> list[Query]:
    """Return queries between opposite sides of a square map of `size` cells with random boxes."""
    random = np.random.default_rng(0)
    cells = np.zeros((size, size), dtype=np.int8)
    for _ in range(size * size // 4000):
        x, y = random.integers(size // 20, size - size // 20, 2)
        width, height = random.integers(5, 30, 2)
        cells[y : y + height, x : x + width] = OCCUPIED
    cells[:, : size // 20] = cells[:, -(size // 20) :] = 0
    heights = random.integers(size // 10, size - size // 10, (count, 2)).tolist()
    ends = [((size // 40, low), (size - size // 40, high)) for low, high in heights]
    return queries_on(GridMap(cells), config, ends)


def queries_on(
    grid_map: GridMap, config: CostmapConfig, ends: Sequence[tuple[Cell, Cell]]
) -> list[Query]:
    """Return queries on a map for which everything is prepared."""
    planner, without_landmarks = Planner(grid_map, config), Planner(grid_map, config)
    planner.prepare()
    without_landmarks.costmap.prepare()
    return [Query(planner, without_landmarks, start, goal) for start, goal in ends]


def plan_once(query: Query, variant: Variant) -> tuple[float, float]:
    """Plan; return the thread's CPU time and the wall time of the search, in microseconds."""
    request = PlanRequest(
        query.start,
        query.goal,
        variant.method,
        any_angle=variant.any_angle,
        want_expanded=variant.expanded,
        time_limit=60.0,
    )
    planner = query.planner if variant.landmarks else query.without_landmarks
    begin = time.thread_time_ns()
    plan = planner.plan(request)
    microseconds = (time.thread_time_ns() - begin) / 1e3
    if not len(plan.path):
        raise RuntimeError(f'{variant.method} found no path: {plan.message}')
    return microseconds, plan.seconds_search * 1e6


def measure(
    case: str,
    queries: Sequence[Query],
    variants: Sequence[Variant] = VARIANTS,
    rounds: int = ROUNDS,
) -> list[OverheadRow]:
    """Time the variants on each query, taking turns, `rounds` times after one warm-up round."""
    times = np.empty((rounds + 1, len(variants), len(queries), 2))
    for taken in times:
        for number, variant in enumerate(variants):
            taken[number] = [plan_once(query, variant) for query in queries]
    plans, searches = np.median(times[1:], axis=0).mean(axis=1).T.tolist()
    return [
        OverheadRow(case, variant, plan, search)
        for variant, plan, search in zip(variants, plans, searches)
    ]


def table(rows: Sequence[OverheadRow]) -> str:
    """Return the rows as a text table."""
    head = ('map', 'method', 'landmarks', 'any angle', 'expanded', 'plan us', 'search us')
    lines: list[tuple[str, ...]] = [head]
    for row in rows:
        marks = ('yes' if flag else '-' for flag in row.variant[1:])
        numbers = (f'{row.plan:.0f}', f'{row.search:.0f}')
        lines.append((row.case, row.variant.method, *marks, *numbers))
    widths = [max(map(len, column)) for column in zip(*lines)]
    return '\n'.join(
        '  '.join(text.ljust(width) for text, width in zip(line, widths)).rstrip()
        for line in lines
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Time Planner.plan by method, without a waypoint source, in CPU microseconds."""
    parser = argparse.ArgumentParser('benchmarks.plan_overhead', description=main.__doc__)
    parser.add_argument(
        '--maps', type=int, default=20, metavar='N', help='barrier maps (%(default)s)'
    )
    parser.add_argument(
        '--size', type=int, default=LARGE, metavar='N',
        help='side of the large map, in cells; 0: without it (%(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '--rounds', type=int, default=ROUNDS, metavar='N', help='rounds of timing (%(default)s)'
    )
    options = parser.parse_args(arguments)
    compile_kernels()
    rows = measure('51x31', barrier_queries(options.maps), rounds=options.rounds)
    if options.size:
        name, ours = f'{options.size}x{options.size}', VARIANTS[: -len(PAPER_METHODS)]
        for words, config in (('', CostmapConfig()), (', graded', GRADED)):
            queries = large_queries(options.size, config)
            rows += measure(name + words, queries, ours, options.rounds)
    print(table(rows))
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
