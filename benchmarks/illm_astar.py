"""LLM-A* in plain Python with lists and with sets, and iLLM-A* beside it: time, memory, lengths.

iLLM-A* (Zeng et al., arXiv 2510.02716) reports over 1000 times the speed of LLM-A*, on maps of up
to 450 x 450 cells. This restates both in plain Python, by what their papers say of them, to tell
how much of that is the list of closed cells that became a set:

- `lists`: LLM-A* with closed cells in a list, which is searched for every neighbour, and all keys
  of the queue computed again whenever the target changes;
- `sets`: the same search, expansion by expansion, with closed cells in a set;
- `delayed`: besides, a key is computed again only when its cell is taken from the queue;
- `fewer`: besides, at most two of the waypoints, those farthest from start, goal and each other.

The last two are iLLM-A*'s search; its trained prompts are not part of this: all rows get the
corners of the best path. The last row is `guided` of this package, compiled, as a yardstick. Times
are thread CPU times, memory is the peak of a run of its own.
"""

from __future__ import annotations

import argparse
import heapq
import math
import statistics
import time
import tracemalloc
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from llm_astar_lab.datasets.generate import MapRules, generate
from llm_astar_lab.report.table import markdown_table
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.waypoints.baselines import baseline_sources
from llm_astar_planner.waypoints.source import WaypointQuery

Cell = tuple[int, int]
STEPS = [(-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1)]
ROWS = ('lists', 'sets', 'delayed', 'fewer')


class Found(NamedTuple):
    """What a search found: the length of the path in cells, and its expansions."""

    length: float
    expansions: int


class Closed(list[Cell]):
    """Closed cells in a list, with the method of a set."""

    add = list.append


class PlainSearch:
    """LLM-A* on free cells: f = g + h(goal) + h(target), the target being the next waypoint."""

    def __init__(self, free: set[Cell], *, lists: bool, delayed: bool) -> None:
        """Choose how closed cells are kept, and when keys follow a new target."""
        self.free, self.lists, self.delayed = free, lists, delayed

    def key(self, cell: Cell) -> float:
        """Return f of a cell by the target of now."""
        return self.costs[cell] + math.dist(cell, self.goal) + math.dist(cell, self.targets[0])

    def run(self, start: Cell, goal: Cell, waypoints: Iterable[Cell]) -> Found:
        """Search from start to goal."""
        self.goal, self.targets = goal, [*waypoints, goal]
        self.costs = {start: 0.0}
        closed: Closed | set[Cell] = Closed() if self.lists else set()
        self.queue = [(self.key(start), start)]
        while self.queue:
            key, cell = heapq.heappop(self.queue)
            if cell in closed or (self.delayed and self.is_put_back(key, cell)):
                continue
            closed.add(cell)
            if cell == goal:
                return Found(self.costs[cell], len(closed))
            if cell == self.targets[0] and len(self.targets) > 1:
                self.change_target()
            self.expand(cell, closed)
        return Found(math.inf, len(closed))

    def is_put_back(self, key: float, cell: Cell) -> bool:
        """Tell whether a cell had an old key that was too small, and goes back with the new."""
        now = self.key(cell)
        if now > key:
            heapq.heappush(self.queue, (now, cell))
        return now > key

    def change_target(self) -> None:
        """Head for the next waypoint; at once all keys are computed again, unless delayed."""
        self.targets.pop(0)
        if not self.delayed:
            self.queue = [(self.key(cell), cell) for _, cell in self.queue]
            heapq.heapify(self.queue)

    def expand(self, cell: Cell, closed: Closed | set[Cell]) -> None:
        """Put the neighbours of a cell that are reached at a lower cost into the queue."""
        for dx, dy in STEPS:
            near = cell[0] + dx, cell[1] + dy
            cost = self.costs[cell] + math.hypot(dx, dy)
            if near in self.free and near not in closed and cost < self.costs.get(near, math.inf):
                self.costs[near] = cost
                heapq.heappush(self.queue, (self.key(near), near))


class Problem(NamedTuple):
    """One query with its waypoints, and the planner of its map."""

    planner: Planner
    free: set[Cell]
    start: Cell
    goal: Cell
    waypoints: list[Cell]


def problems(size: int, count: int) -> Iterator[Problem]:
    """Yield queries on maps of barriers of `size` x `size` cells, with the best path's corners."""
    source = baseline_sources()['oracle']
    for item in generate(7, count, MapRules(size=(size - 1, size - 1), pairs=1)):
        planner = Planner(item.to_grid(), CostmapConfig(corner_cutting=True), item).prepare()
        sample = item.samples[0]
        ends = item.to_cell(sample.start), item.to_cell(sample.goal)
        y, x = np.nonzero(~planner.costmap.blocked)
        free = set(zip(x.tolist(), y.tolist()))
        points = source.waypoints(WaypointQuery(planner.costmap, *ends)).waypoints
        cells = [(round(px), round(py)) for px, py in points]
        yield Problem(planner, free, *ends, [cell for cell in cells if cell in free])


def fewer(problem: Problem) -> list[Cell]:
    """Return at most two of the waypoints, in their order."""
    kept = [problem.start, problem.goal]
    left = list(problem.waypoints)
    while left and len(kept) < 4:
        kept.append(max(left, key=lambda cell: min(math.dist(cell, other) for other in kept)))
        left.remove(kept[-1])
    return [cell for cell in problem.waypoints if cell in kept[2:]]


def search_of(name: str, problem: Problem) -> Callable[[], Found]:
    """Return the search of a row on a problem."""
    if name == 'guided':
        request = PlanRequest(problem.start, problem.goal, want_expanded=False)

        def plan() -> Found:
            found = problem.planner.plan(request)
            return Found(found.length or math.inf, found.expansions)

        return plan
    delayed = name in ('delayed', 'fewer')
    search = PlainSearch(problem.free, lists=name == 'lists', delayed=delayed)
    waypoints = fewer(problem) if name == 'fewer' else problem.waypoints
    return lambda: search.run(problem.start, problem.goal, waypoints)


def measure(run: Callable[[], Found]) -> tuple[Found, float, float]:
    """Return what a search finds, its CPU seconds, and its peak memory in MB in another run."""
    begin = time.thread_time()
    found = run()
    seconds = time.thread_time() - begin
    tracemalloc.start()
    run()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return found, seconds, peak / 1e6


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table: means over the queries of a size."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--sizes', type=int, nargs='+', default=[50, 150, 250, 450])
    parser.add_argument('--samples', type=int, default=5)
    options = parser.parse_args(arguments)
    rows = []
    for size in options.sizes:
        every = list(problems(size, options.samples))
        slowest = 0.0
        search_of('guided', every[0])()  # loads what is compiled
        for name in (*ROWS, 'guided'):
            found, seconds, peaks = zip(*(measure(search_of(name, one)) for one in every))
            total = statistics.fmean(seconds)
            slowest = slowest or total
            rows.append((
                f'{size}', name, f'{statistics.fmean(item.expansions for item in found):,.0f}',
                f'{1e3 * total:,.2f}', f'{slowest / total:,.1f}',
                f'{statistics.fmean(peaks):.2f}',
                f'{statistics.fmean(item.length for item in found):.1f}',
            ))  # fmt: skip
            print(*rows[-1], sep='  ', flush=True)
    heads = ('cells a side', 'search', 'expansions', 'ms', 'times as fast', 'MB', 'length')
    print(markdown_table(heads, rows))


if __name__ == '__main__':
    main()
