# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Landmarks: exact distances from a few far cells, which prove how long a path must be.

For a landmark l the triangle inequality gives d(n, goal) >= |d(l, n) - d(l, goal)|, since a
path costs the same in both directions (ALT: Goldberg and Harrelson, SODA 2005). It holds on the
map that they are measured on and on every map that only blocks more cells or moves or raises
costs: they are measured without rules of the road. So on a map that changes only what becomes
freer or cheaper has to be repaired.
"""

from __future__ import annotations

import threading
import weakref
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from llm_astar_planner.search._kernels.astar import choose_landmarks
from llm_astar_planner.search.arrays import Int32s, Int64s, StopFlag, no_stop
from llm_astar_planner.search.borders import Borders, Crossing
from llm_astar_planner.search.distances import DistanceRows, FreestMap, is_alike
from llm_astar_planner.search.grid_graph import GridGraph

# The number of landmarks on large maps; small maps get more, which cost little there.
COUNT = 8
MAX_COUNT = 32
# More than COUNT landmarks are measured only while they fit in so many bytes.
_SMALL_BYTES = 32 * 1024 * 1024
# Fewer than COUNT, or none, if these would not fit: at 4000 x 4000 cells two take 128 MB, and
# what else is held for the map, 14 bytes a cell, should not be more than doubled.
MAX_BYTES = 64 * 1024 * 1024
# One landmark alone proves little: only what lies on a line with it.
MIN_COUNT = 2
# Where fewer than COUNT fit, and from so many cells on, the borders of tiles lead better.
BORDERS_FROM = 1200 * 1200
# Landmarks that one query uses.
MAX_ACTIVE = 4
# Landmarks are measured anew when so much of the map is stricter than what they were measured on
# that their bounds are weak. Moving obstacles with their inflation cover less: 1 % at 1000 x 1000.
STALE_SHARE = 1 / 8
# Each so many maps, one is compared as a whole, to know how much of it is stricter.
_WHOLE_MAPS = 16
# So many maps at least lie between: measuring costs as much as a hundred repairs.
_STALE_MAPS = 64
# Seconds that `update` waits for searches that use the landmarks, before it leaves the repair to
# the background.
_READERS_WAIT_S = 0.005
NO_DISTANCES = np.zeros((0, 0), dtype=np.int32)
NONE_ACTIVE = np.zeros((0, 2), dtype=np.int64)
NO_WINDOWS = np.zeros((0, 4), dtype=np.int64)


def landmark_count(grid: GridGraph, count: int | None = None, max_bytes: int = MAX_BYTES) -> int:
    """Return how many landmarks to measure on a grid: `count`, or as many as pay, if they fit.

    0 if fewer than MIN_COUNT fit in `max_bytes`.
    """
    row_bytes = 4 * grid.moves.size
    if count is None:
        count = max(COUNT, min(MAX_COUNT, _SMALL_BYTES // row_bytes))
    fitting = min(count, max_bytes // row_bytes)
    return fitting if fitting >= min(MIN_COUNT, count) else 0


def can_measure(grid: GridGraph, count: int | None = None, max_bytes: int = MAX_BYTES) -> bool:
    """Tell whether there is anything to measure on a grid: landmarks, else borders of tiles.

    These serve where costs are graded: on uniform ones the search for jump points needs none.
    """
    return grid.cell_surcharge.size > 0 or landmark_count(grid, count, max_bytes) > 0


class Landmarks:
    """Distances from a few landmarks to every cell of a grid: int32 [count, cells], units.

    Made by `Landmarks.build`, with the `borders` of tiles on large maps. They prove lower
    bounds on that grid and on every grid that only blocks more cells or raises costs; `merge` and
    `repair` make them follow others.
    """

    def __init__(
        self,
        freest: FreestMap,
        distances: Int32s,
        rows: DistanceRows,
        borders: Borders | None = None,
    ) -> None:
        """Keep the `distances` measured on `freest`; -1 where a landmark does not reach a cell."""
        self.distances, self.borders = distances, borders
        self.freest = freest
        self._rows = rows

    @classmethod
    def build(
        cls,
        grid: GridGraph,
        *,
        count: int | None = None,
        max_bytes: int = MAX_BYTES,
        stop: StopFlag | None = None,
    ) -> Landmarks | None:
        """Measure `count` landmarks, each the cell farthest from those before it.

        The default is COUNT, up to MAX_COUNT on small maps; fewer if they would not fit in
        `max_bytes` (4 bytes per cell each). Returns None if fewer than MIN_COUNT fit and no
        borders are needed, no cell is free, `stop` was raised or a distance does not fit 32 bits.
        """
        if not can_measure(grid, count, max_bytes):
            return None
        count = landmark_count(grid, count, max_bytes)
        stop = no_stop() if stop is None else stop
        freest = FreestMap(grid)
        distances = np.empty((count, grid.moves.size), dtype=np.int32)
        rows = DistanceRows(freest, distances)
        nearest = rows.largest_area(stop) if count else None
        for row in range(len(distances)):
            if nearest is None or not rows.fill(row, int(nearest.argmax()), stop):
                return None
            nearest = distances[0].copy() if row == 0 else np.minimum(nearest, distances[row])
        borders = None
        if grid.cell_surcharge.size and (count < COUNT or grid.moves.size >= BORDERS_FROM):
            borders = Borders(freest.cells)
            if not any(borders.measure(borders.every, stop)):
                return None
            # Compiled here in the background, a plan need not wait for what reads them.
            Crossing(borders, grid, (0, 0), (grid.width - 1, grid.height - 1)).targets(1)
        return cls(freest, distances, rows, borders)

    @property
    def count(self) -> int:
        """The number of landmarks."""
        return len(self.distances)

    @property
    def is_stale(self) -> bool:
        """Tell whether others would be better: the map is much stricter now, or mostly new."""
        freest = self.freest
        stricter = freest.stricter > STALE_SHARE * freest.moves.size
        return stricter or freest.new_cells > freest.free

    def active(self, start: int, goal: int, octile: int) -> tuple[Int64s, int]:
        """Choose the landmarks that prove most between two cells, given by number.

        Returns int64 [k, 2], a landmark's row and its distance to the goal, and what a path costs
        at least, all in units: the `octile` distance or more, NO_PATH if there is none.
        """
        active = np.empty((MAX_ACTIVE, 2), dtype=np.int64)
        count, bound = choose_landmarks(self.distances, start, goal, octile, active)
        return active[:count], int(bound)

    def is_admissible_on(self, grid: GridGraph) -> bool:
        """Tell whether the bounds hold on `grid`: no cell was freed and none became cheaper."""
        return is_alike(self.freest, grid) and self.freest.covers(grid)

    def merge(self, grid: GridGraph, windows: Int64s | None = None) -> Int64s:
        """Take in a map like that measured on; return the cells that became freer or cheaper.

        If there are any, `repair` has to be called with them, before anything else is. `windows`
        hold all in which the map differs from the one before, if that is known.
        """
        return self.freest.merge(grid, windows)

    def repair(self, changed: Int64s, stop: StopFlag | None = None) -> Iterator[bool]:
        """Lower the distances to the map that was merged, in steps of a few milliseconds.

        Yields False after each step, True when done. Without a True it was stopped, or a distance
        does not fit 32 bits, and the landmarks are of no more use. No search may read them
        meanwhile.
        """
        stop = no_stop() if stop is None else stop
        steps = [self._rows.repair(changed, stop)]
        if self.borders is not None:
            steps.append(self.borders.repair(changed, stop))
        for repair in steps:
            done = False
            for done in repair:
                if not done:
                    yield False
            if not done:
                return
        yield True


class LandmarkManager:
    """Landmarks for the current map, repaired or built as it changes: thread-safe.

    `update` takes each new map, `lend` hands out the landmarks that are ready for it. What
    became freer is repaired at once if that is little, else in a background thread, in which
    they are also built. Searches do without until they are ready.
    """

    def __init__(self, *, count: int | None = None, max_bytes: int = MAX_BYTES) -> None:
        """Build as `Landmarks.build` does with the same `count` and `max_bytes`."""
        self._count = count
        self._max_bytes = max_bytes
        self._changed = threading.Condition()
        # The newest, of whatever map; a search takes them by `lend`.
        self.current: Landmarks | None = None
        self._newest: GridGraph | None = None
        # In which windows it differs from the map merged last, None if that is not known.
        self._unmerged: list[Int64s] | None = None
        # The maps that the landmarks are known to be admissible on, once repaired.
        self._admitted: weakref.WeakSet[GridGraph] = weakref.WeakSet()
        self._repair: Iterator[bool] | None = None  # begun and not finished
        self._repairing = False  # the background thread is doing so now
        self._readers = 0
        # The map that others are being built on, and the last one tried, which is not kept alive.
        self._building: GridGraph | None = None
        self._tried: weakref.WeakSet[GridGraph] = weakref.WeakSet()
        self._thread: threading.Thread | None = None
        self._stop_build, self._stop_repair = no_stop(), no_stop()
        self._closed = False
        # How many maps there were, at which of them landmarks were measured last, and how often.
        self._maps = self._built_at = self._builds = 0

    def update(self, grid: GridGraph) -> None:
        """Take a new map: a short repair is done now, anything longer is left to the background.

        Waits a few milliseconds at most for searches that use the landmarks.
        """
        grid = grid.without_rules
        with self._changed:
            changes = grid.changes_since(self._newest)
            if self._unmerged is None or changes is None:
                self._unmerged = None
            else:
                self._unmerged.append(changes)
            self._newest = grid
            if self._building is not None and not is_alike(self._building, grid):
                self._stop_build[0] = 1
            self._maps += 1
            if self._repair is None and not self._closed:
                self._follow()
                self._repair_now()
            if self._has_work() and self._thread is None:
                self._thread = threading.Thread(target=self._work, name='landmarks', daemon=True)
                self._thread.start()

    @contextmanager
    def lend(self, grid: GridGraph) -> Iterator[Landmarks | None]:
        """Yield the landmarks that are admissible on `grid`, None while there are none.

        They do not change until the block ends.
        """
        if grid.has_rules:
            grid = grid.without_rules
        with self._changed:
            landmarks = None if self._repair is not None else self.current
            if landmarks is not None and grid not in self._admitted:
                if landmarks.is_admissible_on(grid):
                    self._admitted.add(grid)
                else:
                    landmarks = None
            self._readers += landmarks is not None
        try:
            yield landmarks
        finally:
            if landmarks is not None:
                with self._changed:
                    self._readers -= 1
                    self._changed.notify_all()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait, at most `timeout` seconds, for the background to be idle; tell whether it is.

        Not while landmarks are lent to the same thread: a repair waits until they are returned.
        """
        with self._changed:
            return self._changed.wait_for(lambda: self._thread is None, timeout)

    def close(self) -> None:
        """Stop what runs in the background and release the landmarks, for good."""
        with self._changed:
            self._closed = True
            self.current = self._repair = None
            self._stop_build[0] = self._stop_repair[0] = 1
            self._changed.notify_all()
        self.wait()

    def values(self) -> dict[str, int]:
        """Return what /diagnostics says: how many there are, and how often they were measured."""
        with self._changed:
            count = 0 if self.current is None else self.current.count
            return {'landmarks': count, 'landmark_builds': self._builds}

    def _has_work(self) -> bool:
        """Tell whether there is something to do for the background."""
        if self._closed or self._newest is None:
            return False
        if self._repair is not None:
            return True
        if self.current is None or self._is_stale():
            fits = can_measure(self._newest, self._count, self._max_bytes)
            return fits and self._newest not in self._tried
        return self._newest not in self._admitted

    def _is_stale(self) -> bool:
        """Tell whether others should be measured now."""
        stale = self.current is not None and self.current.is_stale
        return stale and self._maps - self._built_at > _STALE_MAPS

    def _follow(self) -> None:
        """Merge the newest map; begin a repair if it is freer, drop landmarks of another kind."""
        grid, landmarks = self._newest, self.current
        if landmarks is None or grid is None:
            return
        if not is_alike(landmarks.freest, grid):
            self.current = None
            return
        is_whole = self._unmerged is None or self._maps % _WHOLE_MAPS == 0
        windows = None if is_whole else np.concatenate([NO_WINDOWS, *(self._unmerged or [])])
        changed, self._unmerged = landmarks.merge(grid, windows), []
        self._admitted.add(grid)
        if changed.size:
            self._repair = landmarks.repair(changed, self._stop_repair)

    def _repair_now(self) -> None:
        """Do the first step of a repair if no search uses the landmarks."""
        repair = self._repair
        if repair is None:
            return
        self._changed.wait_for(lambda: not self._readers or self._closed, _READERS_WAIT_S)
        # The lock was free: it may be done, given up or being done by now.
        is_free = self._repair is repair and not (self._readers or self._repairing)
        if is_free and next(repair, False):
            self._repair = None

    def _work(self) -> None:
        """Do in the background what there is to do, until there is nothing."""
        with self._changed:
            while self._newest is not None and self._has_work():
                if self._repair is not None:
                    self._finish_repair(self._repair)
                elif self.current is None or self._is_stale():
                    self._build(self._newest)
                else:
                    self._follow()
            self._thread = None
            self._changed.notify_all()

    def _finish_repair(self, repair: Iterator[bool]) -> None:
        """Do the rest of a repair, once no search uses the landmarks."""
        self._changed.wait_for(lambda: not self._readers or self._closed)
        if self._repair is not repair:
            return
        self._repairing = True
        self._changed.release()
        try:
            done = any(repair)
        finally:
            self._changed.acquire()
            self._repairing = False
        if self._repair is repair:
            self._repair = None
            if not done:
                self.current = None

    def _build(self, grid: GridGraph) -> None:
        """Measure new landmarks; those there are serve until the new ones replace them."""
        self._building, self._tried = grid, weakref.WeakSet((grid,))
        stop = self._stop_build = no_stop()
        self._changed.release()
        try:
            landmarks = Landmarks.build(
                grid, count=self._count, max_bytes=self._max_bytes, stop=stop
            )
        finally:
            self._changed.acquire()
        self._builds += 1
        self._built_at = self._maps
        self._building = None
        if stop[0]:
            self._tried.clear()
        elif landmarks is not None:
            self.current, self._repair, self._unmerged = landmarks, None, None
            self._admitted = weakref.WeakSet((grid,))
