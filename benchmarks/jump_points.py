"""Where jump points pay: the jump point search against the plain A*, over kinds of maps.

Both search the same random queries in turns, with and without landmarks; the table gives the
geometric means of the ratios of their thread CPU times. It is what the rule in
`search/guided.py` (MOST_JUMP_POINTS) comes from.
"""

from __future__ import annotations

import argparse
import math
import statistics
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from llm_astar_planner.search.arrays import no_stop
from llm_astar_planner.search.astar import exact_astar, jump_search
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.landmarks import Landmarks
from llm_astar_planner.search.result import BoundedResult, Cell
from numpy.typing import NDArray

from benchmarks import map_families
from benchmarks.cases import SEED

TURNS = 5
SHARES = (0.01, 0.03, 0.05, 0.1, 0.2, 0.4)


def maps(size: int) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """Yield maps by name: the families, and cells blocked at random."""
    for name, make in map_families.FAMILIES.items():
        if not name.startswith('random'):
            yield name, make(size, np.random.default_rng(SEED))
    for share in SHARES:
        blocked = np.random.default_rng(SEED).random((size, size)) < share
        yield f'random {share:.0%}', blocked


def queries(grid: GridGraph, count: int) -> Iterator[tuple[Cell, Cell]]:
    """Yield pairs of connected cells, drawn at random."""
    random = np.random.default_rng(SEED)
    free = np.flatnonzero(grid.moves)
    drawn = 0
    while drawn < count:
        start, goal = (
            (int(cell % grid.width), int(cell // grid.width)) for cell in random.choice(free, 2)
        )
        if math.isfinite(exact_astar(grid, start, goal, want_expanded=False).cost):
            drawn += 1
            yield start, goal


def ratio(grid: GridGraph, query: tuple[Cell, Cell], landmarks: Landmarks | None) -> float:
    """Return the time of a jump point search divided by that of the A*.

    Both are the least of several turns: what other programs do to a cache only adds to a time.
    Raises AssertionError if their costs differ.
    """
    searches: tuple[Callable[[], BoundedResult], ...] = (
        lambda: jump_search(grid, *query, stop=no_stop(), landmarks=landmarks),
        lambda: exact_astar(grid, *query, landmarks=landmarks, want_expanded=False),
    )
    times: list[list[int]] = [[], []]
    for _ in range(TURNS):
        costs = []
        for own, search in zip(times, searches, strict=True):
            begin = time.thread_time_ns()
            costs.append(search().cost)
            own.append(time.thread_time_ns() - begin)
        if costs[0] != costs[1]:
            raise AssertionError(f'{query}: the costs {costs} differ')
    jump, plain = (min(own) for own in times)
    return jump / plain


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a Markdown table."""
    parser = argparse.ArgumentParser(description='Measure where jump points pay.')
    parser.add_argument('--size', type=int, default=1024, help='cells a side')
    parser.add_argument('--queries', type=int, default=20)
    options = parser.parse_args(arguments)
    print(f'| {options.size} x {options.size} | jump points per cell | time | with landmarks |')
    print('|---|---|---|---|')
    for name, blocked in maps(options.size):
        grid = GridGraph(blocked)
        landmarks = Landmarks.build(grid)
        pairs = list(queries(grid, options.queries))
        ratio(grid, pairs[0], landmarks)  # compiles
        columns = [f'{grid.packed.jump_points / blocked.size:.3f}']
        for lent in (None, landmarks):
            ratios = [ratio(grid, pair, lent) for pair in pairs]
            columns.append(f'{statistics.geometric_mean(ratios):.2f}')
        print(f'| {name} | {" | ".join(columns)} |', flush=True)
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
