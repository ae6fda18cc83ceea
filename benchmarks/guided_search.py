"""Compare the guided search with two baselines on the reference samples, by counts, not times.

The first baseline is the paper's published A*, whose counts are among the reference figures; the
second is our exact A* (octile estimate, ties to larger g, no stale pops). Run it with
`python -m benchmarks.guided_search --help`; docs/guided-search.md has the tables.
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
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.maps import map_server
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap, load_barrier_maps
from llm_astar_planner.search.any_angle import string_pull
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.guided import guided
from llm_astar_planner.search.landmarks import Landmarks
from llm_astar_planner.search.result import BoundedResult, Cell
from numpy.typing import NDArray

from benchmarks.cases import Problem, SpeedCase, scenario_cases

SETS = ('none', 'oracle', 'noisy', 'reversed', 'random 1', 'random 4', 'random 8')
ENVIRONMENT = 'LLM_ASTAR_REFERENCE'
SCALES = (1, 2, 4, 7, 10)
# The columns of --csv: those of SampleRow, by the names that its readers know.
COLUMNS = (
    'method', 'waypoints', 'map', 'pair', 'operation', 'first_operation', 'storage', 'length',
    'ratio', 'paper_operation', 'paper_storage', 'exact_operation', 'exact_storage',
    'textbook_storage', 'exact_length',
)  # fmt: skip
# A map scaled, its grid under the paper's rule, and its landmarks.
ScaledMap = tuple[BarrierMap, GridGraph, Landmarks | None]


@dataclass(frozen=True)
class SampleRow:
    """The counts of one method and of both baselines on one sample; lengths in cells.

    `exact_storage` is that of our A*, `textbook_storage` that of our A* trying every move.
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
    paper_expansions: int
    paper_storage: int
    exact_expansions: int
    exact_storage: int
    textbook_storage: int
    exact_length: float


class ReferenceSamples:
    """The reference samples with their grids, landmarks and waypoint sets."""

    def __init__(self, folder: Path) -> None:
        """Load the samples of a folder of reference figures."""
        with gzip.open(next(folder.glob('golden_maps*.json.gz')), 'rt') as file:
            self.records: list[dict[str, Any]] = json.load(file)['records']
        maps = load_barrier_maps(next(folder.glob('barrier_maps*.json')))
        self.maps: dict[int, BarrierMap] = {one.id: one for one in maps}

    def grids(self, scale: int = 1) -> dict[int, ScaledMap]:
        """Prepare each map, by its id, with all coordinates times `scale`."""
        prepared: dict[int, ScaledMap] = {}
        for key, barrier_map in self.maps.items():
            scaled = barrier_map.scale(scale)
            grid = GridGraph(scaled.to_grid().blocked(), corner_cutting=True)
            prepared[key] = scaled, grid, Landmarks.build(grid)
        return prepared

    def waypoints(self, name: str, index: int) -> NDArray[np.float64]:
        """Return a sample's waypoints, lattice points [n, 2]."""
        if name.startswith('random'):
            random = np.random.default_rng((index, int(name.split()[1])))
            return random.uniform((1.0, 1.0), (49.0, 29.0), (int(name.split()[1]), 2)).round()
        points = self.records[index]['sets'][name]['waypoints_after_filter']
        return np.array(points, dtype=np.float64).reshape(-1, 2)


def compare(folder: str | Path, limit: int | None = None) -> list[SampleRow]:
    """Run every method on the first `limit` reference samples, or on all of them.

    `folder` holds the reference figures.
    """
    reference = ReferenceSamples(Path(folder))
    grids = reference.grids()
    rows: list[SampleRow] = []
    for index in range(len(reference.records))[:limit]:
        rows.extend(compare_sample(reference, grids, index))
    return rows


def compare_sample(
    reference: ReferenceSamples, grids: dict[int, ScaledMap], index: int
) -> Iterator[SampleRow]:
    """Run every method on one sample."""
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
            record['astar']['operation'],
            record['astar']['storage'],
            exact.expansions,
            exact.storage,
            textbook.storage,
            exact.length,
        )

    yield row('our A*', '', exact)
    yield row('textbook A*', '', textbook)
    yield row('WA* w=2', '', guided(grid, start, goal, [goal], weight=2.0, work_factor=1000.0))
    for name in SETS:
        points = reference.waypoints(name, index) + np.array(barrier_map.to_cell((0, 0)))
        for method, known, bound in (
            ('best effort', landmarks, None),
            ('within 1.1', landmarks, 1.1),
            ('no landmarks', None, None),
            ('no l., 1.1', None, 1.1),
        ):
            result = guided(
                grid,
                start,
                goal,
                points,
                landmarks=known,
                max_suboptimality=bound,
                want_expanded=False,
            )
            yield row(method, name, result)


def geometric_mean(ratios: Sequence[float]) -> float:
    """Return the geometric mean of ratios, in %."""
    return 100.0 * math.exp(sum(math.log(ratio) for ratio in ratios) / len(ratios))


def summary(rows: Sequence[SampleRow]) -> str:
    """Return a text table of geometric means in %, one line per method and waypoint set."""
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
            f'{geometric_mean([row.expansions / row.paper_expansions for row in some]):13.2f}'
            f'{geometric_mean([row.storage / row.paper_storage for row in some]):9.2f}'
            f'{geometric_mean([row.length / row.exact_length for row in some]):9.2f}'
            f'{geometric_mean([row.expansions / row.exact_expansions for row in some]):12.2f}'
            f'{geometric_mean([row.first_expansions / row.exact_expansions for row in some]):8.2f}'
            f'{geometric_mean([row.storage / row.exact_storage for row in some]):9.2f}'
            f'{geometric_mean([row.storage / row.textbook_storage for row in some]):10.2f}'
            f'{max(row.expansions / row.exact_expansions for row in some):10.2f}'
            f'{max(row.length / row.exact_length for row in some):11.3f}'
            f'{max(row.suboptimality_bound for row in some):8.3f}'
        )
    return '\n'.join(lines)


def large_maps(folder: str | Path) -> str:
    """Return a text table of the larger reference maps: work relative to our A*'s, and length.

    Waypoints are the turns of the any-angle path, displaced by a normal deviate of so many
    cells. Work is the sum over all queries of a map; worst is the worst query that takes A*
    more than 50 expansions.
    """
    lines = [f'{"map":24s}{"within":8s}{"waypoints":11s}{"work":>7s}{"worst":>7s}{"length":>8s}']
    for case in (*scenario_cases(Path(folder) / 'grids'), robot_map_case(Path(folder) / 'grids')):
        (problem,) = case.problems
        grid = GridGraph(problem.blocked)
        landmarks = Landmarks.build(grid)
        exact = [exact_astar(grid, *query, want_expanded=False) for query in problem.queries]
        for bound in (None, 1.1, 1.0):
            for name in ('none', 'turns', 'turns +- 5', 'turns +- 20', 'random 6'):
                results = [
                    guided(
                        grid,
                        *query,
                        displaced_turns(name, grid, best, seed),
                        max_suboptimality=bound,
                        landmarks=landmarks,
                        want_expanded=False,
                    )
                    for seed, (query, best) in enumerate(zip(problem.queries, exact))
                ]
                total = sum(one.expansions for one in results)
                work = total / sum(one.expansions for one in exact)
                pairs = [(one, best) for one, best in zip(results, exact) if best.expansions > 50]
                worst = max(one.expansions / best.expansions for one, best in pairs)
                length = np.mean([one.cost / best.cost for one, best in pairs])
                lines.append(
                    f'{case.name:24s}{bound or "-":<8}{name:11s}'
                    f'{work:7.3f}{worst:7.2f}{length:8.4f}'
                )
    return '\n'.join(lines)


def robot_map_case(folder: Path) -> SpeedCase:
    """Return random queries on a robot's map, each with a path of more than 60 cells."""
    blocked = map_server.load_map(folder / 'depot.yaml').blocked(allow_unknown=False)
    grid, free = GridGraph(blocked), np.argwhere(~blocked)[:, ::-1]
    random = np.random.default_rng(0)
    queries: list[tuple[Cell, Cell]] = []
    while len(queries) < 40:
        (x, y), (to_x, to_y) = free[random.integers(len(free), size=2)].tolist()
        path = exact_astar(grid, (x, y), (to_x, to_y), want_expanded=False).path
        if len(path) > 60:
            queries.append(((x, y), (to_x, to_y)))
    return SpeedCase('depot', (Problem(blocked, tuple(queries)),))


def displaced_turns(
    name: str, grid: GridGraph, best: BoundedResult, seed: int
) -> NDArray[np.float64]:
    """Return the waypoints [n, 2] that `name` stands for, on a query with the path `best`."""
    random = np.random.default_rng(seed)
    if name == 'none':
        return np.empty((0, 2))
    if name.startswith('random'):
        return random.uniform(0.0, (grid.width, grid.height), (6, 2))
    spread = 0.0 if name == 'turns' else float(name.rsplit(maxsplit=1)[-1])
    turns = string_pull(grid, best.path).points[1:-1].astype(np.float64)
    return turns + random.normal(0.0, 1.0, turns.shape) * spread


def growth(folder: str | Path, scales: Sequence[int] = SCALES) -> dict[str, tuple[float, float]]:
    """Return how expansions and storage grow with a map's scale, by method: slopes in log-log.

    Counts that grow with the area have slope 2, with the length slope 1. Means over the
    reference samples, with oracle waypoints.
    """
    reference = ReferenceSamples(Path(folder))
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
    """Print a table of the guided search's work compared with two baselines."""
    parser = argparse.ArgumentParser('benchmarks.guided_search', description=main.__doc__)
    parser.add_argument(
        '--reference',
        default=os.environ.get(ENVIRONMENT),
        metavar='DIR',
        help=f'folder of the reference figures (default: ${ENVIRONMENT})',
    )
    parser.add_argument(
        '--csv', type=Path, metavar='FILE', help='write one row per sample and method to FILE'
    )
    parser.add_argument('--maps', action='store_true', help='measure the larger maps instead')
    parser.add_argument('--growth', action='store_true', help='measure growth with scale instead')
    options = parser.parse_args(arguments)
    if not options.reference:
        parser.error(f'give --reference or set {ENVIRONMENT}')
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
            writer.writerow(COLUMNS)
            writer.writerows(astuple(row) for row in rows)
    sys.stdout.write(summary(rows) + '\n')
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
