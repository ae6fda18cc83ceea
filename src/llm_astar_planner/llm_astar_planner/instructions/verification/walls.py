# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The walls of a map as the verification measures them: the squares of its lethal cells."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.verification import geometry
from llm_astar_planner.instructions.verification.geometry import Spans, Stretches, Vectors
from llm_astar_planner.lazy import ndimage


class Walls:
    """The lethal cells of a costmap's own map, inflation left out, joined to rectangles."""

    def __init__(self, costmap: Costmap) -> None:
        """Take the costmap."""
        self._grid_map = costmap.grid_map
        self._lethal = self._grid_map.cells >= costmap.config.occupied_threshold

    @cached_property
    def _boxes(self) -> NDArray[np.float64]:
        """The rectangles in cells: x0, y0, x1, y1, [n, 4]."""
        return rectangles(self._lethal).T.astype(np.float64) - 0.5

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree(shapely.box(*self._boxes.T))

    def _in_cells(self, points: ArrayLike) -> geometry.Polyline:
        """Return a path in metres as one in cells."""
        return geometry.polyline(self._grid_map.world_to_grid(points))

    @property
    def exist(self) -> bool:
        """Whether the map has any."""
        return bool(self._lethal.any())

    def distances(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the metres from points [n, 2] in metres to the walls: float64 [n]."""
        return self._away(shapely.points(self._grid_map.world_to_grid(points)))

    def _away(self, shapes: NDArray[np.object_]) -> NDArray[np.float64]:
        """Return the metres from points and lines [n] in cells to the walls; inf without any."""
        if not self.exist:
            return np.full(len(shapes), np.inf)
        _, away = self._tree.query_nearest(shapes, return_distance=True, all_matches=False)
        distances: NDArray[np.float64] = away * self._grid_map.resolution
        return distances

    def nearest(self, points: ArrayLike) -> tuple[float, tuple[float, float]]:
        """Return the least metres from a path through points to the walls, and where that is.

        Without walls: inf and its first point.
        """
        path = self._in_cells(points)
        away = self._away(path.segments)
        segment = path.segments[int(np.argmin(away))]
        if self.exist:
            wall = self._tree.geometries[self._tree.query_nearest(segment, all_matches=False)[0]]
            segment = shapely.shortest_line(segment, wall)
        x, y = self._grid_map.grid_to_world(shapely.get_coordinates(segment)[:1])[0]
        return float(away.min()), (float(x), float(y))

    def spans(self, path: geometry.Polyline, metres: float) -> Spans:
        """Return where a path is at most `metres`, above 0, from the walls.

        All that is so near to one rectangle is convex: two rectangles and four discs.
        """
        cells, radius = self._in_cells(path.corners), metres / self._grid_map.resolution
        segment, wall = self._tree.query(cells.segments, predicate='dwithin', distance=radius)
        low, high = self._boxes[wall, :2], self._boxes[wall, 2:]

        def parts(begins: Vectors, ahead: Vectors) -> Iterator[Stretches]:
            for grown in ((radius, 0.0), (0.0, radius)):
                yield geometry.in_box(ahead, low - begins - grown, high - begins + grown)
            for x, y in product((low[:, 0], high[:, 0]), (low[:, 1], high[:, 1])):
                yield geometry.in_disc(ahead, np.column_stack((x, y)) - begins, radius)

        spans = cells.spans_in_convex(segment, parts)
        return geometry.joined(spans) * self._grid_map.resolution

    def outline(self, metres: float) -> BaseGeometry:
        """Return everything within `metres` of the walls as a polygon, to draw."""
        cells = shapely.union_all(self._tree.geometries)
        placed = shapely.transform(cells, self._grid_map.grid_to_world)
        return shapely.buffer(placed, metres, quad_segs=4)

    def zone(self, metres: float) -> WallZone:
        """Return everything within `metres`, above 0, of the walls."""
        return WallZone(geometry.NOTHING, np.empty((0, 3)), self, metres)

    @cached_property
    def centre_distances(self) -> NDArray[np.float64]:
        """Return the metres from the cells' centres to a nearest wall: float64 [height, width].

        Of the square whose centre is nearest, so up to a fifth of a cell too large, never too
        small; inf without walls.
        """
        if not self.exist:
            return np.full(self._lethal.shape, np.inf)
        rows, columns = ndimage.distance_transform_edt(
            ~self._lethal, return_distances=False, return_indices=True
        )
        height, width = self._lethal.shape
        off_y = np.maximum(np.abs(rows - np.arange(height)[:, None]) - 0.5, 0.0)
        off_x = np.maximum(np.abs(columns - np.arange(width)) - 0.5, 0.0)
        distances: NDArray[np.float64] = np.hypot(off_x, off_y) * self._grid_map.resolution
        return distances


@dataclass(frozen=True, eq=False)
class WallZone(geometry.Area):
    """All that is at most `metres` from the walls."""

    walls: Walls
    metres: float

    @property
    def wall_distance(self) -> float:
        """How near to a wall everything in it is."""
        return self.metres

    @property
    def has_size(self) -> bool:
        """Whether a path can lie in it."""
        return self.metres > 0.0

    @cached_property
    def outline(self) -> BaseGeometry:
        """All of it as a polygon, to draw."""
        return self.walls.outline(self.metres)

    def grown(self, by: float) -> WallZone:
        """Return all points within `by` metres more of the walls."""
        return self.walls.zone(self.metres + by)

    def shrunk(self, by: float) -> WallZone:
        """Return all points that are `by` metres nearer to the walls."""
        return self.walls.zone(self.metres - by)

    def spans(self, path: geometry.Polyline) -> Spans:
        """Return where a path lies in it."""
        return self.walls.spans(path, self.metres)

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Tell which points [n, 2] lie in it, those within EDGE of its edge included."""
        return self.walls.distances(points) <= self.metres + geometry.EDGE

    def distance(self, shape: BaseGeometry) -> float:
        """Return the metres from a point or a line to it, inf without walls."""
        return max(0.0, self.walls.nearest(shapely.get_coordinates(shape))[0] - self.metres)

    def nearest_point(self, shape: BaseGeometry) -> tuple[float, float]:
        """Return the point (x, y) of a point or a line that is nearest to it."""
        return self.walls.nearest(shapely.get_coordinates(shape))[1]


def rectangles(cells: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Cover cells [height, width] with rectangles: x0, y0, x1, y1, the last two exclusive, [4, n].

    A rectangle is a run of cells in a row, together with equal runs in the rows that follow.
    """
    change = np.diff(np.pad(cells, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    ys, begins = np.nonzero(change == 1)
    ends = np.nonzero(change == -1)[1]
    order = np.lexsort((ys, ends, begins))
    ys, begins, ends = ys[order], begins[order], ends[order]
    same = (np.diff(begins) == 0) & (np.diff(ends) == 0) & (np.diff(ys) == 1)
    first = np.concatenate(([True], ~same)) if len(ys) else np.zeros(0, dtype=np.bool_)
    last = np.concatenate((~same, [True])) if len(ys) else first
    return np.stack((begins[first], ys[first], ends[first], ys[last] + 1))
