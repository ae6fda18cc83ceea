"""Jump point search on uniform costs: exact, by scans of 64 cells at a time.

Harabor and Grastien, "Improving jump point search", ICAPS 2014, for grids without corner cutting:
of the many equally short paths only those that make their diagonal moves first are searched, and
only the cells beside which an obstacle has just ended are queued. The cells between are skipped
by looking for set bits in words of 64 cells.
"""

from __future__ import annotations

import math
import time
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
    RUNNING,
)
from llm_astar_planner.search.result import BoundedResult, Cell, SearchStatus
from llm_astar_planner.search.stop import StopFlag

if TYPE_CHECKING:
    from llm_astar_planner.search.grid_graph import GridGraph, Workspace
    from llm_astar_planner.search.landmarks import Landmarks

# Scans between two looks at the stop flag and the clock: below a millisecond.
_SLICE = 1 << 14
_NO_DISTANCES = np.zeros((0, 0), dtype=np.int32)
_NONE_EXPANDED = np.zeros((0, 0), dtype=np.bool_)
_NONE_ACTIVE = np.zeros((0, 2), dtype=np.int64)
_STATUS = {
    FOUND: SearchStatus.FOUND,
    EXHAUSTED: SearchStatus.EXHAUSTED,
    RUNNING: SearchStatus.STOPPED,
}


class PackedGrid:
    """Where a map is blocked and where scans stop, as bits along rows and columns.

    Immutable; about a byte a cell. `blocked_cells` and `jump_points` count; a jump point counts
    once for each of the four directions in which a scan stops there.
    """

    def __init__(self, words: NDArray[np.int64], blocked_cells: int, jump_points: int) -> None:
        """Keep what `build` made."""
        self.words = words
        self.blocked_cells = blocked_cells
        self.jump_points = jump_points

    @classmethod
    def build(cls, blocked: NDArray[np.bool_]) -> PackedGrid:
        """Pack bool [height, width]: half a millisecond per million cells."""
        height, width = blocked.shape
        row_lines, column_lines = (height + 2), (width + 2)
        groups = row_lines * ((width + 65) // 64) + column_lines * ((height + 65) // 64)
        # A map whose cells are all blocked, with a group more at either end, is updated.
        words = np.full(kernels.PLANES * (groups + 2), -1, dtype=np.int64)
        everything = np.array([[0, height, 0, width]])
        return cls(words, blocked.size, 0)._take(blocked, everything)

    def updated(self, blocked: NDArray[np.bool_], windows: NDArray[np.int64]) -> PackedGrid:
        """Return the packed form of `blocked`, which differs in `windows` only.

        `windows` is int [n, 4]: top, bottom, left, right in cells, half open.
        """
        copy = PackedGrid(self.words.copy(), self.blocked_cells, self.jump_points)
        return copy._take(blocked, windows)

    def _take(self, blocked: NDArray[np.bool_], windows: NDArray[np.int64]) -> PackedGrid:
        """Write the windows into this object's words, before anyone else sees it."""
        height, width = blocked.shape
        for top, bottom, left, right in windows.tolist():
            if top >= bottom or left >= right:
                continue
            packed = np.packbits(blocked[top:bottom].reshape(-1), bitorder='little')
            bits = np.zeros(packed.size // 8 + 2, dtype=np.uint64)
            bits.view(np.uint8)[: packed.size] = packed
            window = (top, bottom, left, right)
            more, jumps = kernels.pack_window(bits, height, width, self.words, window)
            self.blocked_cells += more
            self.jump_points += jumps
        return self

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        return self.words.nbytes


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
    if grid.cell_surcharge.size or grid.corner_cutting:
        raise ValueError('a jump point search needs uniform costs and no corner cutting')
    first, last = grid.index(start), grid.index(goal)
    if grid.blocked[start[1], start[0]] or grid.blocked[goal[1], goal[0]]:
        return BoundedResult(SearchStatus.EXHAUSTED, 0, 0, _NONE_EXPANDED)
    distances, active = _NO_DISTANCES, _NONE_ACTIVE
    if landmarks is not None:
        chosen = landmarks.active(grid, start, goal)
        if chosen is None:
            return BoundedResult(SearchStatus.EXHAUSTED, 0, 0, _NONE_EXPANDED)
        distances, active = landmarks.distances, chosen
    control = np.zeros(kernels.J_SIZE, dtype=np.int64)
    control[kernels.J_BEST] = NO_PATH
    heads = np.empty(kernels.BUCKETS, dtype=np.int32)
    words = grid.packed.words
    with grid.workspace() as workspace:
        generation = workspace.next_generation()
        while True:
            status, count, diagonals = kernels.solve(
                grid.moves, words, grid.width, grid.straight, grid.diagonal, first, last,
                distances, active, generation, workspace.records, workspace.pool, heads,
                control, _SLICE, workspace.path,
            )  # fmt: skip
            if status == NEED_SPACE:
                workspace.grow_pool()
            elif status != RUNNING or stop[0] or time.monotonic() >= deadline:
                break
        if status == OVERFLOW:
            raise OverflowError(f'the cost of a path from {start} to {goal} does not fit')
        return _make_result(grid, workspace, control, (status, count, diagonals))


def _make_result(
    grid: GridGraph,
    workspace: Workspace,
    control: NDArray[np.int64],
    ended: tuple[int, int, int],
) -> BoundedResult:
    status, count, diagonals = ended
    expansions, storage = int(control[kernels.J_EXPANSIONS]), int(control[kernels.J_STORAGE])
    if count == 0:
        return BoundedResult(_STATUS[status], expansions, storage, _NONE_EXPANDED)
    path = workspace.path
    if count > len(path):
        path = np.empty((count, 2), dtype=np.int32)
        kernels.trace(grid.width, int(control[kernels.J_GOAL]), workspace.pool, path)
    units = int(control[kernels.J_BEST])
    floor = int(control[kernels.J_ORIGIN] + control[kernels.J_BUCKET]) << kernels.BUCKET_BITS
    bound = units if status == FOUND else min(units, floor)
    return BoundedResult(
        _STATUS[status],
        expansions,
        storage,
        _NONE_EXPANDED,
        path[len(path) - count :].copy(),
        count - 1 - diagonals + diagonals * math.sqrt(2.0),
        cost=units / grid.straight,
        lower_bound=bound / grid.straight,
        suboptimality_bound=units / bound if bound else 1.0,
        first_expansions=expansions,
        first_cost=units / grid.straight,
    )
