"""Jump point search on uniform costs: exact, by scans of 64 cells at a time.

Harabor and Grastien, "Improving jump point search", ICAPS 2014, for grids without corner cutting:
of the many equally short paths only those that make their diagonal moves first are searched, and
only the cells beside which an obstacle has just ended are queued. The cells between are skipped
by looking for set bits in words of 64 cells.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search._kernels import jump as kernels
from llm_astar_planner.search._kernels.astar import (
    EXHAUSTED,
    FOUND,
    NEED_SPACE,
    NO_PATH,
    OVERFLOW,
)
from llm_astar_planner.search.astar import PlainSearch, make_result, run
from llm_astar_planner.search.result import BoundedResult, Cell, SearchStatus
from llm_astar_planner.search.stop import StopFlag

if TYPE_CHECKING:
    from llm_astar_planner.search.grid_graph import GridGraph
    from llm_astar_planner.search.landmarks import Landmarks


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

    @property
    def work(self) -> int:
        """What has been done, in the unit of a quota: scans."""
        return int(self._control[kernels.J_SCANS])

    def advance(self, quota: int) -> None:
        """Scan at least `quota` times; set `status` if that ends the search.

        Raises OverflowError where the cost of a path does not fit the records.
        """
        grid, workspace, control = self.grid, self.workspace, self._control
        ended = kernels.jump_search(
            grid.moves, grid.packed.words, grid.width, grid.straight, grid.diagonal,
            self.start, self.goal, self.distances, self.active, self.generation,
            workspace.records, workspace.pool, self._heads, control, quota,
        )  # fmt: skip
        self.best = int(control[kernels.J_BEST])
        above = int(control[kernels.J_BUCKET]) << kernels.BUCKET_BITS
        floor = int(control[kernels.J_ORIGIN]) + above
        self.bound = max(self.bound, min(floor, self.best))
        self.expansions = int(control[kernels.J_EXPANSIONS])
        self.storage = int(control[kernels.J_STORAGE])
        if ended in (FOUND, EXHAUSTED):
            is_found = self.best < NO_PATH
            self.status = SearchStatus.FOUND if is_found else SearchStatus.EXHAUSTED
            self.bound = self.best
        elif ended == NEED_SPACE:
            workspace.grow_pool()
        elif ended == OVERFLOW:
            raise OverflowError

    def path(self) -> tuple[NDArray[np.int32], float, int]:
        """Return the path found, as single moves, its length in cells and its cost in units."""
        grid, workspace = self.grid, self.workspace
        found = int(self._control[kernels.J_GOAL])
        path = workspace.path
        while True:
            count, diagonals = kernels.trace(grid.width, found, workspace.pool, path)
            if count <= len(path):
                break
            path = np.empty((count, 2), dtype=np.int32)
        straights = count - 1 - diagonals
        units = straights * grid.straight + diagonals * grid.diagonal
        return path[len(path) - count :].copy(), straights + diagonals * math.sqrt(2.0), units


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
    try:
        run(search, stop, deadline)
        return make_result(search, want_expanded=False)
    finally:
        search.close()
