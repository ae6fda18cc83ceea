"""Reference searches: what the best path could do about one clause, whatever the others ask.

They see the costmap's cells as a graph of their own and weigh each move by the metres of it that
lie in a region. They run only where a path is not beyond doubt already; on a map of 1000 x 1000
cells one takes some tenths of a second.
"""

from __future__ import annotations

import math
import time
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.verification.geometry import EDGE, Area
from llm_astar_planner.instructions.verification.walls import Walls
from llm_astar_planner.lazy import ndimage
from llm_astar_planner.search._kernels import reference as kernels
from llm_astar_planner.search.result import Cell

# No reference search runs on a larger map: 12 s and 2 GB. Nothing is proven or allowed there.
MAX_CELLS = 16_000_000
# What a search handles on a slow machine.
CELLS_PER_SECOND = 1_000_000
# Points of a move at which is looked whether they lie in a region whose edge the move crosses.
SAMPLES = 16
NO_LINE = np.full(4, np.nan)

Mask = NDArray[np.bool_]


class Reference:
    """The cells of a route's costmap as a graph."""

    def __init__(
        self, route: Route, walls: Walls, end: Area | None, deadline: float = math.inf
    ) -> None:
        """Take the route. It may end anywhere in `end`, if given, else at its goal.

        No search begins that would not be done by `deadline` (of time.monotonic).
        """
        self._deadline = deadline
        self._route = route
        self._walls = walls
        self._grid_map = route.costmap.grid_map
        self._end = end

    @property
    def small_enough(self) -> bool:
        """Whether reference searches run on this map in the time that is left."""
        time_left = self._deadline - time.monotonic()
        return self._grid_map.cells.size <= min(MAX_CELLS, CELLS_PER_SECOND * time_left)

    @property
    def blocked(self) -> Mask:
        """Cells that no path may use: bool [height, width]."""
        return self._route.costmap.blocked

    @cached_property
    def goal_mask(self) -> Mask:
        """The cells a path may end in: bool [height, width]."""
        if self._end is not None:
            mask = self.cells_in(self._end) & self.reachable
            if mask.any():
                return mask
        return self._mask_of(self._route.goal)

    @cached_property
    def start_mask(self) -> Mask:
        """The start alone: bool [height, width]."""
        return self._mask_of(self._route.start)

    def _mask_of(self, cell: Cell) -> Mask:
        mask = np.zeros(self.blocked.shape, dtype=np.bool_)
        mask[cell[1], cell[0]] = True
        return mask

    @cached_property
    def nothing_removed(self) -> Mask:
        """No cell: bool [height, width]."""
        return np.zeros(self.blocked.shape, dtype=np.bool_)

    @cached_property
    def reachable(self) -> Mask:
        """Cells that a robot at the start can reach: bool [height, width]."""
        return self.reach(self.nothing_removed) > 0

    def reach(
        self, removed: Mask, line: NDArray[np.float64] = NO_LINE, starts: Mask | None = None
    ) -> NDArray[np.uint8]:
        """Return what can be reached from the start, or from `starts`; see the kernel."""
        starts = self.start_mask if starts is None else starts
        cutting = self._route.costmap.config.corner_cutting
        reached: NDArray[np.uint8] = kernels.reach(self.blocked, cutting, removed, line, starts)
        return reached

    def separates(self, removed: Mask) -> bool:
        """Tell whether no path to a goal is left without some cells, bool [height, width]."""
        return not (self.goal_mask & (self.reach(removed) > 0)).any()

    def centres(self, cells: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the centres of cells (x, y) [n, 2] in metres."""
        return self._grid_map.grid_to_world(cells)

    def near(self, shape: BaseGeometry) -> Mask:
        """Return the cells near a shape's lines: bool [height, width].

        All whose centres are at most a cell from them, so both or one of the ends of each move
        that crosses them, and some that are a little farther.
        """
        height, width = self.blocked.shape
        outer = shapely.buffer(self._frame, 4.0 * self._grid_map.resolution, join_style='mitre')
        lines = shapely.intersection(shape.boundary if shape.area > 0.0 else shape, outer)
        dense = shapely.segmentize(lines, self._grid_map.resolution / 2.0)
        spots = np.rint(self._grid_map.world_to_grid(shapely.get_coordinates(dense))) + 1.0
        on_map = ((spots >= 0.0) & (spots < (width + 2, height + 2))).all(axis=1)
        columns, rows = spots[on_map].astype(np.intp).T
        mask = np.zeros((height + 2, width + 2), dtype=np.bool_)
        mask[rows, columns] = True
        near: Mask = ndimage.maximum_filter(mask, 3)[1:-1, 1:-1]
        return near

    @cached_property
    def _frame(self) -> BaseGeometry:
        height, width = self.blocked.shape
        corners = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
        return shapely.Polygon(self._grid_map.grid_to_world(corners))

    def inside(self, area: Area) -> Mask:
        """Return the cells whose centres lie strictly in an area: bool [height, width]."""
        return self.inside_and_edge(area)[0]

    def cells_in(self, area: Area) -> Mask:
        """Return the cells whose centres lie in an area or on its edge: bool [height, width]."""
        inside, edge = self.inside_and_edge(area)
        rows, columns = np.nonzero(edge)
        inside = inside.copy()
        inside[rows, columns] = area.contains(self.centres(np.column_stack((columns, rows))))
        return inside

    def inside_and_edge(self, area: Area) -> tuple[Mask, Mask]:
        """Return the cells with centres strictly in an area, and those near its edge.

        Of what is near the walls up to a fifth of a cell may lack, and no edge is known.
        """
        if area.wall_distance > 0.0:
            near = self._walls.centre_distances < area.wall_distance - EDGE
            return near, self.nothing_removed
        outline = area.outline
        if outline.is_empty:
            return self.nothing_removed, self.nothing_removed
        edge = self.near(outline)
        # Away from the edge whole patches are inside or outside; one cell of each tells which.
        patches, count = ndimage.label(~edge)
        samples = np.zeros(count + 1, dtype=np.intp)
        samples[patches.ravel()] = np.arange(patches.size)
        cells = np.concatenate((samples[1:], np.flatnonzero(edge)))
        rows, columns = np.divmod(cells, edge.shape[1])
        shapely.prepare(outline)
        hits = shapely.contains_xy(outline, *self.centres(np.column_stack((columns, rows))).T)
        inside: Mask = np.concatenate(([False], hits[:count]))[patches]
        inside[edge] = hits[count:]
        return inside, edge

    def least_inside(self, area: Area, *, outside: bool = False) -> float:
        """Return the least metres that any path has inside an area, or outside of it.

        NaN where no path leads to a goal or the map is too large.
        """
        if not self.small_enough:
            return math.nan
        inside, edge = self.inside_and_edge(area)
        if area.wall_distance > 0.0:
            return self.least_within(~inside if outside else inside)
        weights = np.stack([~inside if outside else inside] * 4).astype(np.float32)
        for move in range(4):
            rows, columns = self._moves_from(edge, move)
            shares = self._shares(area.outline, rows, columns, move)
            weights[move, rows, columns] = 1.0 - shares if outside else shares
        return self._least(weights)

    def least_within(self, cells: Mask) -> float:
        """Return the least metres that any path has in cells; a move half in its ends' cells."""
        weights = np.stack([cells] * 4).astype(np.float32)
        for move in range(4):
            shift = (-kernels.STEP_Y[move], -kernels.STEP_X[move])
            weights[move] += np.roll(cells, shift, axis=(0, 1))
        weights /= 2.0
        return self._least(weights)

    def _least(self, weights: NDArray[np.float32]) -> float:
        """Return the least metres of moves whose weights are a share of their length."""
        weights[2:] *= math.sqrt(2.0)
        cutting = self._route.costmap.config.corner_cutting
        goals = self.goal_mask & ~self.blocked
        least = kernels.least_sum(self.blocked, cutting, weights, *self._route.start, goals)
        return float(least) * self._grid_map.resolution if math.isfinite(least) else math.nan

    def _moves_from(self, cells: Mask, move: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the rows and columns of the cells where a move on the map starts or ends."""
        height, width = self.blocked.shape
        step_x, step_y = int(kernels.STEP_X[move]), int(kernels.STEP_Y[move])
        free = ~self.blocked
        near = cells | np.roll(cells, (-step_y, -step_x), axis=(0, 1))
        rows, columns = np.nonzero(near & free)
        on_map = (rows + step_y < height) & (columns + step_x < width) & (columns + step_x >= 0)
        rows, columns = rows[on_map], columns[on_map]
        legal = free[rows + step_y, columns + step_x]
        return rows[legal], columns[legal]

    def _lines(
        self, rows: NDArray[np.intp], columns: NDArray[np.intp], move: int
    ) -> NDArray[np.object_]:
        """Return moves as shapely lines."""
        cells = np.column_stack((columns, rows))
        step = np.array([kernels.STEP_X[move], kernels.STEP_Y[move]])
        ends = np.stack((self.centres(cells), self.centres(cells + step)), axis=1)
        lines: NDArray[np.object_] = shapely.linestrings(ends)
        return lines

    def _shares(
        self, outline: BaseGeometry, rows: NDArray[np.intp], columns: NDArray[np.intp], move: int
    ) -> NDArray[np.float64]:
        """Return which share of each move lies in a polygon: float64 [n].

        Exactly where it is all or nothing, else to half of one of SAMPLES.
        """
        lines = self._lines(rows, columns, move)
        shapely.prepare(outline)
        shares: NDArray[np.float64] = shapely.contains_properly(outline, lines).astype(np.float64)
        partly = (shares == 0.0) & shapely.intersects(outline, lines)
        along = (np.arange(SAMPLES) + 0.5) / SAMPLES
        ends = shapely.get_coordinates(lines[partly]).reshape(-1, 2, 2)
        x, y = np.moveaxis(ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * along[:, None], -1, 0)
        shares[partly] = shapely.contains_xy(outline, x, y).mean(axis=1)
        return shares

    def can_touch(self, area: Area, cells: Mask) -> bool:
        """Tell whether a move between cells, bool [height, width], touches an area, edge included.

        Exact for the area's outline; a single cell counts as a move. What is near the walls may
        be touched wherever a cell is nearer than one and a half cells more.
        """
        if area.wall_distance > 0.0:
            around = area.wall_distance + 1.5 * self._grid_map.resolution
            return bool(((self._walls.centre_distances < around) & cells).any())
        outline = area.outline
        if outline.is_empty or not cells.any():
            return False
        inside, edge = self.inside_and_edge(area)
        if (inside & cells).any():
            return True
        shapely.prepare(outline)
        rows, columns = np.nonzero(edge & cells)
        centres = shapely.points(self.centres(np.column_stack((columns, rows))))
        if shapely.intersects(outline, centres).any():
            return True
        for move in range(4):
            rows, columns = self._moves_from(edge & cells, move)
            there = cells[rows + kernels.STEP_Y[move], columns + kernels.STEP_X[move]]
            here = cells[rows, columns] & there
            lines = self._lines(rows[here], columns[here], move)
            if shapely.intersects(outline, lines).any():
                return True
        return False


def grown_by_a_cell(cells: Mask) -> Mask:
    """Return cells together with their eight neighbours: bool [height, width]."""
    grown: Mask = ndimage.maximum_filter(cells, 3)
    return grown
