# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Exact distances from single cells to all others, and their repair when a map becomes freer."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

import numpy as np

from llm_astar_planner.search._kernels import astar as shared
from llm_astar_planner.search._kernels import distances as kernels
from llm_astar_planner.search.arrays import Int32s, Int64s, StopFlag
from llm_astar_planner.search.grid_graph import GridGraph, whole
from llm_astar_planner.search.kernel_cache import INTERPRETED

# Cells that one step of a repair expands: about 2 ms.
REPAIR_STEP = 1 << 14
# Cells measured between two looks at the deadline: about 30 ms.
FILL_STEP = 1 << 18
# Cells tried as the first source, to find the largest connected area.
_SEEDS = 8
# A group of blocked cells up to this size that loses some is taken for a moving obstacle: 2 m^2 at
# 0.05 m. Else as much would have to be repaired at each map until it has left its place.
ISOLATED_CELLS = 800


class FreestMap:
    """Each move that was legal on any of the maps merged into it, at its least cost on them.

    Obstacles that move are left out altogether.
    """

    def __init__(self, grid: GridGraph) -> None:
        """Start with one map: copies its moves and surcharges."""
        self.moves, self.cell_surcharge = grid.moves.copy(), grid.cell_surcharge.copy()
        self.cells = grid.cells._replace(moves=self.moves, cell_surcharge=self.cell_surcharge)
        self.width, self.straight, self.diagonal = self.cells[2:]
        self.ring = grid.ring
        self.free = int(np.count_nonzero(self.moves))
        # Cells that were free on none of the earlier maps, over all merges.
        self.new_cells = 0
        # Cells that were stricter than here on the last map that was merged as a whole.
        self.stricter = 0

    def covers(self, grid: GridGraph) -> bool:
        """Tell whether no move of `grid`, a map like this, is missing here or costs less there."""
        if (grid.moves & ~self.moves).any():
            return False
        cheaper = grid.cell_surcharge < self.cell_surcharge
        return not (cheaper & (grid.moves[: cheaper.size] != 0)).any()

    def merge(self, grid: GridGraph, windows: Int64s | None = None) -> Int64s:
        """Merge a map like this; return the numbers of the cells that became freer or cheaper.

        `windows` hold all in which it differs from the map merged before, if that is known.
        """
        changed = np.empty(self.moves.size, dtype=np.int64)
        merged = whole(grid.blocked.shape) if windows is None else windows
        freed, cheaper, stricter = kernels.merge_freer(grid.cells, self.cells, merged, changed)
        self.stricter = stricter if windows is None else self.stricter
        self.ring = max(self.ring, grid.ring)
        self.new_cells += freed
        parts = [changed[:freed].copy(), changed[changed.size - cheaper :].copy()]
        if freed:
            marks = np.zeros(self.moves.size, dtype=np.uint8)
            # Obstacles side by side may have cells around them in common.
            changed = np.empty(6 * self.moves.size, dtype=np.int64)
            count = kernels.free_isolated(self.cells, ISOLATED_CELLS, parts[0], marks, changed)
            parts.append(changed[:count])
        return np.concatenate(parts)


def is_alike(one: GridGraph | FreestMap, other: GridGraph) -> bool:
    """Tell whether two maps have the same size and units and both or neither graded costs."""
    sizes, other_sizes = ((len(it.moves), len(it.cell_surcharge)) for it in (one, other))
    return sizes == other_sizes and one.cells[2:] == other.cells[2:]


def relaxed(cells: shared.Cells, source: int) -> Int64s:
    """Return the distance of each cell from a source, -1 where there is no way: `fill` in numpy.

    For uniform costs. All cells look at their neighbours, until none is nearer: on small maps a
    tenth of the time of the kernel where that is Python.
    """
    moves, _, width, straight, diagonal = cells
    here, offsets = np.arange(moves.size), shared.STEP_Y * width + shared.STEP_X
    others = np.where(moves >> np.arange(8)[:, None] & 1, here + offsets[:, None], here)
    costs = np.repeat([straight, diagonal], 4)[:, None]
    distances = np.full(moves.size, shared.NO_PATH)
    distances[source], before = 0, np.empty(0)
    while not np.array_equal(before, distances):
        before = distances
        distances = np.minimum(before, (before[others] + costs).min(axis=0))
    return np.where(distances == shared.NO_PATH, -1, distances)


class DistanceRows:
    """Rows of distances on a `FreestMap`: Dijkstra's algorithm from single cells, and repairs."""

    def __init__(self, freest: FreestMap, distances: Int32s) -> None:
        """Work on `distances`, int32 [count, cells], in units, -1: not reached."""
        self._map = freest
        self._distances = distances
        self._pool = np.empty(1 << 14, dtype=np.int64)
        self._clear()

    def fill(self, row: int, source: int, stop: StopFlag, deadline: float = math.inf) -> bool:
        """Measure a row from the cell `source`; False: stopped, out of time or beyond 32 bits.

        The map must be that of a single grid: superfluous moves are left out.
        """
        if INTERPRETED and not self._map.cell_surcharge.size:
            self._distances[row] = relaxed(self._map.cells, source)
            return True
        self._distances[row] = -1
        self._distances[row, source] = 0
        self._clear()
        seeds, status = np.array([source]), shared.RUNNING
        while status == shared.RUNNING and time.monotonic() < deadline:
            status = self._propagate(row, seeds, True, FILL_STEP, stop)
        return status == shared.FOUND

    def largest_area(self, stop: StopFlag) -> Int32s | None:
        """Measure from a cell in the largest connected area that a few tries find, into row 0.

        Returns a copy of the row; None if it was stopped or no cell is free.
        """
        free = np.flatnonzero(self._map.moves)
        best: Int32s | None = None
        most = 0
        for source in free[:: max(1, free.size // _SEEDS)]:
            if not self.fill(0, int(source), stop):
                return None
            reached = int(np.count_nonzero(self._distances[0] >= 0))
            if reached > most:
                most, best = reached, self._distances[0].copy()
            if 2 * most > free.size:
                break
        return best

    def repair(self, changed: Int64s, stop: StopFlag) -> Iterator[bool]:
        """Make all rows exact again after `FreestMap.merge` returned `changed`.

        Yields False after each step of at most REPAIR_STEP cells, True at the end. If it ends
        without, it was stopped or a distance is beyond 32 bits.
        """
        seeds = np.empty(9 * changed.size, dtype=np.int64)
        left = REPAIR_STEP
        for row, distances in enumerate(self._distances):
            left -= changed.size
            if left <= 0:
                yield False
                left = REPAIR_STEP
            count = kernels.find_seeds(self._map.cells, changed, distances, seeds)
            self._clear()
            while True:
                expanded = self._control[kernels.D_EXPANDED]
                status = self._propagate(row, seeds[:count], False, left, stop)
                left -= int(self._control[kernels.D_EXPANDED] - expanded)
                if status != shared.RUNNING:
                    break
                yield False
                left = REPAIR_STEP
            if status != shared.FOUND:
                return
        yield True

    def _clear(self) -> None:
        """Empty the queue."""
        self._heads = np.zeros(self._map.ring, dtype=np.int32)
        self._control = np.zeros(kernels.D_SIZE, dtype=np.int64)

    def _propagate(self, row: int, seeds: Int64s, single: bool, quota: int, stop: StopFlag) -> int:
        """Call the kernel, with a longer pool when it needs one; return how it ended."""
        while True:
            status = kernels.propagate(
                self._map.cells, single, seeds, self._distances[row], self._pool,
                self._heads, self._control, quota, stop,
            )  # fmt: skip
            if status != shared.NEED_SPACE:
                return int(status)
            self._pool = np.concatenate((self._pool, np.empty_like(self._pool)))
