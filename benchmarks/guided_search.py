"""The guided search against two baselines on the reference samples: counts, not times.

The first baseline is the paper's published A* (its counts are among the reference figures),
the second our own exact A* (octile, ties to larger g, no stale pops).
"""

from __future__ import annotations

import argparse
import csv
import gzip
import json
import math
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.maps import map_server
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, load_barrier_maps
from llm_astar_planner.search.any_angle import string_pull
from llm_astar_planner.search.astar import exact_astar, shortest_path
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.guided import guided
from llm_astar_planner.search.landmarks import Landmarks
from llm_astar_planner.search.result import BoundedResult, Cell
from numpy.typing import NDArray

from benchmarks.speed import Case, Problem, scenario_cases

SETS = ('none', 'oracle', 'noisy', 'reversed', 'random 1', 'random 4', 'random 8')
ENVIRONMENT = 'LLM_ASTAR_REFERENCE'
_SCALES = (1, 2, 4, 7, 10)


@dataclass(frozen=True)
class SampleRow:
    """One method on one sample: its counts beside both baselines'; lengths in cells.

    `exact_storage` is of our A* as it is, `textbook_storage` of one that tries every move.
    """

    method: str
    waypoints: str
    map: int
    pair: int
    expansions: int
    first_expansions: int
    storage: int
    length: float
    suboptimality_bound: float
    paper_operation: int
    paper_storage: int
    exact_operation: int
    exact_storage: int
    textbook_storage: int
    exact_length: float


class _Reference:
    """The reference samples with their grids, landmarks and waypoint sets."""

    def __init__(self, folder: Path) -> None:
        with gzip.open(next(folder.glob('golden_maps*.json.gz')), 'rt') as file:
            self.records: list[dict[str, Any]] = json.load(file)['records']
        maps = load_barrier_maps(next(folder.glob('barrier_maps*.json')))
        self.maps: dict[int, BarrierMap] = {one.id: one for one in maps}

    def grids(self, scale: int = 1) -> dict[int, tuple[BarrierMap, GridGraph, Landmarks | None]]:
        """Return each map scaled, its grid under the paper's rule, and its landmarks."""
        made: dict[int, tuple[BarrierMap, GridGraph, Landmarks | None]] = {}
        for key, one in self.maps.items():
            scaled = one.scale(scale)
            grid = GridGraph(scaled.to_grid().blocked(), corner_cutting=True)
            made[key] = scaled, grid, Landmarks.build(grid)
        return made

    def waypoints(self, name: str, index: int) -> NDArray[np.float64]:
        """Return a sample's waypoints, lattice points [n, 2]."""
        if name.startswith('random'):
            random = np.random.default_rng((index, int(name.split()[1])))
            return random.uniform((1.0, 1.0), (49.0, 29.0), (int(name.split()[1]), 2)).round()
        points = self.records[index]['sets'][name]['waypoints_after_filter']
        return np.array(points, dtype=np.float64).reshape(-1, 2)


def compare(folder: str | Path, limit: int | None = None) -> list[SampleRow]:
    """Run every method on the reference samples, the first `limit` of them if one is given.

    `folder` holds the reference figures.
    """
    reference = _Reference(Path(folder))
    grids = reference.grids()
    return [
        row
        for index in range(len(reference.records))[:limit]
        for row in _compare_sample(reference, grids, index)
    ]


def _compare_sample(
    reference: _Reference,
    grids: dict[int, tuple[BarrierMap, GridGraph, Landmarks | None]],
    index: int,
) -> Iterator[SampleRow]:
    record = reference.records[index]
    barrier_map, grid, landmarks = grids[record['map']]
    start, goal = (barrier_map.to_cell(tuple(record[end])) for end in ('start', 'goal'))
    exact = exact_astar(grid, start, goal, want_expanded=False)
    textbook = exact_astar(grid, start, goal, want_expanded=False, every_move=True)

    def row(method: str, waypoints: str, result: BoundedResult) -> SampleRow:
        return SampleRow(
            method,
            waypoints,
            record['map'],
            record['pair'],
            result.expansions,
            result.first_expansions,
            result.storage,
            result.length,
            result.suboptimality_bound,
            record['astar']['expansions'],
            record['astar']['storage'],
            exact.expansions,
            exact.storage,
            textbook.storage,
            exact.length,
        )

    def led(name: str, **options: Any) -> BoundedResult:  # noqa: ANN401
        points = reference.waypoints(name, index) + np.array(barrier_map.to_cell((0, 0)))
        return guided(grid, start, goal, points, want_expanded=False, **options)

    yield row('our A*', '', exact)
    yield row('textbook A*', '', textbook)
    yield row('WA* w=2', '', guided(grid, start, goal, [goal], weight=2.0, work_factor=1000.0))
    for name in SETS:
        yield row('best effort', name, led(name, landmarks=landmarks))
        yield row('within 1.1', name, led(name, landmarks=landmarks, max_suboptimality=1.1))
        yield row('no landmarks', name, led(name))
        yield row('no l., 1.1', name, led(name, max_suboptimality=1.1))


def summary(rows: Sequence[SampleRow]) -> str:
    """Return geometric means, in %, a line a method and waypoint set, as a text table."""
    head = (
        f'{"method":13s}{"waypoints":11s}'
        f'{"paper A*: op":>13s}{"storage":>9s}{"length":>9s}'
        f'{"our A*: op":>12s}{"first":>8s}{"storage":>9s}{"textbook":>10s}'
        f'{"worst op":>10s}{"worst len":>11s}{"proven":>8s}'
    )
    lines = [head]
    for key in dict.fromkeys((row.method, row.waypoints) for row in rows):
        some = [row for row in rows if (row.method, row.waypoints) == key]
        lines.append(
            f'{key[0]:13s}{key[1]:11s}'
            f'{_mean([row.expansions / row.paper_operation for row in some]):13.2f}'
            f'{_mean([row.storage / row.paper_storage for row in some]):9.2f}'
            f'{_mean([row.length / row.exact_length for row in some]):9.2f}'
            f'{_mean([row.expansions / row.exact_operation for row in some]):12.2f}'
            f'{_mean([row.first_expansions / row.exact_operation for row in some]):8.2f}'
            f'{_mean([row.storage / row.exact_storage for row in some]):9.2f}'
            f'{_mean([row.storage / row.textbook_storage for row in some]):10.2f}'
            f'{max(row.expansions / row.exact_operation for row in some):10.2f}'
            f'{max(row.length / row.exact_length for row in some):11.3f}'
            f'{max(row.suboptimality_bound for row in some):8.3f}'
        )
    return '\n'.join(lines)


def large_maps(folder: str | Path) -> str:
    """Return a text table of the larger reference maps: work over our A*'s, waypoints displaced.

    Waypoints are the turns of the any-angle path, displaced by a normal deviate of so many
    cells. Work is the sum over all queries of a map; worst is the worst query that takes A*
    more than 50 expansions.
    """
    lines = [f'{"map":24s}{"within":8s}{"waypoints":11s}{"work":>7s}{"worst":>7s}{"length":>8s}']
    for case in (*scenario_cases(Path(folder) / 'grids'), _robot_map(Path(folder) / 'grids')):
        (problem,) = case.problems
        grid = GridGraph(problem.blocked)
        landmarks = Landmarks.build(grid)
        exact = [exact_astar(grid, *query, want_expanded=False) for query in problem.queries]
        for bound in (None, 1.1, 1.0):
            for name in ('none', 'turns', 'turns +- 5', 'turns +- 20', 'random 6'):
                led = [
                    guided(
                        grid,
                        *query,
                        _displaced(name, grid, best, seed),
                        max_suboptimality=bound,
                        landmarks=landmarks,
                        want_expanded=False,
                    )
                    for seed, (query, best) in enumerate(zip(problem.queries, exact))
                ]
                work = sum(one.expansions for one in led) / sum(one.expansions for one in exact)
                pairs = [(one, best) for one, best in zip(led, exact) if best.expansions > 50]
                worst = max(one.expansions / best.expansions for one, best in pairs)
                length = np.mean([one.cost / best.cost for one, best in pairs])
                lines.append(
                    f'{case.name:24s}{bound or "-":<8}{name:11s}'
                    f'{work:7.3f}{worst:7.2f}{length:8.4f}'
                )
    return '\n'.join(lines)


def _robot_map(folder: Path) -> Case:
    """Return random queries on a robot's map, each with a path of more than 60 cells."""
    blocked = map_server.load_map(folder / 'depot.yaml').blocked(allow_unknown=False)
    grid, free = GridGraph(blocked), np.argwhere(~blocked)[:, ::-1]
    random = np.random.default_rng(0)
    queries: list[tuple[Cell, Cell]] = []
    while len(queries) < 40:
        (x, y), (to_x, to_y) = free[random.integers(len(free), size=2)].tolist()
        path, _ = shortest_path(grid, (x, y), (to_x, to_y))
        if len(path) > 60:
            queries.append(((x, y), (to_x, to_y)))
    return Case('depot', (Problem(blocked, tuple(queries)),))


def _displaced(name: str, grid: GridGraph, best: BoundedResult, seed: int) -> NDArray[np.float64]:
    random = np.random.default_rng(seed)
    if name == 'none':
        return np.empty((0, 2))
    if name.startswith('random'):
        return random.uniform(0.0, (grid.width, grid.height), (6, 2))
    spread = 0.0 if name == 'turns' else float(name.rsplit(maxsplit=1)[-1])
    turns = string_pull(grid, best.path).points[1:-1].astype(np.float64)
    return turns + random.normal(0.0, 1.0, turns.shape) * spread


def growth(folder: str | Path, scales: Sequence[int] = _SCALES) -> dict[str, tuple[float, float]]:
    """Return how expansions and storage grow with a map's scale: slopes of their log to log.

    A search whose counts grow with the area has slope 2, with the length slope 1. Means over
    the reference samples, with oracle waypoints.
    """
    reference = _Reference(Path(folder))
    counts: dict[str, list[tuple[float, float]]] = {}
    for scale in scales:
        grids = reference.grids(scale)
        results: dict[str, list[tuple[int, int]]] = {}
        for index, record in enumerate(reference.records):
            barrier_map, grid, landmarks = grids[record['map']]
            start, goal = (
                barrier_map.to_cell((record[end][0] * scale, record[end][1] * scale))
                for end in ('start', 'goal')
            )
            origin = np.array(barrier_map.to_cell((0, 0)))
            points = reference.waypoints('oracle', index) * scale + origin
            options: dict[str, Any] = {'want_expanded': False}
            for name, result in (
                ('our A*', exact_astar(grid, start, goal, **options)),
                ('guided', guided(grid, start, goal, points, landmarks=landmarks, **options)),
                ('guided, no landmarks', guided(grid, start, goal, points, **options)),
            ):
                results.setdefault(name, []).append((result.expansions, result.storage))
        for name, values in results.items():
            logs = np.log(np.array(values, dtype=np.float64)).mean(axis=0)
            counts.setdefault(name, []).append((float(logs[0]), float(logs[1])))
    logs_of_scales = np.log(np.array(scales, dtype=np.float64))
    return {
        name: tuple(np.polyfit(logs_of_scales, np.array(values), 1)[0].tolist())
        for name, values in counts.items()
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table: `python -m benchmarks.guided_search --help`."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument('--reference', default=os.environ.get(ENVIRONMENT), help=ENVIRONMENT)
    parser.add_argument('--csv', type=Path, help='write a row a sample and method there')
    parser.add_argument('--maps', action='store_true', help='the larger maps instead')
    parser.add_argument('--growth', action='store_true', help='the growth with scale instead')
    options = parser.parse_args(arguments)
    if not options.reference:
        parser.error(f'--reference or {ENVIRONMENT} is needed')
    if options.maps:
        sys.stdout.write(large_maps(options.reference) + '\n')
        return 0
    if options.growth:
        for name, (expansions, storage) in growth(options.reference).items():
            sys.stdout.write(f'{name:22s}expansions {expansions:.2f}  storage {storage:.2f}\n')
        return 0
    rows = compare(options.reference)
    if options.csv:
        with options.csv.open('w', newline='', encoding='utf-8') as file:
            writer = csv.writer(file)
            writer.writerow(field.name for field in fields(SampleRow))
            writer.writerows(astuple(row) for row in rows)
    sys.stdout.write(summary(rows) + '\n')
    return 0


def _mean(ratios: Sequence[float]) -> float:
    return 100.0 * math.exp(
        sum(math.log(suboptimality_bound) for suboptimality_bound in ratios) / len(ratios)
    )


if __name__ == '__main__':
    raise SystemExit(main())
