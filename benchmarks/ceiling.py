"""What perfect waypoints can save, by family of maps, size and costs: the ceiling of any source.

The waypoints are the turns of the cheapest path and cost nothing. The guided search within 1.1 of
the cheapest path is compared with itself without waypoints, in expansions and in thread CPU time
of the search, which is measured in alternation. With `--no-landmarks` it begins at once, as on a
new map.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from llm_astar_lab.datasets.named import GENERATED, DrawRules, draw_family
from llm_astar_lab.report.table import markdown_table
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap
from llm_astar_planner.search.guided import guided
from llm_astar_planner.search.result import SearchResult

from benchmarks.cases import Problem, Query
from benchmarks.ours import BOUND, Prepared

TURNS = 3


class Saving(NamedTuple):
    """Of one query: expansions and milliseconds without waypoints, and the shares with them."""

    expansions: int
    milliseconds: float
    work: float
    time: float


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--maps', type=int, default=4)
    parser.add_argument('--pairs', type=int, default=5)
    parser.add_argument('--scales', type=int, nargs='+', default=[1, 4, 8])
    parser.add_argument('--families', nargs='+', default=list(GENERATED))
    parser.add_argument('--no-landmarks', action='store_true')
    options = parser.parse_args(arguments)
    rules, rows = DrawRules(seed=1, maps=options.maps, pairs=options.pairs), []
    for family in options.families:
        for scale in options.scales:
            problems = draw_family(family, rules, scale)
            for graded in (False, True):
                found = list(savings(problems, graded=graded, landmarks=not options.no_landmarks))
                rows.append((family, size_of(problems[0]), 'graded' if graded else 'uniform',
                             *row(found)))  # fmt: skip
                print(*rows[-1], sep='  ', flush=True)
    heads = ('family', 'cells', 'costs', 'expansions, none', 'ms, none', 'expansions, oracle (%)',
             'time, oracle (%)')  # fmt: skip
    print(markdown_table(heads, rows))


def size_of(problem: ProblemMap) -> str:
    """Return width x height."""
    height, width = problem.to_grid().cells.shape
    return f'{width} x {height}'


def savings(problems: Sequence[ProblemMap], *, graded: bool, landmarks: bool) -> Iterator[Saving]:
    """Yield what perfect waypoints save on each query that is not answered at once."""
    for item in problems:
        queries = tuple((item.to_cell(s.start), item.to_cell(s.goal)) for s in item.samples)
        prepared = Prepared(Problem(item.to_grid().blocked(), queries, graded=graded))
        for query in queries:
            yield saving(prepared, query, landmarks=landmarks)


def saving(prepared: Prepared, query: Query, *, landmarks: bool) -> Saving:
    """Measure one query with and without waypoints, in turns."""
    search = partial(
        guided, prepared.grid, *query, max_suboptimality=BOUND, want_expanded=False,
        landmarks=prepared.landmarks if landmarks else None,
    )  # fmt: skip
    runs: tuple[Callable[[], SearchResult], ...] = (
        partial(search, np.empty((0, 2))),
        partial(search, prepared.turns[query]),
    )
    times: tuple[list[float], list[float]] = [], []
    for turn in range(TURNS + 1):
        for run, own in zip(runs, times):
            begin = time.thread_time_ns()
            run()
            if turn:
                own.append((time.thread_time_ns() - begin) * 1e-6)
    counts = [max(1, run().expansions) for run in runs]
    none, oracle = map(statistics.median, times)
    return Saving(counts[0], none, counts[1] / counts[0], oracle / none)


def row(found: Sequence[Saving]) -> tuple[str, ...]:
    """Return medians without waypoints, and geometric means of the shares in percent."""
    expansions, milliseconds = (
        statistics.median(getattr(item, name) for item in found)
        for name in ('expansions', 'milliseconds')
    )
    work, seconds = (
        100 * statistics.geometric_mean(getattr(item, name) for item in found)
        for name in ('work', 'time')
    )
    return f'{expansions:,.0f}', f'{milliseconds:.2f}', f'{work:.0f}', f'{seconds:.0f}'


if __name__ == '__main__':
    main()
