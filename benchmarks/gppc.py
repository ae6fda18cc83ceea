"""What the Grid-Based Path Planning Competition reports, of whole MovingAI sets in a folder.

`python -m benchmarks.gppc --maps FOLDER --sets dao,random` compares every length of an exact
method with the published one and prints, for each method: CPU time of a query as mean, median,
95th percentile and most; of preparing a map; bytes that are held, and the most that one map took;
the time until the first 20 steps are known; and the shares of paths by how much longer they are
than the published length. A search that hands over its path as a whole knows the first 20 steps
when it ends. Queries are repeated, methods take turns, and the least time of each query counts.

Other planners take part as programs: `--peer NAME=COMMAND` runs `COMMAND MAP SCENARIOS` once a
round on MovingAI's files. It prints a line for each row, `COST MICROSECONDS`, cost -1 for no
path, and before them, if it has them, `preparation MILLISECONDS` and `storage BYTES`.
"""

from __future__ import annotations

import argparse
import gc
import json
import multiprocessing
import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, NamedTuple

import numpy as np
from llm_astar_lab.datasets import named
from llm_astar_lab.datasets.named import GRID_CONFIG, SETS
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblemError
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.movingai import Scenario, load_map, load_scenarios
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.planning.compile import compile_kernels
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.grid_graph import path_cost
from llm_astar_planner.search.result import Cell
from numpy.typing import NDArray

from benchmarks.memory import resident

# Published lengths have as few as two decimals, and the sets were computed in single precision.
ABSOLUTE, RELATIVE = 0.006, 1e-5
# Upper ends of the buckets of suboptimality; the first is "as published".
BUCKETS = (1.0, 1.01, 1.05, 1.1, 1.5)
# Of each method, in the order of the table.
NUMBERS = (
    'mean_ms', 'median_ms', 'p95_ms', 'most_ms', 'preparation_ms', 'held_mb', 'peak_mb'
)  # fmt: skip
PEER_S = 3600.0
PATIENCE_S = 120.0
Answer = tuple[float, float]
# What a planner shares with everything else, and what leads there.
SHARED = (type, ModuleType, FunctionType, str, bytes)


class Prepared(NamedTuple):
    """A method ready on a map: the function that plans, and what to judge its paths by."""

    plan: Callable[[Cell, Cell], NDArray[Any]]
    holder: object


def prepare_exact(grid_map: GridMap) -> Prepared:
    """Return the plain exact A*, which prepares the moves of the map and nothing else."""
    costmap = Costmap(grid_map, GRID_CONFIG)
    grid = costmap.grid_graph
    return Prepared(
        lambda start, goal: exact_astar(grid, start, goal, want_expanded=False).path, costmap
    )


def prepare_planner(grid_map: GridMap, bound: float) -> Prepared:
    """Return `Planner.plan` with a bound and all it prepares: jump points and landmarks."""
    planner = Planner(grid_map, GRID_CONFIG).prepare()

    def plan(start: Cell, goal: Cell) -> NDArray[Any]:
        request = PlanRequest(
            start, goal, max_suboptimality=bound, want_expanded=False, time_limit=PATIENCE_S
        )
        return planner.plan(request).path

    return Prepared(plan, planner)


METHODS: dict[str, Callable[[GridMap], Prepared]] = {
    'exact_astar': prepare_exact,
    'guided': lambda grid_map: prepare_planner(grid_map, 1.0),
    'guided, bound 1.1': lambda grid_map: prepare_planner(grid_map, 1.1),
}


@dataclass
class Total:
    """What a method took on all maps so far; times in seconds, `lengths` relative to published."""

    queries: list[float] = field(default_factory=list)
    preparation: list[float] = field(default_factory=list)
    held: list[float] = field(default_factory=list)
    lengths: list[float] = field(default_factory=list)
    as_published: int = 0
    unsolved: int = 0
    wrong: list[str] = field(default_factory=list)
    peak: float = 0.0

    def add(self, scenario: Scenario, cost: float, seconds: float) -> None:
        """Add one query: its length in cells, NaN for no path, and its least CPU seconds."""
        self.queries.append(seconds)
        published = scenario.optimal_length
        if np.isnan(cost):
            self.unsolved += 1
            same = published <= 0.0
        else:
            same = abs(cost - published) <= ABSOLUTE + RELATIVE * published
            self.lengths.append(1.0 if same or published <= 0.0 else cost / published)
        self.as_published += same
        if not same:
            name = f'{scenario.map_name} {scenario.start} to {scenario.goal}'
            self.wrong.append(f'{name}: {cost:.6f}, published {published:.6f}')


def files_of(folder: Path, name: str) -> Iterator[tuple[Path, Path]]:
    """Yield the maps of a set with their scenarios. Raises SystemExit where there are none."""
    try:
        files = sorted(named.files_of_set(name, folder), key=lambda path: path.name)
        scenarios = [path for path in files if path.name.endswith(named.SCENARIO_END)]
        if not scenarios:
            raise SystemExit(f'{folder}: has no scenarios of {name}, files x.map.scen')
        for path in scenarios:
            maps = [other for other in files if other.name == path.stem]
            yield named.find_map_file(path, maps, folder), path
    except GridProblemError as error:
        raise SystemExit(str(error)) from None


def chosen(scenarios: Sequence[Scenario], limit: int | None) -> list[Scenario]:
    """Return all rows, or `limit` of them from the shortest to the longest."""
    if limit is None or limit >= len(scenarios):
        return list(scenarios)
    ordered = sorted(scenarios, key=lambda one: one.optimal_length)
    return [ordered[i] for i in np.linspace(0, len(ordered) - 1, limit).round().astype(int)]


def measure_map(
    map_path: Path,
    scenarios: Sequence[Scenario],
    methods: Sequence[str],
    rounds: int,
    totals: dict[str, Total],
) -> None:
    """Add what our methods take on a map."""
    grid_map = load_map(map_path)
    ready = {}
    for name in methods:
        begin = time.process_time()
        ready[name] = METHODS[name](grid_map)
        totals[name].preparation.append(time.process_time() - begin)
        first = scenarios[0]
        ready[name].plan(first.start, first.goal)
        totals[name].held.append(held_bytes(ready[name].holder) - grid_map.cells.nbytes)
    grid = Costmap(grid_map, GRID_CONFIG).grid_graph
    gc.collect()
    for scenario in scenarios:
        least = dict.fromkeys(methods, np.inf)
        for turn in range(rounds):
            for name in methods if turn % 2 == 0 else reversed(methods):
                begin = time.thread_time()
                path = ready[name].plan(scenario.start, scenario.goal)
                least[name] = min(least[name], time.thread_time() - begin)
                if turn == 0:
                    cost = path_cost(grid, path.astype(np.int32)) if len(path) else np.nan
                    totals[name].add(scenario, cost, 0.0)
        for name in methods:
            totals[name].queries[-1] = least[name]


def held_bytes(root: object) -> int:
    """Return the bytes of all arrays that an object leads to, each counted once."""
    seen: set[int] = set()
    left, total = [root], 0
    while left:
        item = left.pop()
        if id(item) in seen or isinstance(item, SHARED):
            continue
        seen.add(id(item))
        if isinstance(item, np.ndarray):
            # A view holds all of the array that it is of.
            left += [] if item.base is None else [item.base]
            total += item.nbytes if item.base is None else 0
        else:
            left += gc.get_referents(item)
    return total


def measure_peer(
    command: str, map_path: Path, scenarios: Path, rows: Sequence[Scenario], total: Total
) -> None:
    """Add what another program says of a map; raises SystemExit where it does not answer."""
    words = [*shlex.split(command), str(map_path), str(scenarios)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=PEER_S, check=False)  # noqa: S603
    answers: list[Answer] = []
    for line in done.stdout.splitlines():
        first, second = line.split()[:2]
        if first == 'preparation':
            total.preparation.append(float(second) / 1e3)
        elif first == 'storage':
            total.held.append(float(second))
        else:
            cost = float(first)
            answers.append((np.nan if cost < 0 else cost, float(second) / 1e6))
    if done.returncode or len(answers) != len(rows):
        said = done.stderr.strip()[-300:]
        raise SystemExit(f'{command}: {len(answers)} answers to {len(rows)} rows: {said}')
    for row, answer in zip(rows, answers):
        total.add(row, *answer)


def peak_bytes(method: str, map_path: Path, query: Scenario) -> float:
    """Return what preparing a map and one query add to the memory of the process that calls."""
    compile_kernels()
    grid_map = load_map(map_path)
    # What is loaded and compiled once for all maps is in memory before.
    METHODS[method](GridMap(np.zeros((40, 40), np.int8), 1.0)).plan((1, 1), (30, 30))
    Path('/proc/self/clear_refs').write_text('5', encoding='ascii')
    before = resident('VmRSS')
    METHODS[method](grid_map).plan(query.start, query.goal)
    return resident('VmHWM') - before


def write_rows(path: Path, rows: Sequence[Scenario]) -> Path:
    """Write a scenario file of some rows."""
    lines = ['version 1']
    for row in rows:
        numbers = (row.width, row.height, *row.start, *row.goal, row.optimal_length)
        lines.append('\t'.join(map(str, (row.bucket, row.map_name, *numbers))))
    path.write_text('\n'.join(lines) + '\n', encoding='ascii')
    return path


def measure_set(
    name: str, options: argparse.Namespace, peers: dict[str, str]
) -> dict[str, dict[str, Any]]:
    """Measure a set; return the figures of each method, and keep them in the folder of results."""
    methods = options.methods.split(';')
    totals = {method: Total() for method in (*methods, *peers)}
    files = list(files_of(options.maps, name))
    largest = max(files, key=lambda pair: pair[0].stat().st_size)
    # Each method in a process of its own, which has held nothing before.
    with multiprocessing.get_context('spawn').Pool(1, maxtasksperchild=1) as pool:
        for method in methods:
            query = load_scenarios(largest[1])[-1]
            totals[method].peak = pool.apply(peak_bytes, (method, largest[0], query))
    for number, (map_path, scenario_path) in enumerate(files, 1):
        rows = chosen(load_scenarios(scenario_path), options.limit)
        if not rows:
            continue
        measure_map(map_path, rows, methods, options.rounds, totals)
        for peer, command in peers.items():
            written = write_rows(options.out / 'rows.map.scen', rows)
            measure_peer(command, map_path, written, rows, totals[peer])
        sys.stderr.write(f'\r{name}: {number} of {len(files)} maps ')
    sys.stderr.write('\n')
    return {method: figures(total) for method, total in totals.items()}


def figures(total: Total) -> dict[str, Any]:
    """Return a method's figures: milliseconds, megabytes and shares."""
    times = np.array(total.queries) * 1e3
    lengths = np.array(total.lengths)
    ends = (0.0, *BUCKETS, np.inf)
    shares = [np.mean((lengths > low) & (lengths <= high)) for low, high in pairwise(ends)]
    return {
        'rows': len(times),
        'as_published': total.as_published,
        'unsolved': total.unsolved,
        'mean_ms': float(times.mean()),
        'median_ms': float(np.median(times)),
        'p95_ms': float(np.percentile(times, 95)),
        'most_ms': float(times.max()),
        'first_20_steps_ms': float(times.mean()),
        'preparation_ms': float(np.mean(total.preparation) * 1e3) if total.preparation else None,
        'held_mb': float(np.mean(total.held) / 1e6) if total.held else None,
        'peak_mb': total.peak / 1e6 or None,
        'suboptimality': float(lengths.mean()) if len(lengths) else None,
        'shares': [float(share) for share in shares],
        'wrong': total.wrong[:20],
    }


def table(results: dict[str, dict[str, dict[str, Any]]]) -> str:
    """Return the figures as a table in Markdown."""
    buckets = [f'to {end}' for end in BUCKETS[1:]]
    head = ['set', 'method', 'rows', 'as published', 'ms', 'median', '95 %', 'most',
            'preparation ms', 'held MB', 'most MB', 'as short', *buckets, 'longer']  # fmt: skip
    lines = [head, ['---'] * len(head)]
    for name, methods in results.items():
        for method, found in methods.items():
            numbers = ['-' if found[key] is None else f'{found[key]:.3g}' for key in NUMBERS]
            shares = [f'{100 * share:.2f} %' for share in found['shares']]
            published = f'{found["as_published"]:,}'
            lines.append([name, method, f'{found["rows"]:,}', published, *numbers, *shares])
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare lengths with the published ones; measure time, memory and suboptimality."""
    parser = argparse.ArgumentParser('benchmarks.gppc', description=main.__doc__)
    parser.add_argument(
        '--maps', type=Path, required=True, metavar='FOLDER',
        help='folder with SET-map/x.map and SET-scen/x.map.scen',
    )  # fmt: skip
    parser.add_argument('--sets', default='dao', help=f'of {", ".join(SETS)} (%(default)s)')
    parser.add_argument(
        '--methods', default=';'.join(METHODS), help='separated by semicolons (%(default)s)'
    )
    parser.add_argument('--limit', type=int, metavar='N', help='rows of each map (all)')
    parser.add_argument('--rounds', type=int, default=3, metavar='N', help='(%(default)s)')
    parser.add_argument(
        '--peer', action='append', default=[], metavar='NAME=COMMAND', help='another planner'
    )
    parser.add_argument('--out', type=Path, default=Path('out/gppc'), metavar='DIR')
    options = parser.parse_args(arguments)
    unknown = [name for name in options.methods.split(';') if name not in METHODS]
    if unknown:
        parser.error(f'--methods: {unknown[0]} is none of {"; ".join(METHODS)}')
    options.out.mkdir(parents=True, exist_ok=True)
    peers = dict(one.split('=', 1) for one in options.peer)
    compile_kernels()
    results = {}
    for name in options.sets.split(','):
        results[name] = measure_set(name, options, peers)
        text = json.dumps(results, indent=1)
        (options.out / 'gppc.json').write_text(text, encoding='utf-8')
    print(table(results))
    exact = [found['exact_astar'] for found in results.values() if 'exact_astar' in found]
    return 3 if any(found['as_published'] < found['rows'] for found in exact) else 0


if __name__ == '__main__':
    raise SystemExit(main())
