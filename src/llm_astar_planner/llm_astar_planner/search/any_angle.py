# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Straight lines on a grid: string pulling by the grid's rules, and the paper's lines of sight.

For the latter blocked cells that share a side form a wall without thickness through their centres,
like the paper's barriers; an isolated blocked cell is a point. A line that touches a wall is
blocked. So where a line of sight is free, 8-connected moves that may cut corners can follow it.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Iterator
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from llm_astar_planner.search._kernels import line_of_sight as kernels
from llm_astar_planner.search.arrays import Bools, Float64s, Int32s, Uint8s
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


# Ends of lines up to this many cells from the first are computed in 64 bits.
MOST_CELLS = 1 << 24


class LineOfSightChecker:
    """The walls of one grid; `blocked` is bool [height, width]."""

    def __init__(self, blocked: Bools) -> None:
        """Take a grid."""
        self._padded = np.pad(blocked, 1)

    @cached_property
    def ends(self) -> NDArray[np.intp]:
        """The cells (x, y) at which walls end, [n, 2]."""
        padded = self._padded
        blocked = padded[1:-1, 1:-1]
        lines = np.concatenate([runs_along_rows(blocked), runs_along_rows(blocked.T)[..., ::-1]])
        has_neighbour = padded[:-2, 1:-1] | padded[2:, 1:-1] | padded[1:-1, :-2] | padded[1:-1, 2:]
        isolated = np.argwhere(blocked & ~has_neighbour)[:, ::-1]
        return np.unique(np.concatenate([lines.reshape(-1, 2), isolated]), axis=0)

    def clear(self, begins: ArrayLike, ends: ArrayLike) -> Bools:
        """Tell for each line from `begins` to `ends`, both [n, 2] cells, whether it is free.

        Exact for any finite ends, on the map or off it, between cells too.
        """
        pairs = [np.asarray(points, float).reshape(-1, 2) for points in (begins, ends)]
        lines = np.concatenate(pairs, axis=1)
        if (np.abs(lines) <= MOST_CELLS).all() and (lines == np.rint(lines)).all():
            free: Bools = kernels.lines_are_free(self._padded, lines.astype(np.int64))
            return free
        return np.array([self.is_clear(line) for line in lines.tolist()], dtype=np.bool_)

    def is_clear(self, line: list[float]) -> bool:
        """Tell it for a line with any ends: x and y of both. In Python's unlimited integers."""
        ratios = [number.as_integer_ratio() for number in line]
        scale = max(below for _, below in ratios)
        ends = [above * (scale // below) for above, below in ratios]
        return bool(kernels.line_is_free.py_func(self._padded, *ends, scale))

    def clear_along(self, points: ArrayLike) -> bool:
        """Tell whether the polyline through `points` [n, 2] touches no wall."""
        points = np.asarray(points, dtype=float).reshape(-1, 2)
        if not np.isfinite(points).all():
            return False
        return bool(self.clear(points[:-1], points[1:]).all())


def runs_along_rows(blocked: Bools) -> NDArray[np.intp]:
    """Find the maximal runs of two or more blocked cells in a row: first and last, [n, 2, 2]."""
    change = np.diff(np.pad(blocked, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    ys, firsts = np.nonzero(change == 1)
    lasts = np.nonzero(change == -1)[1] - 1
    runs = np.stack([np.stack([firsts, ys], axis=1), np.stack([lasts, ys], axis=1)], axis=1)
    return runs[lasts > firsts]
