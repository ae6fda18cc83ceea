"""Landmarks: exact distances from a few far cells, which prove how long a path must be.

For a landmark l the triangle inequality gives d(n, goal) >= |d(l, n) - d(l, goal)|, since a
path costs the same in both directions (ALT: Goldberg and Harrelson, SODA 2005).
"""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.search._kernels import astar as search_kernels
from llm_astar_planner.search._kernels import distances as kernels
from llm_astar_planner.search.grid_graph import GridGraph
from llm_astar_planner.search.result import Cell
from llm_astar_planner.search.stop import StopFlag, no_stop

# The number of landmarks on large maps; small maps get more, which cost little there.
COUNT = 8
MAX_COUNT = 32
MAX_BYTES = 256 * 1024 * 1024
# More than COUNT landmarks are measured only while they fit in so many bytes.
_SMALL_BYTES = 64 * 1024 * 1024
# Landmarks that one query uses.
MAX_ACTIVE = 4
# Cells tried as the first source, to find the largest connected area.
_SEEDS = 8
NO_DISTANCES = np.zeros((0, 0), dtype=np.int32)
NONE_ACTIVE = np.zeros((0, 2), dtype=np.int64)


class Landmarks:
    """Distances from a few landmarks to every cell of a grid: int32 [count, cells], units.

    Made by `Landmarks.build`. They prove lower bounds on that grid and on every grid that only
    blocks more cells or raises costs.
    """

    def __init__(self, grid: GridGraph, distances: NDArray[np.int32]) -> None:
        """Keep the `distances` measured on `grid`; -1 where a landmark does not reach a cell."""
        self.distances = distances
        self._blocked = grid.blocked
        self._cell_surcharge = grid.cell_surcharge
        self._units = (grid.straight, grid.diagonal)
        self._corner_cutting = grid.corner_cutting

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
        `max_bytes` (4 bytes per cell each). Returns None if not even one fits, no cell is free,
        `stop` was raised or a distance does not fit 32 bits.
        """
        cell_bytes = 4 * grid.moves.size
        wanted = max(COUNT, min(MAX_COUNT, _SMALL_BYTES // cell_bytes)) if count is None else count
        count = min(wanted, max_bytes // cell_bytes)
        free = np.flatnonzero(grid.moves)
        if count < 1 or free.size == 0:
            return None
        distances = np.empty((count, grid.moves.size), dtype=np.int32)
        dijkstra = _Dijkstra(grid, distances, no_stop() if stop is None else stop)
        nearest = dijkstra.largest_area(free)
        if nearest is None:
            return None
        for row in range(count):
            source = int(nearest.argmax())
            if not dijkstra.fill(row, source):
                return None
            nearest = distances[0].copy() if row == 0 else np.minimum(nearest, distances[row])
        return cls(grid, distances)

    @property
    def count(self) -> int:
        """The number of landmarks."""
        return len(self.distances)

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        return self.distances.nbytes

    def active(self, grid: GridGraph, start: Cell, goal: Cell) -> NDArray[np.int64] | None:
        """Choose the landmarks that prove most for a query.

        Returns int64 [k, 2]: a landmark's row and its distance to the goal, in units.
        None if they prove that no path joins the cells.
        """
        first = self.distances[:, grid.index(start)].astype(np.int64)
        last = self.distances[:, grid.index(goal)].astype(np.int64)
        if ((first < 0) != (last < 0)).any():
            return None
        gaps = np.where(last < 0, 0, np.abs(first - last))
        best = np.argsort(-gaps, kind='stable')[:MAX_ACTIVE]
        best = best[gaps[best] > 0]
        return np.column_stack((best, last[best])).astype(np.int64)

    def lower_bound(self, grid: GridGraph, start: Cell, goal: Cell) -> float:
        """Return a lower bound, in cells, on the cost of any path; inf: there is no path."""
        active = self.active(grid, start, goal)
        if active is None:
            return float('inf')
        gaps = np.abs(self.distances[active[:, 0], grid.index(start)] - active[:, 1])
        return float(gaps.max(initial=0)) / self._units[0]

    def is_admissible_on(self, grid: GridGraph) -> bool:
        """Tell whether the bounds hold on `grid`: no cell was freed and none became cheaper."""
        units = (grid.straight, grid.diagonal)
        if self._units != units or grid.blocked.shape != self._blocked.shape:
            return False
        if grid.corner_cutting and not self._corner_cutting:
            return False
        if grid.blocked is not self._blocked and (self._blocked & ~grid.blocked).any():
            return False
        if grid.cell_surcharge is self._cell_surcharge or self._cell_surcharge.size == 0:
            return True
        if grid.cell_surcharge.size == 0:
            return False
        return bool((grid.cell_surcharge >= self._cell_surcharge).all())


class LandmarkManager:
    """Landmarks for the current map, built in the background: thread-safe.

    `update` takes each new map; `current` returns the landmarks that are ready for it. They stay
    while cells only become blocked or more expensive, and are rebuilt when some are freed.
    """

    def __init__(self, *, count: int | None = None, max_bytes: int = MAX_BYTES) -> None:
        """Build as `Landmarks.build` does with the same `count` and `max_bytes`."""
        self._count = count
        self._max_bytes = max_bytes
        self._lock = threading.Lock()
        self._landmarks: Landmarks | None = None
        self._grid: GridGraph | None = None  # the last map they were found admissible on
        self._thread: threading.Thread | None = None
        self._stop = no_stop()

    @property
    def nbytes(self) -> int:
        """Bytes the landmarks hold now."""
        landmarks = self._landmarks
        return 0 if landmarks is None else landmarks.nbytes

    def update(self, grid: GridGraph) -> None:
        """Take a new map: keep the landmarks if they are admissible on it, else rebuild them."""
        with self._lock:
            if self._landmarks is not None and self._landmarks.is_admissible_on(grid):
                self._grid = grid
                return
            self._landmarks = None
            self._stop[0] = 1
            stop = self._stop = no_stop()
            self._thread = threading.Thread(
                target=self._build, args=(grid, stop), name='landmarks', daemon=True
            )
            self._thread.start()

    def current(self, grid: GridGraph) -> Landmarks | None:
        """Return the landmarks that are admissible on `grid`, None while there are none."""
        with self._lock:
            if self._landmarks is None or self._grid is grid:
                return self._landmarks
            if not self._landmarks.is_admissible_on(grid):
                return None
            self._grid = grid
            return self._landmarks

    def wait(self, timeout: float | None = None) -> bool:
        """Wait, at most `timeout` seconds, for the build to end; tell whether it has."""
        thread = self._thread
        if thread is None:
            return True
        thread.join(timeout)
        return not thread.is_alive()

    def close(self) -> None:
        """Stop building and release the landmarks."""
        with self._lock:
            self._stop[0] = 1
            self._landmarks = None
        self.wait()

    def _build(self, grid: GridGraph, stop: StopFlag) -> None:
        landmarks = Landmarks.build(grid, count=self._count, max_bytes=self._max_bytes, stop=stop)
        with self._lock:
            if stop[0] == 0:
                self._landmarks = landmarks
                self._grid = grid


class _Dijkstra:
    """Repeated runs of Dijkstra's algorithm on one grid into the rows of one array."""

    def __init__(self, grid: GridGraph, distances: NDArray[np.int32], stop: StopFlag) -> None:
        self._grid = grid
        self._distances = distances
        self._stop = stop
        self._pool = np.empty(1 << 14, dtype=np.int64)
        self._heads = np.zeros(grid.ring, dtype=np.int32)

    def fill(self, row: int, source: int) -> bool:
        """Fill a row with the distances from the cell `source`; False if it was stopped."""
        grid, distances = self._grid, self._distances[row]
        distances[:] = -1
        distances[source] = 0
        seeds = np.array([source], dtype=np.int64)
        control = np.zeros(kernels.D_SIZE, dtype=np.int64)
        self._heads[:] = 0
        while True:
            status = kernels.propagate(
                grid.moves, grid.cell_surcharge, grid.width, grid.straight, grid.diagonal,
                grid.cell_surcharge.size == 0, seeds, distances, self._pool, self._heads,
                control, search_kernels.NO_PATH, self._stop,
            )  # fmt: skip
            if status != search_kernels.NEED_SPACE:
                return bool(status == search_kernels.FOUND)
            self._pool = np.concatenate((self._pool, np.empty_like(self._pool)))

    def largest_area(self, free: NDArray[np.int64]) -> NDArray[np.int32] | None:
        """Return the distances from a cell in the largest connected area that a few tries find.

        `free` holds the numbers of the free cells. Returns None if it was stopped.
        """
        best: NDArray[np.int32] | None = None
        most = 0
        for source in free[:: max(1, free.size // _SEEDS)]:
            if not self.fill(0, int(source)):
                return None
            reached = int(np.count_nonzero(self._distances[0] >= 0))
            if reached > most:
                most, best = reached, self._distances[0].copy()
            if 2 * most > free.size:
                break
        return best
