# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Approximates the blocked cells of a grid by at most N straight barriers (greedy cover).

Exact on grids made from barrier maps: the barriers found block the same cells. An approximation
on other grids. Prompts and the embedded waypoint model describe maps by these barriers.
"""

import heapq
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from llm_astar_msgs_adapter.maps.barrier_map import Barrier, BarrierMap

# A grid with more cells a side is coarsened first; a prompt cannot hold more detail.
MAX_SIDE = 512
# The fewest cells the shorter side keeps when coarsened; fewer do not show the passages.
COARSEST_SIDE = 24


class Stretch(NamedTuple):
    """A straight stretch of blocked cells in row (or column) `line`, from first to last."""

    horizontal: bool
    line: int
    first: int
    last: int

    def cells(self, grid: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return the view of `grid` [height, width] that the stretch covers."""
        stretch = slice(self.first, self.last + 1)
        return grid[self.line, stretch] if self.horizontal else grid[stretch, self.line]


def decompose_barriers(blocked: NDArray[np.bool_], limit: int = 30) -> BarrierMap:
    """Describe blocked cells by at most `limit` horizontal and vertical barriers.

    `blocked` is bool [height, width]; barriers are in cell coordinates. The barriers are straight
    stretches of blocked cells, chosen one by one for the most cells not yet covered, until all
    are covered. Where more than `limit` are needed, the grid is coarsened by 2, 4, ..., which
    merges thick walls and closes gaps of a few cells. A grid that cannot be coarsened further
    gets the `limit` barriers that cover most. The outermost cells are left out, because a barrier
    map has walls there. Raises ValueError where `limit` is below 1.
    """
    if limit < 1:
        raise ValueError(f'limit: {limit} is not 1 or more')
    height, width = blocked.shape
    coarse, factor = blocked, 1
    while max(height, width) > MAX_SIDE * factor:
        coarse, factor = halve(coarse), 2 * factor
    while True:
        is_last = min(coarse.shape) < 2 * COARSEST_SIDE
        chosen, complete = cover(coarse, limit, only_all=not is_last)
        if complete or is_last:
            break
        coarse, factor = halve(coarse), 2 * factor
    horizontal, vertical = (
        tuple(sorted(to_barrier(s, factor, blocked.shape) for s in chosen if s.horizontal is kind))
        for kind in (True, False)
    )
    return BarrierMap(0, (0, width), (0, height), horizontal, vertical)


def halve(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return `coarsen(cells, 2)`, ten times as fast."""
    height, width = cells.shape
    padded = np.pad(cells, ((0, height % 2), (0, width % 2)))
    rows = padded[::2] | padded[1::2]
    return np.asarray(rows[:, ::2] | rows[:, 1::2])


def coarsen(cells: NDArray[np.bool_], factor: int, minimum: int = 1) -> NDArray[np.bool_]:
    """Return cells of `factor` x `factor` cells each, set where at least `minimum` of them are.

    The blocks at the far edges may be cut off by the grid's border.
    """
    if factor == 1:
        return cells
    height, width = (-(-side // factor) for side in cells.shape)
    padded = np.zeros((height * factor, width * factor), dtype=np.bool_)
    padded[: cells.shape[0], : cells.shape[1]] = cells
    blocks = padded.reshape(height, factor, width, factor)
    return np.asarray(np.count_nonzero(blocks, axis=(1, 3)) >= minimum)


def cover(
    blocked: NDArray[np.bool_], limit: int, *, only_all: bool = False
) -> tuple[list[Stretch], bool]:
    """Choose up to `limit` stretches, each for the cells it adds; tell whether they cover all.

    With `only_all` none are chosen where it is plain that they could not cover all.
    """
    missing = blocked.copy()
    missing[[0, -1], :] = False
    missing[:, [0, -1]] = False
    found = [stretches(blocked), stretches(blocked.T)]
    counts = np.concatenate([count_cells(missing, found[0]), count_cells(missing.T, found[1])])
    if only_all and np.sort(counts)[-limit:].sum() < np.count_nonzero(missing):
        return [], False
    ends = np.concatenate(found).tolist()
    # What a stretch adds only shrinks, so an old count is an upper bound: lazy greedy cover.
    queue = [(-count, i) for i, count in enumerate(counts.tolist())]
    heapq.heapify(queue)
    chosen: list[Stretch] = []
    while queue and len(chosen) < limit:
        _, i = heapq.heappop(queue)
        stretch = Stretch(i < len(found[0]), *ends[i])
        gain = int(np.count_nonzero(stretch.cells(missing)))
        if gain and queue and -gain > queue[0][0]:
            heapq.heappush(queue, (-gain, i))
        elif gain:
            chosen.append(stretch)
            stretch.cells(missing)[:] = False
    return chosen, not missing.any()


def stretches(blocked: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the longest possible stretches of blocked cells along the rows.

    int64 [n, 3]: the row of each, its first and its last cell.
    """
    padded = np.pad(blocked, ((0, 0), (1, 1))).view(np.int8)
    change = np.diff(padded, axis=1)
    line, first = np.nonzero(change == 1)
    _, end = np.nonzero(change == -1)
    return np.column_stack((line, first, end - 1))


def count_cells(cells: NDArray[np.bool_], stretches: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return how many cells are set in each of the stretches [n, 3] along the rows of `cells`."""
    line, first, last = stretches.T
    before = np.zeros((cells.shape[0], cells.shape[1] + 1), dtype=np.int64)
    np.cumsum(cells, axis=1, out=before[:, 1:])
    return np.asarray(before[line, last + 1] - before[line, first])


def to_barrier(stretch: Stretch, factor: int, shape: tuple[int, ...]) -> Barrier:
    """Turn a stretch of coarse cells into a barrier in cells, along the middle of its band."""
    across, along = shape if stretch.horizontal else shape[::-1]
    return Barrier(
        min(stretch.line * factor + factor // 2, across - 1),
        stretch.first * factor,
        min((stretch.last + 1) * factor - 1, along - 1),
    )
