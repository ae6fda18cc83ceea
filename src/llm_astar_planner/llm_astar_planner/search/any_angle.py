"""String pulling: straighten a grid path into segments at any angle, on the same grid rules."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search._kernels import line_of_sight as kernels
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.result import Cell

# A path is pulled from both ends in turn until nothing changes, or this often.
MAX_ROUNDS = 8
_MIN_GAIN = 1e-9


class AnyAnglePath(NamedTuple):
    """A path of straight segments at any angle.

    `points` is int32 [n, 2], the cells (x, y) at whose centres it turns. `length` and `cost`
    are in cells; `cost` adds each cell's surcharge times the length inside that cell.
    """

    points: NDArray[np.int32]
    length: float
    cost: float


def can_see(grid: GridGraph, cell: Cell, other: Cell) -> bool:
    """Tell whether the straight line between two cells' centres crosses no blocked cell.

    Where it passes exactly through a corner, both cells next to the corner must be free, unless
    the grid allows corner cutting. Raises ValueError for a cell off the grid.
    """
    return line_cost(grid, cell, other) >= 0.0


def line_cost(grid: GridGraph, cell: Cell, other: Cell) -> float:
    """Return the cost in cells of the straight line between two cells, -1 if it is blocked.

    Raises ValueError for a cell off the grid.
    """
    grid.index(cell)
    grid.index(other)
    cost = kernels.line_cost(grid.blocked, grid.cell_surcharge, grid.corner_cutting, *cell, *other)
    return float(cost)


def path_cost(grid: GridGraph, points: NDArray[np.int32]) -> float:
    """Return the cost in cells of straight segments through `points` [n, 2].

    Raises ValueError if a segment crosses a blocked cell.
    """
    cost = 0.0
    for first, last in pairwise(points.tolist()):
        segment = line_cost(grid, (first[0], first[1]), (last[0], last[1]))
        if segment < 0.0:
            raise ValueError(f'the straight line from cell {first} to {last} is blocked')
        cost += segment
    return cost


def string_pull(grid: GridGraph, path: NDArray[np.int32]) -> AnyAnglePath:
    """Straighten a path [n, 2] of legal moves; the result is never longer and never costs more.

    Every segment is checked against the grid. This is a local improvement: the path stays on the
    same side of each obstacle. Raises ValueError for a path with a blocked or missing step.
    """
    points: NDArray[np.int32] = np.ascontiguousarray(path, dtype=np.int32).reshape(-1, 2)
    if len(points) == 0:
        return AnyAnglePath(points, float('nan'), float('nan'))
    for cell in (points.min(axis=0), points.max(axis=0)):
        grid.index((int(cell[0]), int(cell[1])))
    cost = path_cost(grid, points)
    for _ in range(MAX_ROUNDS):
        points = _pull(grid, add_passed_centres(points))
        points = _pull(grid, add_passed_centres(points[::-1]))[::-1]
        before, cost = cost, path_cost(grid, points)
        if cost > before - _MIN_GAIN:
            break
    length = float(np.hypot(*np.diff(points, axis=0).T.astype(np.float64)).sum())
    return AnyAnglePath(np.ascontiguousarray(points), length, cost)


def interpolate(points: NDArray[np.int32], spacing: float = 1.0) -> NDArray[np.float64]:
    """Return points along straight segments, at most `spacing` cells apart: float64 [m, 2].

    The given points are among them. Raises ValueError for a spacing that is not positive.
    """
    if not spacing > 0.0:
        raise ValueError(f'spacing: {spacing} is not above 0')
    corners = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    if len(corners) < 2:
        return corners
    parts = [corners[:1]]
    for first, last in pairwise(corners):
        count = max(1, int(np.ceil(np.hypot(*(last - first)) / spacing - 1e-9)))
        parts.append(first + (last - first) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(parts)


def add_passed_centres(points: NDArray[np.int32]) -> NDArray[np.int32]:
    """Insert every cell whose centre a segment passes, so that a pull may turn there too."""
    parts = [points[:1]]
    for first, last in pairwise(points):
        count = max(1, int(np.gcd(*np.abs(last - first))))
        parts.append(first + np.arange(1, count + 1)[:, None] * ((last - first) // count))
    return np.ascontiguousarray(np.concatenate(parts), dtype=np.int32)


def _pull(grid: GridGraph, points: NDArray[np.int32]) -> NDArray[np.int32]:
    """Keep only the points at which the path has to turn, seen from its first point on."""
    if len(points) < 3:
        return points
    kept = np.empty(len(points), dtype=np.bool_)
    kernels.string_pull(grid.blocked, grid.cell_surcharge, grid.corner_cutting, points, kept)
    return np.ascontiguousarray(points[kept])
