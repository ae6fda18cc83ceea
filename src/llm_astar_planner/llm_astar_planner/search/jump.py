# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Jump point search on uniform costs: exact, by scans of 64 cells at a time.

Harabor and Grastien, "Improving jump point search", ICAPS 2014, for grids without corner cutting:
of the many equally short paths only those that make their diagonal moves first are searched, and
only the cells beside which an obstacle has just ended are queued. The cells between are skipped
by looking for set bits in words of 64 cells.
"""

from __future__ import annotations

import math

import numpy as np

from llm_astar_planner.search._kernels import jump as kernels
from llm_astar_planner.search._kernels.astar import EXHAUSTED, FOUND, NO_PATH
from llm_astar_planner.search.arrays import Int32s, StopFlag
from llm_astar_planner.search.astar import PlainSearch, complete
from llm_astar_planner.search.grid_graph import GridGraph, traced
from llm_astar_planner.search.landmarks import Landmarks
from llm_astar_planner.search.result import BoundedResult, Cell


class JumpSearch(PlainSearch):
    """An exact jump point search that runs in slices.

    For grids of uniform costs without corner cutting. `expansions` counts the jump points taken
    from the queue.
    """

    BEST_SLOT = kernels.J_BEST

    def __init__(
        self, grid: GridGraph, start: Cell, goal: Cell, landmarks: Landmarks | None = None
    ) -> None:
        """Take the query. Raises ValueError for a cell off the grid or another kind of grid."""
        if grid.cell_surcharge.size or grid.corner_cutting:
            raise ValueError('a jump point search needs uniform costs and no corner cutting')
        super().__init__(grid, start, goal, landmarks)
        self._control = np.zeros(kernels.J_SIZE, dtype=np.int64)
        self._control[self.BEST_SLOT] = NO_PATH
        self._heads = np.empty(kernels.BUCKETS, dtype=np.int32)
        self._found = 0

    def advance(self, quota: int) -> None:
        """Scan at least `quota` times; see `PlainSearch.advance`."""
        workspace, control = self.workspace, self._control
        ended = kernels.jump_search(
            self._cells, self.grid.packed.words,
            self.start, self.goal, self.distances, self.active, self.generation,
            workspace.records, workspace.pool, self._heads, control, quota,
        )  # fmt: skip
        _, origin, bucket, self.best, self.expansions, *others = control.tolist()
        self.storage, self._found, self.work, _ = others
        self.bound = max(self.bound, min(origin + (bucket << kernels.BUCKET_BITS), self.best))
        if ended in (FOUND, EXHAUSTED):
            ended = FOUND if self.best < NO_PATH else EXHAUSTED
            self.bound = self.best
        self.note(ended)

    def path(self) -> tuple[Int32s, float, int]:
        """Return the path found, as single moves, its length in cells and its cost in units."""
        grid = self.grid
        path, (diagonals,) = traced(kernels.trace, grid.width, self._found, self.workspace.pool)
        straights = len(path) - 1 - diagonals
        units = straights * grid.straight + diagonals * grid.diagonal
        return path, straights + diagonals * math.sqrt(2.0), units


def jump_search(
    grid: GridGraph,
    start: Cell,
    goal: Cell,
    *,
    stop: StopFlag,
    deadline: float = math.inf,
    landmarks: Landmarks | None = None,
) -> BoundedResult:
    """Find a shortest path on a grid of uniform costs without corner cutting.

    `deadline` is in monotonic seconds; after it or once `stop` is raised the status is STOPPED,
    with the best path found so far, if any. `landmarks` must be admissible on `grid`.
    `expansions` counts the jump points taken from the queue. Raises ValueError for a cell off the
    grid, graded costs or corner cutting, and OverflowError if the cost of a path does not fit
    its 32 bits (beyond 900 thousand cells).
    """
    search = JumpSearch(grid, start, goal, landmarks)
    return complete(search, stop, (deadline, deadline), want_expanded=False)
