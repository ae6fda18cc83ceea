"""Random grids and a plain Dijkstra to hold the fast searches against."""

import heapq
import math
from itertools import pairwise

import numpy as np
from hypothesis import strategies as st
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.planning.path_validator import CollisionChecker
from llm_astar_planner.search.any_angle import straight_path
from llm_astar_planner.search.astar import exact_astar
from llm_astar_planner.search.grid_graph import GridGraph


def dijkstra(grid: GridGraph, start, goal) -> float:
    """The least cost in cells, inf where there is no way; from the rule, not from the masks."""
    height, width = grid.blocked.shape
    surcharge = (
        grid.cell_surcharge.reshape(height, width)
        if grid.cell_surcharge.size
        else np.zeros((height, width))
    )
    best = {start: 0.0}
    heap = [(0.0, start)]
    while heap:
        cost, (x, y) = heapq.heappop(heap)
        if (x, y) == goal:
            return cost
        if cost > best[x, y]:
            continue
        for dx in (-1, 0, 1):
            for dy in (-1, 0, 1):
                other = (x + dx, y + dy)
                if (dx, dy) == (0, 0) or not is_move(grid, (x, y), other):
                    continue
                mean = (float(surcharge[y, x]) + float(surcharge[other[1], other[0]])) / 512.0
                new = cost + math.hypot(dx, dy) * (1.0 + mean)
                if new < best.get(other, math.inf):
                    best[other] = new
                    heapq.heappush(heap, (new, other))
    return math.inf


def is_move(grid: GridGraph, cell, other) -> bool:
    """Whether one may go from a free cell to a neighbour."""
    (x, y), (other_x, other_y) = cell, other
    height, width = grid.blocked.shape
    if not (0 <= other_x < width and 0 <= other_y < height) or grid.blocked[other_y, other_x]:
        return False
    corner = grid.blocked[y, other_x] or grid.blocked[other_y, x]
    return grid.corner_cutting or not corner


def can_see(grid: GridGraph, cell, other) -> bool:
    """Whether the straight line between two cells' centres crosses no blocked cell."""
    return straight_path(grid, np.array([cell, other], dtype=np.int32)) is not None


def assert_path(grid: GridGraph, path, start, goal, cost) -> None:
    """The path joins the cells by legal moves and costs what is said."""
    cells = [(int(x), int(y)) for x, y in path]
    assert cells[0] == start
    assert cells[-1] == goal
    assert len(set(cells)) == len(cells)
    for cell, other in pairwise(cells):
        assert max(abs(cell[0] - other[0]), abs(cell[1] - other[1])) == 1
        assert is_move(grid, cell, other)
    units = path_units(grid, path)
    assert grid.proven(path, units, units)[0] == cost


def path_units(grid: GridGraph, path) -> int:
    """The cost of a path of single moves in the grid's units of length, by the rule."""
    diagonal = np.abs(np.diff(path, axis=0)).sum(axis=1) == 2
    units = np.where(diagonal, grid.diagonal, grid.straight).astype(np.int64)
    if grid.cell_surcharge.size:
        cells = path[:, 1].astype(np.int64) * grid.width + path[:, 0]
        surcharges = grid.cell_surcharge[cells].astype(np.int64)
        units += units * (surcharges[:-1] + surcharges[1:]) >> 9
    return int(units.sum())


def shortest_path(grid: GridGraph, start, goal):
    """A cheapest path [n, 2] and its cost in cells; empty and inf if there is none."""
    result = exact_astar(grid, start, goal, want_expanded=False)
    return result.path, result.cost


def held_bytes(holder) -> int:
    """The bytes of the arrays that an object holds, each counted once."""
    seen, left, total = set(), [holder], 0
    while left:
        item = left.pop()
        if id(item) in seen:
            continue
        seen.add(id(item))
        if isinstance(item, np.ndarray):
            total += item.nbytes
        elif isinstance(item, list | tuple):
            left += item
        else:
            left += getattr(item, '__dict__', {}).values()
    return total


@st.composite
def queries(draw, graded=None):
    """A grid with random blocks or corridors, and two free cells on it."""
    height, width = draw(st.integers(1, 14)), draw(st.integers(1, 14))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    density = draw(st.sampled_from([0.0, 0.1, 0.25, 0.4]))
    blocked = random.random((height, width)) < density
    if draw(st.booleans()) and height > 4:
        # A wall with one gap: detours, so that the estimate errs.
        blocked[height // 2] = True
        blocked[height // 2, random.integers(width)] = False
    cells = random.integers(0, (width, height), (2, 2))
    blocked[cells[:, 1], cells[:, 0]] = False
    cost = None
    if draw(st.booleans()) if graded is None else graded:
        cost = random.integers(-1, 101, blocked.shape) * (random.random(blocked.shape) < 0.5)
    grid = GridGraph(
        blocked,
        corner_cutting=draw(st.booleans()),
        cost=cost,
        cost_multiplier=draw(st.sampled_from([0.5, 2.0, 20.0])),
    )
    start, goal = ((int(x), int(y)) for x, y in cells)
    return grid, start, goal


def checker_of(blocked, *, corner_cutting=False) -> CollisionChecker:
    """The last check on blocked cells, bool [height, width], as they are."""
    config = CostmapConfig(occupied_threshold=1, corner_cutting=corner_cutting)
    return CollisionChecker(GridMap(blocked.view(np.int8)), config)
