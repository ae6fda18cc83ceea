"""The any-angle finish: a path's cells pulled taut along lines of sight on the same grid rule."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search._kernels import line_of_sight as kernels
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.result import Cell

# A path is pulled from both ends in turn until nothing changes, or this often.
_MOST_PULLS = 8
_LEAST_GAIN = 1e-9


class AnyAnglePath(NamedTuple):
    """A path of straight legs at any angle.

    `points` is int32 [n, 2], the cells (x, y) whose centres are its turns. `length` and `cost`
    are in cells; `cost` counts each cell's surcharge for the length inside it.
    """

    points: NDArray[np.int32]
    length: float
    cost: float


def can_see(grid: GridGraph, cell: Cell, other: Cell) -> bool:
    """Tell whether the straight way between two cells' centres crosses no blocked cell.

    Where it crosses exactly a corner both cells beside it must be free, unless the grid lets
    corners be cut. Raises ValueError for a cell off the grid.
    """
    return _cost(grid, cell, other) >= 0.0


def shorten(grid: GridGraph, path: NDArray[np.int32]) -> AnyAnglePath:
    """Pull a path [n, 2] of legal moves taut: never longer and, by its own cost, never dearer.

    Every leg is checked against the grid. It is a local finish: corners stay on the same side
    of each obstacle. Raises ValueError for a path that is not on free cells or not joined.
    """
    points: NDArray[np.int32] = np.ascontiguousarray(path, dtype=np.int32).reshape(-1, 2)
    if len(points) == 0:
        return AnyAnglePath(points, float('nan'), float('nan'))
    for cell in (points.min(axis=0), points.max(axis=0)):
        grid.index((int(cell[0]), int(cell[1])))
    cost = float(sum(_legs(grid, points)))
    for _ in range(_MOST_PULLS):
        points = _pull(grid, _filled(points))
        points = _pull(grid, _filled(points[::-1]))[::-1]
        before, cost = cost, float(sum(_legs(grid, points)))
        if cost > before - _LEAST_GAIN:
            break
    length = float(np.hypot(*np.diff(points, axis=0).T.astype(np.float64)).sum())
    return AnyAnglePath(np.ascontiguousarray(points), length, cost)


def interpolate(points: NDArray[np.int32], spacing: float = 1.0) -> NDArray[np.float64]:
    """Return points along straight legs, at most `spacing` cells apart: float64 [m, 2].

    The turns themselves are among them. Raises ValueError for a spacing that is not positive.
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


def _filled(points: NDArray[np.int32]) -> NDArray[np.int32]:
    """Put back the cells whose centres lie on the legs, for a pull from the other end."""
    parts = [points[:1]]
    for first, last in pairwise(points):
        count = max(1, int(np.gcd(*np.abs(last - first))))
        parts.append(first + np.arange(1, count + 1)[:, None] * ((last - first) // count))
    return np.ascontiguousarray(np.concatenate(parts), dtype=np.int32)


def _pull(grid: GridGraph, points: NDArray[np.int32]) -> NDArray[np.int32]:
    kept = np.empty(len(points), dtype=np.bool_)
    if len(points) < 3:
        return points
    kernels.pull_taut(grid.blocked, grid.price, grid.corner_cutting, points, kept)
    return np.ascontiguousarray(points[kept])


def _legs(grid: GridGraph, points: NDArray[np.int32]) -> list[float]:
    """Return the cost of each leg. Raises ValueError where one is barred."""
    costs: list[float] = []
    for first, last in zip(points.tolist(), points[1:].tolist()):
        cost = _cost(grid, (first[0], first[1]), (last[0], last[1]))
        if cost < 0.0:
            raise ValueError(f'the way from cell {first} to {last} is barred')
        costs.append(cost)
    return costs


def _cost(grid: GridGraph, cell: Cell, other: Cell) -> float:
    grid.index(cell)
    grid.index(other)
    return float(kernels.sight(grid.blocked, grid.price, grid.corner_cutting, *cell, *other))
