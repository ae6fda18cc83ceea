"""Time grid planners side by side, as ratios with their spread: CPU time of the calling thread.

Planners take turns on the same queries, in another order each round, so that other load on the
machine slows them all alike. What a planner prepares for a map is timed apart. The tables also
say which share of each planner's paths is legal and optimal, and what they hold in memory. Peers
are measured if they are installed. Run it with `python -m benchmarks.speed --help`.
"""

from __future__ import annotations

import argparse
import gc
import json
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from llm_astar_planner.planning.compile import compile_kernels
from llm_astar_planner.search.grid_graph import path_cost
from numpy.typing import NDArray

from benchmarks import any_waypoints, live_maps, memory, tables
from benchmarks.cases import MakeCase, SpeedCase, all_cases
from benchmarks.ours import EXACT, Prepared, our_rows
from benchmarks.peers import PEERS, Path2D, Peer, Plan

ROUNDS = 5
# Larger cases are timed in fewer rounds.
LARGE_CELLS, FEW_ROUNDS = 2**22, 3
# A planner that takes longer for all queries of a case is timed in one round only.
SLOW_S = 2.0
PARTS = ('search', 'memory', 'live', 'waypoints')
MEMORY_CASES = frozenset({'city 1024', 'boxes 4096', 'boxes 4096 graded'})
MOST_WAYPOINT_CELLS = 2**21
# How much costs may differ, relatively, and still be equal: moves are rounded on graded costs.
_TOLERANCE, _GRADED_TOLERANCE = 1e-5, 5e-4
# Published lengths have as few as two decimals.
_PUBLISHED_TOLERANCE = 0.01


class Contestant(NamedTuple):
    """A planner that is prepared for each problem of a case."""

    name: str
    version: str
    plans: Sequence[Plan]
    preparation_ms: float


@dataclass(frozen=True)
class SpeedRow:
    """One planner on one case.

    `ratio` is its time divided by that of `exact_astar`, the median of the rounds; `ratio_low`
    and `ratio_high` are the lowest and the highest. `milliseconds` is the median time per query,
    `preparation_ms` what each map took before. `solved`, `legal` and `optimal` are shares of the
    queries: those with a path, those whose path cuts no corner and crosses no obstacle, and those
    whose path costs as little as possible. `excess` is the mean of cost / optimum - 1 over the
    paths found, `published` how many lengths equal the published ones.
    """

    planner: str
    version: str
    ratio: float
    ratio_low: float
    ratio_high: float
    milliseconds: float
    preparation_ms: float
    solved: float
    legal: float
    optimal: float
    excess: float
    published: int


def contestants(case: SpeedCase, peers: Sequence[Peer]) -> list[Contestant]:
    """Prepare our rows and the peers that can take part in a case."""
    prepared = [Prepared(problem) for problem in case.problems]
    found = []
    for row in our_rows():
        plans = [row.prepare(one) for one in prepared]
        preparation_ms = statistics.fmean(row.preparation_ms(one) for one in prepared)
        found.append(Contestant(row.name, '', plans, preparation_ms))
    for peer in peers:
        if peer.reason_to_skip(case) is None:
            begin = time.thread_time()
            plans = [peer.prepare(problem) for problem in case.problems]
            preparation_ms = (time.thread_time() - begin) * 1e3 / len(plans)
            found.append(Contestant(peer.name, peer.version, plans, preparation_ms))
    return found


def solve(case: SpeedCase, plans: Sequence[Plan]) -> tuple[float, list[Path2D]]:
    """Run all queries of a case; return the CPU seconds of this thread and the paths."""
    paths: list[Path2D] = []
    begin = time.thread_time()
    for problem, plan in zip(case.problems, plans):
        for start, goal in problem.queries:
            paths.append(plan(start, goal))
    return time.thread_time() - begin, paths


def measure(case: SpeedCase, *, peers: Sequence[Peer], rounds: int = ROUNDS) -> list[SpeedRow]:
    """Time all planners on a case, taking turns, after one warm-up round that is not timed."""
    entries = contestants(case, peers)
    warm_up = {entry.name: solve(case, entry.plans) for entry in entries}
    paths = {name: paths for name, (_, paths) in warm_up.items()}
    times: dict[str, list[float]] = {entry.name: [] for entry in entries}
    random = np.random.default_rng(0)
    gc.collect()
    gc.disable()
    try:
        for number in range(rounds if case.cells < LARGE_CELLS else min(rounds, FEW_ROUNDS)):
            for index in random.permutation(len(entries)):
                entry = entries[index]
                if number == 0 or warm_up[entry.name][0] < SLOW_S:
                    times[entry.name].append(solve(case, entry.plans)[0])
    finally:
        gc.enable()
    return [speed_row(case, entry, times, paths) for entry in entries]


def speed_row(
    case: SpeedCase,
    entry: Contestant,
    times: dict[str, list[float]],
    all_paths: dict[str, list[Path2D]],
) -> SpeedRow:
    """Sum up one planner's times and paths on one case."""
    paths, own = all_paths[entry.name], times[entry.name]
    ratios = [one / other for one, other in zip(own, times[EXACT])]
    problems = [problem for problem in case.problems for _ in problem.queries]
    found = [len(path) > 0 for path in paths]
    legal = [ok and is_legal(one.blocked, path) for ok, one, path in zip(found, problems, paths)]
    costs, best = (path_costs(case, some) for some in (paths, all_paths[EXACT]))
    relative = costs / np.maximum(best, 1e-9)
    tolerance = _GRADED_TOLERANCE if case.graded else _TOLERANCE
    published = np.array([one for problem in case.problems for one in problem.published])
    return SpeedRow(
        entry.name,
        entry.version,
        statistics.median(ratios),
        min(ratios),
        max(ratios),
        statistics.median(own) / len(paths) * 1e3,
        entry.preparation_ms,
        statistics.fmean(found),
        statistics.fmean(legal),
        float(np.mean(np.isclose(costs, best, rtol=tolerance, equal_nan=True))),
        float(np.nanmean(relative)) - 1.0 if any(found) else 0.0,
        int((np.abs(costs - published) <= _PUBLISHED_TOLERANCE).sum()) if published.size else 0,
    )


def path_costs(case: SpeedCase, paths: Sequence[Path2D]) -> NDArray[np.float64]:
    """Return what paths cost by our rules, in cells, NaN where there is none."""
    grids = {id(problem): problem.grid for problem in case.problems}
    problems = [problem for problem in case.problems for _ in problem.queries]
    costs = []
    for problem, path in zip(problems, paths):
        grid = grids[id(problem)]
        costs.append(path_cost(grid, path.astype(np.int32)) if len(path) else np.nan)
    return np.array(costs)


def is_legal(blocked: NDArray[np.bool_], path: Path2D) -> bool:
    """Tell whether a path keeps to free cells, makes single moves and cuts no corner."""
    x, y = path.T
    step_x, step_y = np.abs(np.diff(x)), np.abs(np.diff(y))
    if blocked[y, x].any() or (np.maximum(step_x, step_y) != 1).any():
        return False
    return not (blocked[y[:-1], x[1:]] | blocked[y[1:], x[:-1]]).any()


def reasons_to_skip(case: SpeedCase) -> dict[str, str]:
    """Return the peers that take no part in a case, with the reasons."""
    reasons = {peer.name: peer.reason_to_skip(case) for peer in PEERS}
    return {name: reason for name, reason in reasons.items() if reason is not None}


class Results:
    """A folder of results, a JSON file for each part of each case; what is there is kept."""

    def __init__(self, folder: Path) -> None:
        """Take the folder; it is made if it does not exist."""
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def case(self, name: str, make: MakeCase) -> SpeedCase:
        """Return a case, which is made and saved if it was not before."""
        path = self.case_path(name)
        if not path.exists():
            make().save(path)
        return SpeedCase.load(path)

    def case_path(self, name: str) -> Path:
        """Return the file of a case."""
        return self.folder / f'{name}.npz'

    def keep(self, part: str, name: str, measure_it: Callable[[], Any]) -> None:
        """Measure a part of a case if it was not measured before, and write the result."""
        path = self.folder / f'{part} {name}.json'
        if path.exists():
            return
        begin = time.monotonic()
        path.write_text(json.dumps(measure_it(), indent=1), encoding='utf-8')
        sys.stderr.write(f'{part} {name}: {time.monotonic() - begin:.0f} s\n')


def measure_parts(
    results: Results, name: str, make: MakeCase, parts: Sequence[str], rounds: int
) -> None:
    """Measure the parts that concern one case."""
    case = results.case(name, make)
    if 'search' in parts:
        results.keep('search', name, partial(search_part, case, rounds))
    if 'memory' in parts and name in MEMORY_CASES:
        path = results.case_path(name)
        results.keep('memory', name, partial(memory.measure, case, path))
    if 'waypoints' in parts and case.cells <= MOST_WAYPOINT_CELLS:
        results.keep('waypoints', name, partial(any_waypoints.measure, case))


def search_part(case: SpeedCase, rounds: int) -> dict[str, Any]:
    """Time the planners on a case; return what the tables need to know."""
    return {
        'cells': case.cells,
        'graded': case.graded,
        'queries': sum(len(problem.queries) for problem in case.problems),
        'published': sum(len(problem.published) for problem in case.problems),
        'rows': [asdict(row) for row in measure(case, peers=PEERS, rounds=rounds)],
        'skipped': reasons_to_skip(case),
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Time our searches and the installed peers, taking turns in one process."""
    parser = argparse.ArgumentParser('benchmarks.speed', description=main.__doc__)
    parser.add_argument(
        '--out', type=Path, default=Path('out/speed'), metavar='DIR',
        help='folder of results; what is in it is not measured again (%(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '--reference', type=Path, metavar='DIR', help='also use the maps of a reference folder'
    )
    parser.add_argument(
        '--maps', type=Path, metavar='DIR', help="folder of MovingAI's .map and .map.scen files"
    )
    parser.add_argument(
        '--largest', type=int, default=8192, metavar='N',
        help='largest side of a generated map and of live maps, in cells (%(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '--parts', nargs='+', choices=PARTS, default=PARTS, help='what to measure (all)'
    )
    parser.add_argument('--only', default='', metavar='WORD', help='only cases with this word')
    parser.add_argument(
        '--rounds', type=int, default=ROUNDS, metavar='N', help='rounds of timing (%(default)s)'
    )
    parser.add_argument('--markdown', action='store_true', help='print tables in Markdown')
    options = parser.parse_args(arguments)
    if options.rounds < 1:
        parser.error(f'--rounds {options.rounds} is below 1')
    compile_kernels()
    results = Results(options.out)
    for name, make in all_cases(options.reference, options.maps, options.largest):
        if options.only in name:
            measure_parts(results, name, make, options.parts, options.rounds)
    for size in live_maps.SIZES if 'live' in options.parts else ():
        if size <= options.largest:
            results.keep('live', str(size), partial(live_maps.measure, size))
    print(tables.report(options.out, markdown=options.markdown))
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
