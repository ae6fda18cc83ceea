"""Landmarks: exact distances to a few far cells, which prove how long a path must be.

For a landmark l the triangle inequality gives d(n, goal) >= |d(l, n) - d(l, goal)|, since a
path costs the same both ways (ALT: Goldberg and Harrelson, SODA 2005).
"""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search._kernels import astar as kernels
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.result import Cell

# Eight landmarks do on large maps; small maps get more, which cost them next to nothing.
COUNT = 8
MOST = 32
_CHEAP_BYTES = 64 * 1024 * 1024
MAX_ACTIVE = 4
MAX_BYTES = 256 * 1024 * 1024
_SEEDS = 8
_NEVER = np.zeros(1, dtype=np.uint8)
NO_MARKS = np.zeros((0, 0), dtype=np.int32)
NONE_ACTIVE = np.zeros((0, 2), dtype=np.int64)


class Landmarks:
    """Distances from a few landmarks to every cell of a grid: int32 [cells, landmarks], units.

    Made by `Landmarks.build`. They prove lower bounds on that grid and on every grid that only
    blocks more cells or raises costs.
    """

    def __init__(self, grid: GridGraph, marks: NDArray[np.int32]) -> None:
        """Keep the distances `marks` measured on `grid`; -1 where a landmark does not reach."""
        self.marks = marks
        self._blocked = grid.blocked
        self._price = grid.price
        self._units = (grid.straight, grid.diagonal)
        self._corner_cutting = grid.corner_cutting

    @classmethod
    def build(
        cls,
        grid: GridGraph,
        *,
        count: int | None = None,
        max_bytes: int = MAX_BYTES,
        stop: NDArray[np.uint8] | None = None,
    ) -> Landmarks | None:
        """Measure `count` landmarks, each the cell farthest from those before it.

        Without a `count`: COUNT, up to MOST on small maps. Fewer where they would not fit
        `max_bytes` (4 bytes a cell each). None where not one fits, no cell is free, `stop` was
        raised or a distance does not fit 32 bits.
        """
        cell_bytes = 4 * grid.moves.size
        wanted = max(COUNT, min(MOST, _CHEAP_BYTES // cell_bytes)) if count is None else count
        count = min(wanted, max_bytes // cell_bytes)
        free = np.flatnonzero(grid.moves)
        if count < 1 or free.size == 0:
            return None
        marks = np.empty((grid.moves.size, count), dtype=np.int32)
        measure = _Measure(grid, _NEVER if stop is None else stop)
        nearest = measure.first(free, marks)
        if nearest is None:
            return None
        for column in range(count):
            source = int(nearest.argmax())
            if not measure.column(source, column, marks):
                return None
            reached = marks[:, column]
            nearest = reached.copy() if column == 0 else np.minimum(nearest, reached)
        return cls(grid, marks)

    @property
    def count(self) -> int:
        """How many landmarks there are."""
        return int(self.marks.shape[1])

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        return self.marks.nbytes

    def active(self, grid: GridGraph, start: Cell, goal: Cell) -> NDArray[np.int64] | None:
        """Choose the landmarks that prove most for a query.

        Returns int64 [k, 2]: a landmark's column and its distance to the goal, in units.
        None where they prove that no path joins the cells.
        """
        first = self.marks[grid.index(start)].astype(np.int64)
        last = self.marks[grid.index(goal)].astype(np.int64)
        if ((first < 0) != (last < 0)).any():
            return None
        gaps = np.where(last < 0, 0, np.abs(first - last))
        best = np.argsort(-gaps, kind='stable')[:MAX_ACTIVE]
        best = best[gaps[best] > 0]
        return np.column_stack((best, last[best])).astype(np.int64)

    def lower_bound(self, grid: GridGraph, start: Cell, goal: Cell) -> float:
        """Return a cost, in cells, that no path between the cells can be under; inf: no path."""
        active = self.active(grid, start, goal)
        if active is None:
            return float('inf')
        gaps = np.abs(self.marks[grid.index(start), active[:, 0]] - active[:, 1])
        return float(gaps.max(initial=0)) / self._units[0]

    def hold_on(self, grid: GridGraph) -> bool:
        """Tell whether the bounds hold on `grid`: nothing was freed and nothing became cheaper."""
        if grid.blocked is self._blocked and grid.price is self._price:
            return self._units == (grid.straight, grid.diagonal)
        return (
            grid.blocked.shape == self._blocked.shape
            and self._units == (grid.straight, grid.diagonal)
            and (self._corner_cutting or not grid.corner_cutting)
            and not bool((self._blocked & ~grid.blocked).any())
            and (
                self._price.size == 0
                or (grid.price.size > 0 and bool((grid.price >= self._price).all()))
            )
        )


class LandmarkManager:
    """Landmarks for the current map, built in the background: thread-safe.

    `update` takes each new map; `current` returns what is ready for it. Landmarks stay while
    cells only become blocked or dearer and are built anew when some are freed.
    """

    def __init__(self, *, count: int | None = None, max_bytes: int = MAX_BYTES) -> None:
        """Build as `Landmarks.build` does with the same `count` and `max_bytes`."""
        self._count = count
        self._max_bytes = max_bytes
        self._lock = threading.Lock()
        self._landmarks: Landmarks | None = None
        self._grid: GridGraph | None = None  # the last map they were found to hold on
        self._thread: threading.Thread | None = None
        self._stop = np.zeros(1, dtype=np.uint8)

    @property
    def nbytes(self) -> int:
        """Bytes the landmarks hold now."""
        landmarks = self._landmarks
        return 0 if landmarks is None else landmarks.nbytes

    def update(self, grid: GridGraph) -> None:
        """Take a new map: keep the landmarks where they hold, else start building others."""
        with self._lock:
            if self._landmarks is not None and self._landmarks.hold_on(grid):
                self._grid = grid
                return
            self._landmarks = None
            self._stop[0] = 1
            stop = self._stop = np.zeros(1, dtype=np.uint8)
            self._thread = threading.Thread(
                target=self._build, args=(grid, stop), name='landmarks', daemon=True
            )
            self._thread.start()

    def current(self, grid: GridGraph) -> Landmarks | None:
        """Return the landmarks that hold on `grid`, None while there are none."""
        with self._lock:
            if self._landmarks is None or self._grid is grid:
                return self._landmarks
            if not self._landmarks.hold_on(grid):
                return None
            self._grid = grid
            return self._landmarks

    def wait(self, timeout: float | None = None) -> bool:
        """Wait, at most `timeout` seconds, for the building to end; tell whether it has."""
        thread = self._thread
        if thread is None:
            return True
        thread.join(timeout)
        return not thread.is_alive()

    def close(self) -> None:
        """Stop building and let go of the landmarks."""
        with self._lock:
            self._stop[0] = 1
            self._landmarks = None
        self.wait()

    def _build(self, grid: GridGraph, stop: NDArray[np.uint8]) -> None:
        landmarks = Landmarks.build(grid, count=self._count, max_bytes=self._max_bytes, stop=stop)
        with self._lock:
            if stop[0] == 0:
                self._landmarks = landmarks
                self._grid = grid


class _Measure:
    """Runs of Dijkstra's algorithm over one grid, sharing their queue."""

    def __init__(self, grid: GridGraph, stop: NDArray[np.uint8]) -> None:
        self.grid = grid
        self.stop = stop
        self.pool = np.empty(1 << 14, dtype=np.int64)
        self.heads = np.zeros(grid.ring, dtype=np.int32)

    def column(self, source: int, column: int, marks: NDArray[np.int32]) -> bool:
        """Fill a column with the distances from `source`; False where it was stopped."""
        grid = self.grid
        while True:
            status = kernels.distances(
                grid.moves,
                grid.price,
                grid.width,
                grid.straight,
                grid.diagonal,
                source,
                column,
                marks,
                self.pool,
                self.heads,
                self.stop,
            )
            if status != kernels.NEED_SPACE:
                return bool(status == kernels.FOUND)
            self.pool = np.empty(2 * self.pool.size, dtype=np.int64)

    def first(self, free: NDArray[np.int64], marks: NDArray[np.int32]) -> NDArray[np.int32] | None:
        """Return the distances from a cell of the largest area that a few tries meet."""
        best: NDArray[np.int32] | None = None
        most = 0
        for source in free[:: max(1, free.size // _SEEDS)]:
            if not self.column(int(source), 0, marks):
                return None
            reached = int(np.count_nonzero(marks[:, 0] >= 0))
            if reached > most:
                most, best = reached, marks[:, 0].copy()
            if 2 * most > free.size:
                break
        return best
