# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""A* over cells and headings: the cheapest path of a robot that is no circle.

The robot moves ahead, straight or diagonally, and turns on the spot. Every motion is held
against the cells that the polygon sweeps, so long robots pass corridors along which they fit and
turn where there is room.
"""

from __future__ import annotations

import math
import time
from functools import lru_cache

import numpy as np
import shapely
from shapely import affinity

from llm_astar_planner.search._kernels import headings as kernels
from llm_astar_planner.search._kernels.astar import NEED_SPACE, OVERFLOW, RUNNING, heap_push
from llm_astar_planner.search.arrays import Int64s, StopFlag
from llm_astar_planner.search.astar import ENDED, EXPANSION_SLICE, PathTooLongError
from llm_astar_planner.search.distances import DistanceRows, FreestMap
from llm_astar_planner.search.grid_graph import GridGraph, path_length, traced
from llm_astar_planner.search.result import BoundedResult, Cell, SearchStatus

Obstacles = kernels.Obstacles
SweptCells = kernels.SweptCells
HEADINGS = 8
EVERY_HEADING = (1 << HEADINGS) - 1
# Cells by which what is swept is widened: more than the inaccuracy of any check of a path.
MARGIN = 0.08
# Between two samples of a turn no point moves farther than this, in cells, where the samples do.
ARC, MAX_SAMPLES = 0.2, 64
# Footprints prepared that are kept.
CACHED = 8


@lru_cache(CACHED)
def swept_cells(points: tuple[tuple[float, float], ...]) -> SweptCells:
    """Return what a polygon of points (x, y), in cells, sweeps."""
    polygon = shapely.Polygon(points)
    radius = max(math.hypot(x, y) for x, y in points)
    turn = math.pi / 4.0 * radius
    samples = min(math.ceil(turn / ARC), MAX_SAMPLES)
    turned = shapely.union_all(
        [affinity.rotate(polygon, 45.0 * n / samples, (0, 0)) for n in range(samples + 1)]
    ).buffer(turn / samples / 2.0 + MARGIN)
    moved = [swept_ahead(polygon, length).buffer(MARGIN) for length in (1.0, math.sqrt(2.0))]
    regions = [affinity.rotate(moved[n % 2], 45.0 * n, (0, 0)) for n in range(HEADINGS)]
    regions += [affinity.rotate(turned, 45.0 * n, (0, 0)) for n in range(HEADINGS)]
    parts = [covered_spans(region) for region in regions]
    begins = np.cumsum([0, *map(len, parts)])
    spans = np.concatenate(parts)
    return SweptCells(spans, begins, int(np.abs(spans).max()))


def swept_ahead(polygon: shapely.Polygon, length: float) -> shapely.Geometry:
    """Return what a polygon sweeps that moves along x."""
    corners = shapely.get_coordinates(polygon)
    ahead = corners + (length, 0.0)
    sides = np.stack([corners[:-1], corners[1:], ahead[1:], ahead[:-1]], axis=1)
    quads = shapely.polygons(sides)
    areas = quads[shapely.area(quads) > 0.0]
    return shapely.union_all([polygon, shapely.Polygon(ahead), *areas])


def covered_spans(region: shapely.Geometry) -> Int64s:
    """Return the cells that a region touches as spans (row, first, last): int64 [n, 3]."""
    left, top, right, bottom = region.bounds
    rows = np.arange(math.floor(top + 0.5), math.floor(bottom + 0.5) + 1)
    strips = shapely.box(left - 1.0, rows - 0.5, right + 1.0, rows + 0.5)
    parts, index = shapely.get_parts(shapely.intersection(region, strips), return_index=True)
    bounds = shapely.bounds(parts)
    columns = np.floor(bounds[:, [0, 2]] + 0.5)
    return np.column_stack([rows[index], columns]).astype(np.int64)


class HeadingSearch:
    """One search from a cell to another; `run` ends it, `result` describes what it found."""

    def __init__(
        self, grid: GridGraph, obstacles: Obstacles, swept: SweptCells, start: Cell, goal: Cell
    ) -> None:
        """Take the query: costs are those of the grid. Raises ValueError for a cell off it."""
        self.grid = grid
        self.start, self.goal = grid.index(start), grid.index(goal)
        self._checks = obstacles, swept
        cells = grid.moves.size
        self._to_goal = np.zeros((1, cells), dtype=np.int32)
        self._known, self._free = (np.zeros(cells, dtype=np.uint16) for _ in range(2))
        self._control = np.zeros(kernels.H_SLOTS, dtype=np.int64)
        self.status = SearchStatus.STOPPED
        self.expansions = 0

    def run(
        self, start_headings: int, goal_headings: int, deadline: float, stop: StopFlag
    ) -> SearchStatus:
        """Search from one of the headings at the start to one at the goal, bits of a mask.

        Raises PathTooLongError. The memory used is 5 bytes for each state looked at, and 8 for
        each cell.
        """
        grid, states = self.grid, HEADINGS * self.grid.moves.size
        self._costs = np.zeros(states, dtype=np.int32)
        self._came = np.zeros(states, dtype=np.uint8)
        self._control[:] = 0
        # Distances are measured from the goal, so without rules: they are never more then.
        rows = DistanceRows(FreestMap(grid.without_rules), self._to_goal)
        if not rows.fill(0, self.goal, stop, deadline):
            return self.status
        keys, heap = (np.empty(1 << 12, dtype=np.int64) for _ in range(2))
        self._push_starts(start_headings, keys, heap)
        while time.monotonic() < deadline and not stop[0]:
            ended = kernels.search(
                grid.cells, *self._checks, self._to_goal[0], self._known, self._free, self._costs,
                self._came, keys, heap, self._control, self.goal, goal_headings, EXPANSION_SLICE,
            )  # fmt: skip
            if ended == OVERFLOW:
                raise PathTooLongError('the cost of a path for the footprint does not fit')
            if ended == NEED_SPACE:
                keys, heap = (np.concatenate((part, np.empty_like(part))) for part in (keys, heap))
            elif ended != RUNNING:
                self.status = ENDED[ended]
                break
        self.expansions += int(self._control[kernels.H_EXPANSIONS])
        return self.status

    def _push_starts(self, headings: int, keys: Int64s, heap: Int64s) -> None:
        """Put the start, at each of its headings, into the heap."""
        left = int(self._to_goal[0, self.start])
        if left < 0:
            return
        for heading in range(HEADINGS):
            if headings >> heading & 1:
                state = HEADINGS * self.start + heading
                self._costs[state], self._came[state] = 1, kernels.STARTED
                size = int(self._control[kernels.H_SIZE])
                heap_push(keys, heap, size, left << 31 | left, state, False)
                self._control[kernels.H_SIZE] += 1

    def reached(self, cell: Cell) -> list[int]:
        """Return the headings at which an exhausted search reached a cell, the cheapest first."""
        first = HEADINGS * self.grid.index(cell)
        costs = self._costs[first : first + HEADINGS].tolist()
        return sorted((h for h in range(HEADINGS) if costs[h]), key=costs.__getitem__)

    def farthest(self) -> Cell:
        """Return the cell reached that is nearest to the goal, along the way of a circle."""
        cells = np.flatnonzero(self._came.view(np.uint64))
        if not len(cells):
            cells = np.array([self.start])
        y, x = divmod(int(cells[self._to_goal[0, cells].argmin()]), self.grid.width)
        return x, y

    @property
    def found(self) -> int:
        """The state (HEADINGS * cell + heading) at which the search found the goal."""
        return int(self._control[kernels.H_FOUND])

    def result(self, state: int, *, want_expanded: bool) -> BoundedResult:
        """Describe the cheapest path to a state that was expanded."""
        path, _ = traced(kernels.trace, self._came, self.grid.width, state)
        units = int(self._costs[state]) - 1
        proven = self.grid.proven(path, units, units)
        expanded = np.zeros((0, 0), dtype=np.bool_)
        if want_expanded:
            closed = (self._came & kernels.CLOSED).reshape(*self.grid.blocked.shape, HEADINGS)
            expanded = np.bitwise_or.reduce(closed, axis=2) > 0
        storage = int(self._control[kernels.H_STORAGE])
        return BoundedResult(
            SearchStatus.FOUND, self.expansions, storage, expanded, path, path_length(path),
            *proven, self.expansions, proven[0],
        )  # fmt: skip
