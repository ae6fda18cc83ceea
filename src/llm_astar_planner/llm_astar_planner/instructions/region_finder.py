# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The map under a route, as clauses ask about it: cells of regions, of distances and of sides.

Verification has its own reading of the same definitions.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely
from llm_astar_msgs_adapter.maps.places import Place, Places
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.costmap.raster import Cover, cover, open_border
from llm_astar_planner.instructions import polygons, regions
from llm_astar_planner.instructions.regions import VISIT_RADIUS, Region
from llm_astar_planner.instructions.route import PlaceGoalError, Route
from llm_astar_planner.lazy import ndimage
from llm_astar_planner.search.result import Cell

# Half the width, in cells, of the strip that a ray blocks: no move gets past it between cells.
RAY_WIDTH = 0.3
# Cells that a path has to be away from a region to have left it, and half a move more.
LEFT, HALF_MOVE = 1.5, 0.75
# Parts of a cell at which the way driven is looked at.
SAMPLES = 4
ROUNDING = 1e-9


Mask = NDArray[np.bool_]


class RegionCells(NamedTuple):
    """A region of the search: its cells, bool [height, width], and which driven points are in it.

    The points are those of `RegionFinder.driven`.
    """

    cells: Mask
    driven: Mask


class RegionFinder:
    """Finds the cells of regions on the costmap of a route. Methods raise NoRegionError."""

    def __init__(self, route: Route) -> None:
        """Take the route."""
        self.route = route
        self.grid_map = route.costmap.grid_map

    @cached_property
    def driven(self) -> NDArray[np.float64]:
        """The way driven, [n, 2] metres, at distances of a part of a cell."""
        points = self.route.driven
        if len(points) < 2:
            return points
        lengths = np.hypot(*np.diff(points, axis=0).T)
        counts = np.maximum(1, np.ceil(SAMPLES * lengths / self.grid_map.resolution)).astype(int)
        steps = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        share = (steps / np.repeat(counts, counts))[:, None]
        begins, ends = (np.repeat(part, counts, axis=0) for part in (points[:-1], points[1:]))
        return np.concatenate((begins + share * (ends - begins), points[-1:]))

    def zone(self, cells: Mask, polygon: BaseGeometry) -> RegionCells:
        """Return cells with where the way driven lies in their polygon."""
        return RegionCells(cells, shapely.contains_xy(polygon, self.driven))

    def avoided(self, region: Region, margin: float = 0.0) -> Cover:
        """Return what a region and a margin around it cover."""
        if is_walls(region):
            return self.near_walls(region.width + margin)  # type: ignore[attr-defined]
        polygon = polygons.region_polygon(region, self.route, regions.AVOID_RADIUS)
        if margin:
            polygon = polygons.grown(polygon, margin)
        return open_border(cover(polygon, self.grid_map), polygon, self.grid_map)

    def outside(self, region: Region) -> Cover:
        """Return what everything but a region covers."""
        if is_walls(region):
            return self.near_walls(region.width).outside()  # type: ignore[attr-defined]
        polygon = polygons.region_polygon(region, self.route, VISIT_RADIUS)
        others = polygons.map_polygon(self.route).difference(polygon)
        return open_border(cover(polygon, self.grid_map).outside(), others, self.grid_map)

    def entered(self, region: Region) -> RegionCells:
        """Return the cells of which part lies in a region, or near an object."""
        polygon = polygons.entered_polygon(region, self.route)
        covered = open_border(cover(polygon, self.grid_map), polygon, self.grid_map)
        return self.zone(covered.touched, polygon)

    def visited(self, region: Region) -> RegionCells:
        """Return the free cells in which a region counts as visited."""
        polygon = polygons.visit_polygon(region, self.route)
        covered = cover(polygon, self.grid_map)
        cells = covered.centres
        if isinstance(region, regions.Disc):
            column, row = self.grid_map.world_to_cell(region.x, region.y)
            if self.grid_map.contains((column, row)):
                cells[row, column] = True
        if not cells.any():  # too small for the cells: those that it touches
            cells = covered.touched
        return self.zone(cells & ~self.route.costmap.blocked, polygon)

    def touching(self, region: Region) -> RegionCells:
        """Return the cells from which a move may visit a region: no visit is overlooked."""
        polygon = polygons.visit_polygon(region, self.route)
        return self.zone(cover(polygon, self.grid_map).touched, polygon)

    def around(self, region: Region) -> RegionCells:
        """Return the cells in which a path may not have left a region yet."""
        reach = (LEFT + HALF_MOVE) * self.grid_map.resolution
        polygon = polygons.grown(polygons.entered_polygon(region, self.route), reach)
        return self.zone(cover(polygon, self.grid_map).touched, polygon)

    def near_walls(self, metres: float) -> Cover:
        """Return the cells nearer to an occupied cell than so many metres.

        The distance is to the square of the occupied cell. `touched` has also the cells from
        which a move may come nearer than its two ends are.
        """
        cells = metres / self.grid_map.resolution
        # Half a diagonal move is sqrt(1/2) long: it dips to sqrt(d^2 - 1/2) between its ends.
        too_near = self.squared_distances < cells**2 - ROUNDING
        return Cover(too_near, too_near, self.squared_distances < cells**2 + 0.5 - ROUNDING)

    @cached_property
    def squared_distances(self) -> NDArray[np.float64]:
        """The squared distance of each cell to the nearest occupied square, in cells."""
        lethal = self.grid_map.cells >= self.route.costmap.config.occupied_threshold
        if not lethal.any():
            return np.full(lethal.shape, np.inf)
        rows, columns = ndimage.distance_transform_edt(
            ~lethal, return_distances=False, return_indices=True
        )
        y, x = np.ogrid[: self.grid_map.height, : self.grid_map.width]
        beside = np.maximum(np.abs(columns - x) - 0.5, 0.0)
        above = np.maximum(np.abs(rows - y) - 0.5, 0.0)
        squared: NDArray[np.float64] = beside**2 + above**2
        return squared

    def sides(self, region: Region, side: str) -> tuple[Cover, RegionCells]:
        """Return an object with the ray to its wrong side, and the ray to the right side."""
        width = RAY_WIDTH * self.grid_map.resolution
        body = cover(polygons.region_polygon(region, self.route, VISIT_RADIUS), self.grid_map)
        wrong, right = (
            polygons.ray(region, side, self.route, opposite=opposite) for opposite in (True, False)
        )
        barred = cover(wrong.buffer(width), self.grid_map).touched
        forbidden = Cover(*(cells | barred for cells in body))
        crossing = cover(right.buffer(width), self.grid_map).touched & ~forbidden.touched
        return forbidden, RegionCells(crossing, self.crossed(right))

    def crossed(self, line: BaseGeometry) -> NDArray[np.bool_]:
        """Return where on the way driven a line was crossed since the point before."""
        found = np.zeros(len(self.driven), dtype=np.bool_)
        if len(found) > 1:
            steps = shapely.linestrings(np.stack((self.driven[:-1], self.driven[1:]), axis=1))
            found[1:] = shapely.intersects(line, steps)
        return found


def is_walls(region: Region) -> bool:
    """Tell whether a region is the strip along all walls, which is no polygon."""
    return isinstance(region, regions.Along) and region.place == regions.WALLS


def goal_cell(place: Place, costmap: Costmap) -> Cell:
    """Return the cell to go to: the free one nearest to the centre of the place.

    In an area it is well inside, at an object near it, and where there is a choice in the largest
    part of the map that can be driven. Raises PlaceGoalError where no cell is free.
    """
    finder = RegionFinder(Route(costmap, (0, 0), (0, 0), Places([place])))
    cells = finder.visited(regions.NamedPlace(place.name)).cells
    if not cells.any():
        radius = costmap.config.robot_radius
        robot = f' for a robot with a radius of {radius:g} m' if radius else ''
        raise PlaceGoalError(f'no cell of {place.name!r} is free on this map{robot}')
    components = costmap.components[:, :]
    sizes = np.bincount(components.ravel())
    sizes[0] = 0
    cells &= components == max(np.unique(components[cells]), key=lambda number: sizes[number])
    centre = place.geometry.centroid
    x, y = costmap.grid_map.world_to_grid([(centre.x, centre.y)])[0]
    rows, columns = np.nonzero(cells)
    nearest = int(np.argmin((columns - x) ** 2 + (rows - y) ** 2))
    return int(columns[nearest]), int(rows[nearest])
