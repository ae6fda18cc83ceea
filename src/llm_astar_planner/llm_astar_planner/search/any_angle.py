# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""String pulling: straighten a grid path into segments at any angle, on the same grid rules."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search._kernels import line_of_sight as kernels
from llm_astar_planner.search.arrays import Float64s, Int32s, Uint8s
from llm_astar_planner.search.grid_graph import STEPS, GridGraph
from llm_astar_planner.search.result import Cell

# Cells that lines pass between two looks at the deadline: a few milliseconds.
SLICE = 1 << 20
# The bits, as in `GridGraph.moves`, of all moves and of those of each quadrant; and the number of
# the move by one row or column back, none or on: rows first.
LINE_KINDS = (255, 1 | 2 | 16, 2 | 4 | 32, 4 | 8 | 64, 1 | 8 | 128)
STEP_NUMBERS = np.full((3, 3), 8)
STEP_NUMBERS[tuple(np.array(STEPS).T[::-1] + 1)] = np.arange(8)


class AnyAnglePath(NamedTuple):
    """A path of straight segments at any angle.

    `points` is int32 [n, 2], the cells (x, y) at whose centres it turns. `length` and `cost`
    are in cells; `cost` adds each cell's surcharge times the length inside that cell.
    """

    points: Int32s
    length: float
    cost: float


def can_see(grid: GridGraph, cell: Cell, other: Cell) -> bool:
    """Tell whether the straight line between two cells' centres crosses no blocked cell.

    Where it passes exactly through a corner, both cells next to the corner must be free, unless
    the grid allows corner cutting. Raises ValueError for a cell off the grid.
    """
    grid.index(cell)
    grid.index(other)
    rules = grid.blocked, grid.cell_surcharge, grid.corner_cutting
    return bool(kernels.line_cost(*rules, *cell, *other) >= 0.0)


def straight_path(grid: GridGraph, points: Int32s) -> AnyAnglePath | None:
    """Return the path of straight lines through cells [n, 2], None where one is blocked."""
    rules = grid.blocked, grid.cell_surcharge, grid.corner_cutting
    cost, length, wrong, _ = kernels.path_cost(rules, points)
    return AnyAnglePath(points, length, cost) if wrong < 0 else None


def string_pull(grid: GridGraph, path: Int32s, *, deadline: float = math.inf) -> AnyAnglePath:
    """Straighten a path [n, 2] of legal moves; the result is never longer and never costs more.

    Every segment is checked against the grid. This is a local improvement: the path stays on the
    same side of each obstacle. Raises ValueError for a path with a blocked or missing step, and
    TimeoutError at the `deadline` (monotonic seconds, looked at between slices).
    """
    cells: Int32s = np.ascontiguousarray(path, dtype=np.int32).reshape(-1, 2)
    if len(cells) == 0:
        return AnyAnglePath(cells, math.nan, math.nan)
    rules = grid.blocked, grid.cell_surcharge, grid.corner_cutting
    cost, _, wrong, room = kernels.path_cost(rules, cells)
    if wrong >= 0:
        last: Cell = tuple(cells[wrong].tolist())
        grid.index(last)
        before = cells[max(wrong - 1, 0)].tolist()
        raise ValueError(f'the straight line from cell {before} to {last} is blocked')
    points, centres = (np.empty((room, 2), dtype=np.int32) for _ in range(2))
    points[: len(cells)] = cells
    counts, costs = np.zeros(kernels.COUNTS, dtype=np.int64), np.array([cost, 0.0])
    counts[kernels.POINTS] = len(cells)
    is_done = len(cells) == 1
    while not is_done:
        if time.monotonic() >= deadline:
            raise TimeoutError('the path at any angle is left out: there was no time for it')
        is_done = kernels.string_pull(rules, points, centres, counts, costs, SLICE)
    points = points[: counts[kernels.POINTS]].copy()
    cost, length, _, _ = kernels.path_cost(rules, points)
    return AnyAnglePath(points, length, cost)


def pullable_parts(
    grid: GridGraph, path: Int32s, forbidden: Uint8s
) -> Iterator[tuple[GridGraph, Int32s]]:
    """Cut a path [n, 2] into parts, each with the graph on which it may be pulled.

    Lines between points of a part make moves from cell to cell that rules of the road, `forbidden`
    as in `GridGraph.with_rules`, allow: where these forbid nothing, or moves of one quadrant in
    cells where they forbid none of it. Other moves stay as they are.
    """
    if not forbidden.size or len(path) < 2:
        yield grid, path
        return
    (x, y), steps = path.T, np.diff(path, axis=0) + 1
    moves = 1 << STEP_NUMBERS[steps[:, 1], steps[:, 0]]
    # Of both ends, and the cells beside a diagonal move.
    bits = forbidden[y[:-1], x[:-1]] | forbidden[y[1:], x[1:]]
    bits |= forbidden[y[:-1], x[1:]] | forbidden[y[1:], x[:-1]]
    fits = [(moves & kind != 0) & (bits & kind == 0) for kind in LINE_KINDS]
    graphs = dict[int, GridGraph]()
    first = 0
    while first < len(path) - 1:
        # False, so that each has an end.
        runs = [int(np.append(part[first:], False).argmin()) for part in fits]
        last, number = first + max(runs), runs.index(max(runs))
        if last == first:
            yield grid, path[first : first + 2]
        elif number not in graphs:
            graphs[number] = copy.copy(grid)
            graphs[number].blocked = grid.blocked | (forbidden & LINE_KINDS[number] != 0)
        if last > first:
            yield graphs[number], path[first : last + 1]
        first = max(last, first + 1)


def turning_points(path: Int32s) -> Int32s:
    """Return the first, the last and every cell of a path [n, 2] at which it turns."""
    if len(path) < 3:
        return path
    steps = np.diff(path, axis=0)
    turns = np.any(steps[1:] != steps[:-1], axis=1)
    return np.asarray(path[np.concatenate([[True], turns, [True]])])


def interpolate(points: NDArray[Any], spacing: float = 1.0) -> Float64s:
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
