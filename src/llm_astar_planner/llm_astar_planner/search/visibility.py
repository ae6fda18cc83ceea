# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Lines of sight on a grid: which straight lines between cell centres touch an obstacle.

Blocked cells that share a side form a wall without thickness through their centres, like the
paper's barriers; an isolated blocked cell is a point. A line that touches a wall is blocked. So
where a line of sight is free, 8-connected moves that may cut corners can follow it.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from llm_astar_planner.search._kernels import line_of_sight as kernels
from llm_astar_planner.search.arrays import Bools

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
