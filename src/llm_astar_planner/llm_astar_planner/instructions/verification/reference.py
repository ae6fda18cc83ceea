# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Reference searches: what the best path could do about one clause, whatever the others ask.

They see the costmap's cells as a graph of their own and weigh each move by the metres of it that
lie in a region. They run only where a path is not beyond doubt already; on a map of 1000 x 1000
cells one takes some tenths of a second.
"""

import math
import time
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.verification.geometry import EDGE, Area, outline_of
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
# The moves that weights are stored for, (x, y).
STEPS = np.column_stack((kernels.STEP_X, kernels.STEP_Y))[:4]

Mask = NDArray[np.bool_]
Moves = tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp], NDArray[np.object_]]


@dataclass(frozen=True, eq=False)
class Reference:
    """The cells of a route's costmap as a graph.

    A path may end anywhere in `end`, if given, else at the goal. No search begins that would not
    be done by `deadline` (of time.monotonic).
    """

    route: Route
    walls: Walls
    end: Area | None = None
    deadline: float = math.inf

    @cached_property
    def grid_map(self) -> GridMap:
        """The map."""
        return self.route.costmap.grid_map

    @property
    def small_enough(self) -> bool:
        """Whether reference searches run on this map in the time that is left."""
        time_left = self.deadline - time.monotonic()
        return self.grid_map.cells.size <= min(MAX_CELLS, CELLS_PER_SECOND * time_left)

    @property
    def blocked(self) -> Mask:
        """Cells that no path may use: bool [height, width]."""
        return self.route.costmap.blocked

    @cached_property
    def goal_mask(self) -> Mask:
        """The cells a path may end in: bool [height, width]."""
        if self.end is not None:
            mask = self.cells_in(self.end) & self.reachable
            if mask.any():
                return mask
        return self._mask_of(self.route.goal)

    @cached_property
    def start_mask(self) -> Mask:
        """The start alone: bool [height, width]."""
        return self._mask_of(self.route.start)

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
        cutting = self.route.costmap.config.corner_cutting
        reached: NDArray[np.uint8] = kernels.reach(self.blocked, cutting, removed, line, starts)
        return reached

    def separates(self, removed: Mask) -> bool:
        """Tell whether no path to a goal is left without some cells, bool [height, width]."""
        return not (self.goal_mask & (self.reach(removed) > 0)).any()

    def centres(self, cells: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the centres of cells (x, y) [n, 2] in metres."""
        return self.grid_map.grid_to_world(cells)

    def near(self, shape: BaseGeometry) -> Mask:
        """Return the cells near a shape's lines: bool [height, width].

        All whose centres are at most a cell from them, so both or one of the ends of each move
        that crosses them, and some that are a little farther.
        """
        height, width = self.blocked.shape
        outer = shapely.buffer(
            outline_of(self.grid_map), 4.0 * self.grid_map.resolution, join_style='mitre'
        )
        lines = shapely.intersection(shape.boundary if shape.area > 0.0 else shape, outer)
        dense = shapely.segmentize(lines, self.grid_map.resolution / 2.0)
        spots = np.rint(self.grid_map.world_to_grid(shapely.get_coordinates(dense))) + 1.0
        on_map = ((spots >= 0.0) & (spots < (width + 2, height + 2))).all(axis=1)
        columns, rows = spots[on_map].astype(np.intp).T
        mask = np.zeros((height + 2, width + 2), dtype=np.bool_)
        mask[rows, columns] = True
        near: Mask = ndimage.maximum_filter(mask, 3)[1:-1, 1:-1]
        return near

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
            near = self.walls.centre_distances < area.wall_distance - EDGE
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
        if area.wall_distance > 0.0:
            depth = area.wall_distance - EDGE - self.walls.centre_distances
            return self._least(self._shares_deep(-depth if outside else depth))
        inside, edge = self.inside_and_edge(area)
        weights = np.stack([inside] * 4).astype(np.float32)
        moves, begins, _, lines = self._moves(edge)
        weights[moves, begins[:, 1], begins[:, 0]] = shares_in(area.outline, lines)
        return self._least(1.0 - weights if outside else weights)

    def _shares_deep(self, depth: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return which share of each move is deep at least, given the metres of its cells' depth.

        From an end that is so deep it is for as many metres.
        """
        weights, depth = np.empty((4, *depth.shape), np.float32), np.maximum(depth, 0.0)
        for move, step in enumerate(STEPS):
            other = np.roll(depth, -step[::-1], axis=(0, 1))
            length = math.hypot(*step) * self.grid_map.resolution
            weights[move] = np.minimum((depth + other) / length, 1.0)
        return weights

    def _least(self, weights: NDArray[np.float32]) -> float:
        """Return the least metres of moves whose weights are a share of their length."""
        weights[2:] *= math.sqrt(2.0)
        cutting = self.route.costmap.config.corner_cutting
        goals = self.goal_mask & ~self.blocked
        least = kernels.least_sum(self.blocked, cutting, weights, *self.route.start, goals)
        return float(least) * self.grid_map.resolution if math.isfinite(least) else math.nan

    def _moves(self, cells: Mask) -> Moves:
        """Return the moves between free cells that start or end in some cells.

        Their numbers [n], the cells (x, y) [n, 2] where they begin and end, and shapely lines.
        """
        free, wanted = np.pad(~self.blocked, 1), np.pad(cells, 1)
        rows, columns = np.nonzero(grown_by_a_cell(wanted) & free)
        move = np.repeat(np.arange(4), len(rows))
        begins = np.tile(np.column_stack((columns, rows)), (4, 1))
        ends = begins + STEPS[move]
        here, there = tuple(begins.T[::-1]), tuple(ends.T[::-1])
        legal = free[there] & (wanted[here] | wanted[there])
        begins, ends = begins[legal] - 1, ends[legal] - 1
        lines = shapely.linestrings(np.stack((self.centres(begins), self.centres(ends)), axis=1))
        return move[legal], begins, ends, lines

    def can_touch(self, area: Area, cells: Mask) -> bool:
        """Tell whether a move between cells, bool [height, width], touches an area, edge included.

        Exact for the area's outline; a single cell counts as a move. What is near the walls may
        be touched wherever a cell is nearer than one and a half cells more.
        """
        if area.wall_distance > 0.0:
            around = area.wall_distance + 1.5 * self.grid_map.resolution
            return bool(((self.walls.centre_distances < around) & cells).any())
        if (self.cells_in(area) & cells).any():
            return True
        _, begins, ends, lines = self._moves(self.inside_and_edge(area)[1] & cells)
        both = cells[tuple(begins.T[::-1])] & cells[tuple(ends.T[::-1])]
        shapely.prepare(area.outline)
        return bool(shapely.intersects(area.outline, lines[both]).any())


def shares_in(outline: BaseGeometry, lines: NDArray[np.object_]) -> NDArray[np.float64]:
    """Return which share of each line lies in a polygon: float64 [n].

    Exactly where it is all or nothing, else to half of one of SAMPLES.
    """
    shapely.prepare(outline)
    shares: NDArray[np.float64] = shapely.contains_properly(outline, lines).astype(np.float64)
    partly = (shares == 0.0) & shapely.intersects(outline, lines)
    along = (np.arange(SAMPLES) + 0.5) / SAMPLES
    ends = shapely.get_coordinates(lines[partly]).reshape(-1, 2, 2)
    x, y = np.moveaxis(ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * along[:, None], -1, 0)
    shares[partly] = shapely.contains_xy(outline, x, y).mean(axis=1)
    return shares


def grown_by_a_cell(cells: Mask) -> Mask:
    """Return cells together with their eight neighbours: bool [height, width]."""
    grown: Mask = ndimage.maximum_filter(cells, 3)
    return grown
