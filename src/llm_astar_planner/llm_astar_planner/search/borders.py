# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Distances between the borders of large tiles, which bound what a path costs and lead to one.

A path that crosses a border goes on within the two tiles at it until it crosses one of the six
borders around them. What that costs at least is measured, so a cheapest route over the borders
costs no more than any path, and the tiles at it hold a good one (docs/guided-search.md).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from llm_astar_planner.search._kernels import borders as kernels
from llm_astar_planner.search._kernels.astar import NO_PATH, Cells
from llm_astar_planner.search.arrays import Int64s, StopFlag
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.result import Cell

# Borders measured between two looks at the stop flag: about 2 ms.
_STEP = 4


class Borders:
    """Distances between the parts of tiles' borders on graded costs: uint16, 3.4 bytes a cell.

    They bound paths on the map that was measured and on all that are stricter. Searches may read
    them at once, but not while they are measured.
    """

    def __init__(self, cells: Cells) -> None:
        """Take the cells, whose arrays may become freer; `measure` or `repair` has to follow."""
        self._cells = cells
        self.columns = (cells.width - 1 >> kernels.SIDE_BITS) + 1
        height = cells.moves.size // cells.width
        count = 2 * ((height - 1 >> kernels.SIDE_BITS) + 1) * self.columns
        self.rows = np.empty((count, kernels.PARTS, 6 * kernels.PARTS), dtype=np.uint16)

    @property
    def every(self) -> Int64s:
        """The numbers of all borders."""
        return np.arange(len(self.rows))

    def measure(self, borders: Int64s, stop: StopFlag) -> Iterator[bool]:
        """Measure borders by number; yields False after each 2 ms, True at the end."""
        tiles = borders >> 1
        inner = np.where(borders & 1, tiles % self.columns, tiles // self.columns) > 0
        borders = borders[inner & (borders < len(self.rows))]
        for begin in range(0, len(borders), _STEP):
            if stop[0]:
                return
            kernels.measure(self._cells, borders[begin : begin + _STEP], self.rows)
            yield False
        yield True

    def repair(self, changed: Int64s, stop: StopFlag) -> Iterator[bool]:
        """Measure again what lies at the changed cells, given by number; see `measure`."""
        y, x = changed // self._cells.width, changed % self._cells.width
        # A cell on a border is part of the tiles on either side.
        tiles = np.unique([
            np.maximum(y - down, 0) // kernels.SIDE * self.columns
            + np.maximum(x - right, 0) // kernels.SIDE
            for down in (0, 1) for right in (0, 1)
        ])  # fmt: skip
        around = (2 * tiles, 2 * tiles + 1, 2 * (tiles + self.columns), 2 * tiles + 3)
        return self.measure(np.unique(np.concatenate(around)), stop)


class Crossing:
    """The cheapest route over borders between two cells that are two tiles apart.

    `lower_bound` is what every path costs at least, in units, NO_PATH if there is none.
    """

    def __init__(self, borders: Borders, grid: GridGraph, start: Cell, goal: Cell) -> None:
        """Measure from both cells to the borders of their tiles, without rules of the road."""
        grid = grid.without_rules
        cells = grid.index(start), grid.index(goal)
        ends = np.empty((2, 4, kernels.PARTS), dtype=np.int64)
        for cell, distances in zip(cells, ends):
            kernels.reach_borders(grid.cells, cell, distances)
        kernels.close_ends(ends[0], grid.straight)
        self._cells, self._goal = grid.cells, cells[1]
        self._costs = np.empty(borders.rows.shape[:2], dtype=np.int32)
        self._parents = np.empty_like(self._costs)
        steps, self._last = kernels.route(
            grid.cells, borders.rows, *cells, *ends, self._costs, self._parents
        )
        self.lower_bound = steps << kernels.STEP_BITS if self._last >= 0 else NO_PATH

    def targets(self, most: int) -> Int64s:
        """Return at most so many cells at which the route crosses borders, and the goal.

        Int64 [n, 4], as the kernel of the guided search takes them.
        """
        targets: Int64s = kernels.route_targets(
            self._cells, self._goal, self._last, self._costs, self._parents, most
        )
        return targets


def is_far(start: Cell, goal: Cell) -> bool:
    """Tell whether routes over borders join two cells: they are two tiles apart."""
    return max(abs(start[0] - goal[0]), abs(start[1] - goal[1])) >= 2 * kernels.SIDE
