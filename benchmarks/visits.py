"""CPU time of searches that visit regions in any order, with landmarks and without.

`python -m benchmarks.visits` prints a table: discs drawn at random on a map of a family.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence

import numpy as np
from llm_astar_planner.search.automata import visits
from llm_astar_planner.search.landmarks import Landmarks
from llm_astar_planner.search.product import Mask, ProductProblem, ProductResult, product_search
from scipy import ndimage

from benchmarks.cases import Problem, Query, generated_case, graded_case

# Runs of each search; the quickest counts.
REPEATS = 3


def main(argv: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--family', default='rooms')
    parser.add_argument('--size', type=int, default=512)
    parser.add_argument('--regions', type=int, nargs='+', default=[0, 1, 4, 8])
    parser.add_argument('--diameter', type=int, nargs='+', default=[16, 40], help='in cells')
    options = parser.parse_args(argv)
    uniform = generated_case(options.family, options.size, 20)
    print('| costs | landmarks | cells across | regions | median ms | p90 | expansions | states |')
    print('|---|---|---|---|---|---|---|---|')
    for case in (uniform, graded_case(lambda: uniform)):
        (problem,) = case.problems
        for landmarks in (Landmarks.build(problem.grid), None):
            for diameter in options.diameter:
                for count in options.regions:
                    line = measure(problem, landmarks, diameter, count)
                    measured = 'no' if landmarks is None else 'yes'
                    costs = 'graded' if problem.graded else 'uniform'
                    print(f'| {costs} | {measured} | {diameter} | {count} | {line} |', flush=True)


def measure(problem: Problem, landmarks: Landmarks | None, diameter: int, count: int) -> str:
    """Return the cells of a line of the table, from the median on."""
    timed = [
        time_search(problem, landmarks, query, regions)
        for query, regions in instances(problem, diameter, count)
    ]
    times, results = zip(*timed)
    expansions = np.mean([result.expansions for result in results])
    states = np.mean([result.states for result in results])
    median, p90 = np.quantile(times, (0.5, 0.9))
    return f'{median:.1f} | {p90:.1f} | {expansions:.0f} | {states:.0f}'


def instances(
    problem: Problem, diameter: int, count: int
) -> Iterator[tuple[Query, tuple[Mask, ...]]]:
    """Yield each query with so many discs around free cells, what of them it can reach."""
    labels, _ = ndimage.label(~problem.blocked)
    rows, columns = np.ogrid[: problem.blocked.shape[0], : problem.blocked.shape[1]]
    for number, query in enumerate(problem.queries):
        random = np.random.default_rng(1000 + number)
        reached = labels == labels[query[0][1], query[0][0]]
        centres = random.choice(np.argwhere(reached), count)
        yield (
            query,
            tuple(
                reached & (4 * ((rows - y) ** 2 + (columns - x) ** 2) <= diameter**2)
                for y, x in centres
            ),
        )


def time_search(
    problem: Problem, landmarks: Landmarks | None, query: Query, regions: tuple[Mask, ...]
) -> tuple[float, ProductResult]:
    """Return the CPU milliseconds of one search, of its automaton too, and its result."""
    times = []
    for _ in range(REPEATS):
        began = time.process_time()
        asked = ProductProblem(regions, (visits([range(len(regions))]),))
        result = product_search(
            problem.grid, *query, asked, landmarks=landmarks, want_expanded=False
        )
        times.append(1e3 * (time.process_time() - began))
    return min(times), result


if __name__ == '__main__':
    main()
