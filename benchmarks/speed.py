"""Time grid planners side by side in one process, as ratios with their spread.

Planners take turns on the same queries, so that other load on the machine slows them all alike.
The table also says which share of each planner's paths are legal and optimal. Peers are measured
if they are installed: nano-astar, pyastar2d, w9-pathfinding and the paper's llm-astar. Run it
with `python -m benchmarks.speed --help`.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import importlib
import importlib.metadata
import importlib.util
import io
import json
import math
import statistics
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_msgs_adapter.maps.movingai import load_map
from llm_astar_planner.search.astar import shortest_path
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.paper import compile_kernels
from llm_astar_planner.search.result import Cell
from numpy.typing import NDArray

OURS = 'llm-astar-ros2'
PAPER = 'llm-astar'
SLOW = frozenset({PAPER})
ROUNDS = 5
# A smaller random map has no room for its queries.
MIN_SIZE = 50
_TOLERANCE = 1e-3

Path2D = NDArray[np.int64]
# Takes start and goal, returns the cells (x, y) of a path, empty if there is none.
Plan = Callable[[Cell, Cell], Path2D]
# Takes bool [height, width], True where blocked.
Prepare = Callable[[NDArray[np.bool_]], Plan]


class Problem(NamedTuple):
    """Queries on one grid: bool [height, width] and (start, goal) pairs."""

    blocked: NDArray[np.bool_]
    queries: tuple[tuple[Cell, Cell], ...]


class SpeedCase(NamedTuple):
    """A named set of problems that are timed together.

    Planners in `SLOW` take part only if `slow` marks the case as small enough for them.
    """

    name: str
    problems: tuple[Problem, ...]
    slow: bool = False


@dataclass(frozen=True)
class SpeedRow:
    """One planner on one case.

    `ratio` is its time divided by ours, the median of the rounds; `ratio_low` and `ratio_high`
    are the lowest and the highest. `milliseconds` is the median time per query. `solved`, `legal`
    and `optimal` are shares of the queries: those with a path, those whose path cuts no corner
    and crosses no obstacle, and those whose path is as short as possible. `excess` is the mean of
    length / optimum - 1 over the paths found.
    """

    case: str
    planner: str
    version: str
    ratio: float
    ratio_low: float
    ratio_high: float
    milliseconds: float
    solved: float
    legal: float
    optimal: float
    excess: float


def installed_planners() -> dict[str, Prepare]:
    """Return our planner and every peer that can be imported, by name."""
    planners: dict[str, Prepare] = {OURS: prepare_ours}
    for name, module, prepare in (
        ('nano-astar', 'nano_astar', prepare_nano),
        ('pyastar2d', 'pyastar2d', prepare_pyastar2d),
        ('w9-pathfinding', 'w9_pathfinding.pf', prepare_w9),
    ):
        try:
            importlib.import_module(module)
        except ImportError:
            continue
        planners[name] = prepare
    if importlib.util.find_spec('llmastar') and importlib.util.find_spec('shapely'):
        planners[PAPER] = prepare_paper
    return planners


def measure(
    cases: Iterable[SpeedCase],
    *,
    planners: dict[str, Prepare] | None = None,
    rounds: int = ROUNDS,
) -> list[SpeedRow]:
    """Time the planners on each case, taking turns, `rounds` times after one warm-up round."""
    planners = installed_planners() if planners is None else planners
    compile_kernels()
    rows: list[SpeedRow] = []
    for case in cases:
        plans = {
            name: [prepare(problem.blocked) for problem in case.problems]
            for name, prepare in planners.items()
            if case.slow or name not in SLOW
        }
        paths = {name: solve(case, plan)[1] for name, plan in plans.items()}
        times: dict[str, list[float]] = {name: [] for name in plans}
        for _ in range(rounds):
            for name, plan in plans.items():
                times[name].append(solve(case, plan)[0])
        rows.extend(
            speed_row(
                case,
                name,
                times=times[name],
                ours=times[OURS],
                paths=paths[name],
                best=paths[OURS],
            )
            for name in plans
        )
    return rows


def table(rows: Sequence[SpeedRow]) -> str:
    """Return the rows as a text table."""
    head = ('case', 'planner', 'time/ours', 'spread', 'ms', 'solved', 'legal', 'optimal', 'excess')
    lines = [head, *(table_line(row) for row in rows)]
    widths = [max(len(line[column]) for line in lines) for column in range(len(head))]
    return '\n'.join(
        '  '.join(text.ljust(width) for text, width in zip(line, widths)).rstrip()
        for line in lines
    )


def barrier_case(path: str | Path, most: int | None = None) -> SpeedCase:
    """Return the samples of a barrier-map dataset, rasterised, without corner cutting.

    With `most`, only the first sample of so many maps: a case for slow planners.
    """
    problems = []
    for barrier_map in load_barrier_maps(path)[:most]:
        samples = barrier_map.samples if most is None else barrier_map.samples[:1]
        queries = tuple(
            (barrier_map.to_cell(sample.start), barrier_map.to_cell(sample.goal))
            for sample in samples
        )
        problems.append(Problem(barrier_map.to_grid().blocked(), queries))
    height, width = problems[0].blocked.shape
    name = f'{width}x{height} barriers'
    if most is None:
        return SpeedCase(name, tuple(problems))
    return SpeedCase(f'{name}, {most}', tuple(problems), slow=True)


def scenario_cases(folder: str | Path) -> list[SpeedCase]:
    """Return one case per map of `scenarios.csv`, which is in `folder` with its MovingAI maps."""
    queries: dict[str, list[tuple[Cell, Cell]]] = {}
    with (Path(folder) / 'scenarios.csv').open(encoding='utf-8') as file:
        for row in csv.DictReader(file):
            start = int(row['start_x']), int(row['start_y'])
            goal = int(row['goal_x']), int(row['goal_y'])
            queries.setdefault(row['map'], []).append((start, goal))
    return [
        SpeedCase(name, (Problem(load_map(Path(folder) / f'{name}.map').blocked(), tuple(pairs)),))
        for name, pairs in queries.items()
    ]


def synthetic_case(size: int = 4000, *, queries: int = 8, seed: int = 0) -> SpeedCase:
    """Return a square map of `size` cells a side with random boxes, and queries with a path."""
    random = np.random.default_rng(seed)
    blocked = np.zeros((size, size), dtype=np.bool_)
    for _ in range(size * size // 4000):
        x, y = random.integers(0, size, 2)
        width, height = random.integers(5, 60, 2)
        blocked[y : y + height, x : x + width] = True
    grid = GridGraph(blocked)
    pairs: list[tuple[Cell, Cell]] = []
    while len(pairs) < queries:
        x, y, to_x, to_y = (int(value) for value in random.integers(0, size, 4))
        path, _ = shortest_path(grid, (x, y), (to_x, to_y))
        if len(path) > size // 8:
            pairs.append(((x, y), (to_x, to_y)))
    return SpeedCase(f'{size}x{size} boxes', (Problem(blocked, tuple(pairs)),))


def reference_cases(folder: Path) -> list[SpeedCase]:
    """Return the cases of a reference folder: barrier maps, a few for slow planners, `grids/`."""
    datasets = sorted(folder.glob('barrier_maps*.json'))
    return [
        *(barrier_case(dataset) for dataset in datasets),
        *(barrier_case(dataset, most=10) for dataset in datasets),
        *scenario_cases(folder / 'grids'),
    ]


def solve(case: SpeedCase, plans: Sequence[Plan]) -> tuple[float, list[Path2D]]:
    """Run all queries of a case; return the seconds and the paths."""
    paths: list[Path2D] = []
    begin = time.perf_counter()
    for problem, plan in zip(case.problems, plans):
        for start, goal in problem.queries:
            paths.append(plan(start, goal))
    return time.perf_counter() - begin, paths


def table_line(row: SpeedRow) -> tuple[str, ...]:
    """Return the columns of a row as text."""
    return (
        row.case,
        f'{row.planner} {row.version}'.strip(),
        f'{row.ratio:.2f}',
        f'{row.ratio_low:.2f}-{row.ratio_high:.2f}',
        f'{row.milliseconds:.4f}',
        f'{row.solved:.0%}',
        f'{row.legal:.0%}',
        f'{row.optimal:.0%}',
        f'{row.excess:+.2%}',
    )


def speed_row(
    case: SpeedCase,
    name: str,
    *,
    times: Sequence[float],
    ours: Sequence[float],
    paths: Sequence[Path2D],
    best: Sequence[Path2D],
) -> SpeedRow:
    """Sum up one planner's times and paths on one case; `best` are paths of optimal length."""
    ratios = [one / other for one, other in zip(times, ours)]
    grids = [problem.blocked for problem in case.problems for _ in problem.queries]
    found = [len(path) > 0 for path in paths]
    legal = [ok and is_legal(grid, path) for ok, grid, path in zip(found, grids, paths)]
    excesses = [
        path_length(path) / path_length(optimum) - 1.0
        for path, optimum in zip(paths, best)
        if len(path) > 1 and len(optimum) > 1
    ]
    optimal = [
        abs(path_length(path) - path_length(optimum)) <= _TOLERANCE
        for path, optimum in zip(paths, best)
    ]
    return SpeedRow(
        case.name,
        name,
        installed_version(name),
        statistics.median(ratios),
        min(ratios),
        max(ratios),
        statistics.median(times) / len(paths) * 1e3,
        statistics.fmean(found),
        statistics.fmean(legal),
        statistics.fmean(optimal),
        statistics.fmean(excesses) if excesses else 0.0,
    )


def path_length(path: Path2D) -> float:
    """Return the length of a path in cells, 0 for an empty one."""
    return float(np.hypot(*np.diff(path, axis=0).T.astype(np.float64)).sum()) if len(path) else 0.0


def is_legal(blocked: NDArray[np.bool_], path: Path2D) -> bool:
    """Tell whether a path keeps to free cells, makes single moves and cuts no corner."""
    x, y = path.T
    step_x, step_y = np.abs(np.diff(x)), np.abs(np.diff(y))
    if blocked[y, x].any() or (np.maximum(step_x, step_y) != 1).any():
        return False
    return not (blocked[y[:-1], x[1:]] | blocked[y[1:], x[:-1]]).any()


def installed_version(name: str) -> str:
    """Return the version of a peer's distribution, '' for ours and if it is unknown."""
    try:
        return '' if name == OURS else importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return ''


def prepare_ours(blocked: NDArray[np.bool_]) -> Plan:
    """Prepare our exact A*."""
    grid = GridGraph(blocked)
    return lambda start, goal: shortest_path(grid, start, goal)[0].astype(np.int64, copy=False)


def as_cells(path: Any, *, rows_first: bool) -> Path2D:  # noqa: ANN401
    """Turn a peer's path, None or a sequence of pairs, into cells (x, y): int64 [n, 2]."""
    if path is None or len(path) == 0:
        return np.empty((0, 2), dtype=np.int64)
    cells = np.asarray(path, dtype=np.int64).reshape(-1, 2)
    return cells[:, ::-1] if rows_first else cells


def prepare_nano(blocked: NDArray[np.bool_]) -> Plan:
    """Prepare nano-astar."""
    peer = importlib.import_module('nano_astar')
    grid = blocked.astype(np.uint8)

    def plan(start: Cell, goal: Cell) -> Path2D:
        path = peer.astar(grid, start[::-1], goal[::-1])[0]
        return as_cells(path, rows_first=True)

    return plan


def prepare_pyastar2d(blocked: NDArray[np.bool_]) -> Plan:
    """Prepare pyastar2d, whose diagonals cut corners."""
    peer = importlib.import_module('pyastar2d')
    weights = np.where(blocked, math.inf, 1.0).astype(np.float32)

    def plan(start: Cell, goal: Cell) -> Path2D:
        path = peer.astar_path(weights, start[::-1], goal[::-1], allow_diagonal=True)
        return as_cells(path, rows_first=True)

    return plan


def prepare_w9(blocked: NDArray[np.bool_]) -> Plan:
    """Prepare w9-pathfinding's A*."""
    environments = importlib.import_module('w9_pathfinding.envs')
    finders = importlib.import_module('w9_pathfinding.pf')
    moves = importlib.import_module('w9_pathfinding.diagonal_movement').DiagonalMovement
    grid = environments.Grid(
        np.where(blocked, -1.0, 1.0),
        diagonal_movement=moves.only_when_no_obstacle,
        diagonal_movement_cost_multiplier=math.sqrt(2.0),
    )
    finder = finders.AStar(grid)
    return lambda start, goal: as_cells(finder.find_path(start, goal), rows_first=False)


def runs_along_rows(blocked: NDArray[np.bool_]) -> list[list[int]]:
    """Return the runs of blocked cells in each row: [row, first, last]."""
    edges = np.diff(np.pad(blocked, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    return [
        [row, int(first), int(last) - 1]
        for row, edge in enumerate(edges)
        for first, last in zip(np.flatnonzero(edge > 0), np.flatnonzero(edge < 0))
    ]


def prepare_paper(blocked: NDArray[np.bool_]) -> Plan:
    """Prepare the paper's published A*, with stubs for its language model and its plots.

    Its diagonals cut corners, so its paths may be shorter than the optimum and not legal here.
    """
    stubs = [name for name in ('openai', 'torch', 'transformers') if name not in sys.modules]
    try:
        sys.modules.update({name: ModuleType(name) for name in stubs})
        peer: Any = importlib.import_module('llmastar.pather.a_star.a_star')
    finally:
        for name in stubs:
            sys.modules.pop(name, None)
    peer.plotting = SimpleNamespace(Plotting=lambda *_: SimpleNamespace(animation=lambda *_: None))
    height, width = blocked.shape
    # It tests every move against every barrier, so give it few: runs along x, then runs along y
    # for the cells left over. It adds the border itself.
    inside = blocked.copy()
    inside[[0, -1]] = inside[:, [0, -1]] = False
    rows = [run for run in runs_along_rows(inside) if run[2] > run[1]]
    for y, first, last in rows:
        inside[y, first : last + 1] = False
    columns = runs_along_rows(inside.T)

    def plan(start: Cell, goal: Cell) -> Path2D:
        search = peer.AStar()
        query = {
            'start': list(start),
            'goal': list(goal),
            'range_x': [0, width],
            'range_y': [0, height],
            'horizontal_barriers': rows,
            'vertical_barriers': columns,
        }
        with contextlib.redirect_stdout(io.StringIO()):
            search.searching(query)
            return as_cells(search.extract_path(search.PARENT)[::-1], rows_first=False)

    return plan


def main(arguments: Sequence[str] | None = None) -> int:
    """Time our exact A* and the installed peers, taking turns in one process."""
    parser = argparse.ArgumentParser('benchmarks.speed', description=main.__doc__)
    parser.add_argument(
        '--reference', type=Path, metavar='DIR', help='also time the maps of a reference folder'
    )
    parser.add_argument(
        '--size',
        type=int,
        default=1000,
        metavar='N',
        help='side of a random map, in cells; 0: no random map (%(default)s)',
    )
    parser.add_argument(
        '--rounds', type=int, default=ROUNDS, metavar='N', help='rounds of timing (%(default)s)'
    )
    parser.add_argument('--json', action='store_true', help='print the rows as JSON')
    options = parser.parse_args(arguments)
    if options.size and options.size < MIN_SIZE:
        parser.error(f'--size {options.size} is neither 0 nor {MIN_SIZE} or more')
    if options.rounds < 1:
        parser.error(f'--rounds {options.rounds} is below 1')
    cases = [] if options.reference is None else reference_cases(options.reference)
    if options.size:
        cases.append(synthetic_case(options.size))
    rows = measure(cases, rounds=options.rounds)
    print(json.dumps([asdict(row) for row in rows], indent=1) if options.json else table(rows))
    if len({row.planner for row in rows}) == 1:
        sys.stderr.write('no peer is installed: pip install nano-astar pyastar2d w9-pathfinding\n')
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
