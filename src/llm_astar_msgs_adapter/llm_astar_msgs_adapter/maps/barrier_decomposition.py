"""The road back: an occupancy grid as a short list of straight barriers, for prompts.

Exact on barrier maps, where the barriers found block the very same cells; a summary on others.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap

# Beyond this many cells a side, a summary is made on a coarser lattice: no prompt says more.
MAX_SIDE = 512
# The fewest cells the shorter side keeps when coarsened: fewer no longer show where the ways are.
COARSEST_SIDE = 24


class _Run(NamedTuple):
    """A straight stretch of occupied cells: row y (or column x), from first to last."""

    horizontal: bool
    line: int
    first: int
    last: int

    def cells(self, grid: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return the view of `grid` [height, width] that the run covers."""
        stretch = slice(self.first, self.last + 1)
        return grid[self.line, stretch] if self.horizontal else grid[stretch, self.line]


def decompose_barriers(grid_map: GridMap, limit: int = 30) -> BarrierMap:
    """Describe a map by at most `limit` horizontal and vertical barriers, in cell coordinates.

    The barriers are the longest straight stretches of occupied cells, each next one taken for
    the cells it adds, until all are covered. Where more than `limit` are needed, the map is
    coarsened by 2, 4, ... (a coarse cell is occupied where any of its cells is), which merges
    thick walls and closes gaps of a few cells; once that would lose the map's shape, the longest
    `limit` barriers are taken. The outermost cells are left out: a barrier map has walls there.
    Raises ValueError where `limit` is below 1.
    """
    if limit < 1:
        raise ValueError(f'limit: {limit} is not 1 or more')
    occupied = grid_map.blocked()
    factor = 1
    while max(occupied.shape) > MAX_SIDE * factor:
        factor *= 2
    while True:
        coarse = coarsen(occupied, factor)
        runs, complete = _cover(coarse, limit)
        if complete or min(coarse.shape) < 2 * COARSEST_SIDE:
            break
        factor *= 2
    barriers = [_to_cells(run, factor, occupied.shape) for run in runs]
    return BarrierMap(
        id=0,
        range_x=(0, grid_map.width),
        range_y=(0, grid_map.height),
        horizontal_barriers=tuple(
            sorted(barrier for run, barrier in zip(runs, barriers) if run.horizontal)
        ),
        vertical_barriers=tuple(
            sorted(barrier for run, barrier in zip(runs, barriers) if not run.horizontal)
        ),
    )


def coarsen(occupied: NDArray[np.bool_], factor: int) -> NDArray[np.bool_]:
    """Return which blocks of `factor` x `factor` cells hold any that is set, the last ones cut."""
    if factor == 1:
        return occupied
    height, width = (-(-side // factor) for side in occupied.shape)
    padded = np.zeros((height * factor, width * factor), dtype=np.bool_)
    padded[: occupied.shape[0], : occupied.shape[1]] = occupied
    blocks = padded.reshape(height, factor, width, factor)
    return np.asarray(blocks.any(axis=(1, 3)))


def _cover(occupied: NDArray[np.bool_], limit: int) -> tuple[list[_Run], bool]:
    """Choose up to `limit` runs greedily by the cells they add; tell whether they cover all."""
    missing = occupied.copy()
    missing[[0, -1], :] = False
    missing[:, [0, -1]] = False
    runs = _runs(occupied, horizontal=True) + _runs(occupied, horizontal=False)
    # What a run adds only shrinks, so an old figure is an upper bound: lazy greedy cover.
    queue = [(-int(run.cells(missing).sum()), i) for i, run in enumerate(runs)]
    heapq.heapify(queue)
    chosen: list[_Run] = []
    while queue and len(chosen) < limit:
        _, i = heapq.heappop(queue)
        gain = int(runs[i].cells(missing).sum())
        if gain and queue and -gain > queue[0][0]:
            heapq.heappush(queue, (-gain, i))
        elif gain:
            chosen.append(runs[i])
            runs[i].cells(missing)[:] = False
    return chosen, not missing.any()


def _runs(occupied: NDArray[np.bool_], *, horizontal: bool) -> list[_Run]:
    """Return the maximal stretches of occupied cells along rows or columns."""
    lines = occupied if horizontal else occupied.T
    padded = np.pad(lines, ((0, 0), (1, 1))).astype(np.int8)
    change = np.diff(padded, axis=1)
    line, first = np.nonzero(change == 1)
    _, end = np.nonzero(change == -1)
    return [_Run(horizontal, int(a), int(b), int(c) - 1) for a, b, c in zip(line, first, end)]


def _to_cells(run: _Run, factor: int, shape: tuple[int, ...]) -> Barrier:
    """Turn a run on a coarse lattice into a barrier in cells, along the middle of its band."""
    across, along = shape if run.horizontal else shape[::-1]
    return Barrier(
        min(run.line * factor + factor // 2, across - 1),
        run.first * factor,
        min((run.last + 1) * factor - 1, along - 1),
    )
