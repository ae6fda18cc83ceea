"""Whether paths cost what they should: Dijkstra on drawn maps, and on maps that change.

`python -m benchmarks.exactness` draws small maps, many with sides next to those of tiles, and
says what the exact and the guided search do not find or prove wrongly. Then windows of larger
maps change, and a planner that follows has to find what one made from nothing does. Dijkstra is
scipy's, on a graph built here from the rule. It ends with 1 where anything is wrong.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import PlanRequest
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.grid_graph import FINE_UNITS, GridGraph
from llm_astar_planner.search.guided import guided
from llm_astar_planner.search.landmarks import MAX_BYTES, LandmarkManager, Landmarks
from numpy.typing import NDArray
from scipy import ndimage, sparse
from scipy.sparse import csgraph

from benchmarks.cases import GRADED, RESOLUTION, SEED, UNIFORM

SIDES = (*range(63, 67), *range(126, 131), 193)
# How often a map changes, and its size: two tiles and more.
CHANGES, SHAPE = 50, (200, 330)
BOUNDS = (1.0, 1.1)
# On graded costs a path that is cheaper unrounded remains, though it may take more units.
ROUNDING = 5e-4
Array = NDArray[Any]


class Judge:
    """What moves and cheapest paths cost in units, by the rule: all is rounded down."""

    def __init__(self, blocked: Array, cost: Array, *, corner_cutting: bool = False) -> None:
        """Take bool and 0 to 100, both [height, width]."""
        walls, prices = np.pad(blocked, 1, constant_values=True), np.pad(cost, 1)
        prices = prices.astype(np.int64) * 512 // 100
        self.rounding = ROUNDING if cost.any() else 0.0
        self._cells, parts = np.arange(walls.size).reshape(walls.shape), []
        for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
            closed = walls | shifted(walls, down, right)
            if down and right and not corner_cutting:
                closed |= shifted(walls, down, 0) | shifted(walls, 0, right)
            length = FINE_UNITS[1 if down and right else 0]
            units = length + (length * (prices + shifted(prices, down, right)) >> 9)
            ends = self._cells, shifted(self._cells, down, right)
            parts.append(np.stack((*ends, units))[:, ~closed])
        begins, ends, units = np.concatenate(parts, axis=1)
        graph = sparse.csr_array((units, (begins, ends)), shape=(walls.size,) * 2)
        self._graph = sparse.csr_array(graph + graph.T)

    def least(self, start: tuple[int, ...]) -> Array:
        """Return what paths from a cell cost at least, by cell: inf where there is none."""
        first = self._cells[start[1] + 1, start[0] + 1]
        distances: Array = csgraph.dijkstra(self._graph, indices=first)
        return distances.reshape(self._cells.shape)[1:-1, 1:-1]

    def problem(self, found: Any, bound: float, least: float) -> str | None:  # noqa: ANN401
        """Say what is wrong with a result whose path may cost `bound` times the least."""
        if not len(found.path):
            return None if np.isinf(least) else f'no path, the least is {least}'
        cells = self._cells[found.path[:, 1] + 1, found.path[:, 0] + 1]
        units = np.asarray(self._graph[cells[:-1], cells[1:]]).ravel()
        ratio, proven = max(units.sum(), 1) / max(least, 1), found.suboptimality_bound
        if units.all() and 1.0 <= ratio <= min(bound, proven * (1.0 + 1e-6)):
            return None
        wrong = f'{ratio} of the least, {proven} proven' if units.all() else 'illegal moves'
        return f'{wrong}, {bound} asked for'


def shifted(array: Array, down: int, right: int) -> Array:
    """Return for each cell the value of the cell so far down and right."""
    return np.roll(array, (-down, -right), (0, 1))


def drawn_map(random: np.random.Generator, shape: Array | tuple[int, int]) -> tuple[Array, Array]:
    """Return walls, boxes and gaps; and costs: none, near what is blocked, or any."""
    blocked = random.random(shape) < random.choice([0.0, 0.02, 0.25])
    for number in range(int(random.integers(20))):
        y, x = random.integers(0, shape)
        height, width = (8, 8) if number % 3 == 2 else random.choice([1, 2, 40, 90], 2)
        blocked[y : y + height, x : x + width] = number % 3 < 2
    near = np.clip(98 - 12 * ndimage.distance_transform_edt(~blocked), 0, 98)
    costs = np.zeros(shape), near, random.integers(0, 99, shape)
    return blocked, costs[random.integers(3)].astype(np.int8)


def map_problems(seed: int) -> Iterator[str]:
    """Search a drawn map; yield what is wrong."""
    random = np.random.default_rng((SEED, seed))
    shape = random.choice(SIDES, 2) if seed % 4 else random.integers(2, 63, 2)
    blocked, cost = drawn_map(random, shape)
    cutting, free = bool(random.integers(2)), random.permutation(np.argwhere(~blocked))[:, ::-1]
    grid = GridGraph(blocked, cost=cost if cost.any() else None, corner_cutting=cutting)
    # With landmarks, borders of tiles in their place, or neither.
    most = random.choice([0, MAX_BYTES])
    options: dict[str, Any]
    options = {'landmarks': Landmarks.build(grid, max_bytes=most) if seed % 5 else None}
    judge = Judge(blocked, cost, corner_cutting=cutting)
    for start, other in zip(free[:1].tolist(), free[1:2].tolist()):
        farthest = free[np.abs(free - start).max(axis=1).argmax()].tolist()
        least = judge.least(start)
        for goal in (other, farthest):
            found = {('exact', 1.0): exact_astar(grid, start, goal)}
            for bound in BOUNDS:
                options['max_suboptimality'] = bound
                for name, guides in (('guided', ()), ('waypoints', free[3:6])):
                    kind = name, bound + judge.rounding
                    found[kind] = guided(grid, start, goal, guides, **options)
            for (name, bound), result in found.items():
                problem = judge.problem(result, bound, least[goal[1], goal[0]])
                if problem is not None:
                    yield f'map {seed}, {start} to {goal}, {name}: {problem}'


def change_problems(seed: int, changes: int) -> Iterator[str]:
    """Change a drawn map so many times and plan on each; yield what is wrong."""
    random = np.random.default_rng((SEED, seed))
    blocked, cost = drawn_map(random, SHAPE)
    cells, config = np.where(blocked, 100, cost // 2).astype(np.int8), (UNIFORM, GRADED)[seed % 2]
    manager, planner = LandmarkManager(max_bytes=int(random.choice([0, MAX_BYTES]))), None
    for number in range(changes + 1):
        grid_map = GridMap(cells.copy(), RESOLUTION)
        planner = Planner(grid_map, config, landmarks=manager, previous=planner)
        planner.prepare(wait=bool(random.random() < 0.7))
        planners = {'following': planner, 'from nothing': Planner(grid_map, config).prepare()}
        costmap = planners['from nothing'].costmap
        judge = Judge(costmap.blocked, np.maximum(costmap.cost, 0))
        free = random.permutation(np.argwhere(~costmap.blocked))[:2, ::-1]
        for start, goal in zip(free[:1].tolist(), free[1:].tolist()):
            least = judge.least(start)[goal[1], goal[0]]
            for bound in BOUNDS:
                request = PlanRequest(start, goal, max_suboptimality=bound, time_limit=600.0)
                for name, one in planners.items():
                    problem = judge.problem(one.plan(request), bound + judge.rounding, least)
                    if problem is not None:
                        yield f'map {seed}, change {number}, {name}, {start} to {goal}: {problem}'
        y, x, height, width = *random.integers(0, SHAPE), *random.integers(1, 40, 2)
        cells[y : y + height, x : x + width] = random.choice([0, 0, 30, 100])
    manager.close()


def main(arguments: Sequence[str] | None = None) -> int:
    """Print what is wrong and how much was looked at; return 1 if anything is wrong."""
    parser = argparse.ArgumentParser('benchmarks.exactness', description=__doc__)
    parser.add_argument('--maps', type=int, default=10_000, metavar='N', help='(%(default)s)')
    parser.add_argument('--changes', type=int, default=1000, metavar='N', help='(%(default)s)')
    options = parser.parse_args(arguments)
    left = range(options.changes, 0, -CHANGES)
    changes = [change_problems(seed, min(CHANGES, count)) for seed, count in enumerate(left)]
    wrong = 0
    for problem in chain(*map(map_problems, range(options.maps)), *changes):
        wrong += 1
        print(problem, flush=True)
    print(f'{options.maps} maps, {options.changes} changes, from seed {SEED}: {wrong} wrong')
    return 1 if wrong else 0


if __name__ == '__main__':
    raise SystemExit(main())
