# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Where the regions of a specification lie, for the verification alone."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, partial, reduce

import numpy as np
import shapely
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.places import Place
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from llm_astar_planner.instructions import regions
from llm_astar_planner.instructions.regions import VISIT_RADIUS, Region
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.verification import geometry
from llm_astar_planner.instructions.verification.walls import Walls

# Metres that open sides reach beyond everything on the map.
BEYOND = 1000.0
COMPASS_DIRECTIONS = {'north': (0, 1), 'south': (0, -1), 'east': (1, 0), 'west': (-1, 0)}
NO_AREA = 'the region has no area'
Cut = Callable[[BaseGeometry, BaseGeometry], BaseGeometry]


class RegionError(LlmAstarError, ValueError):
    """A region that does not exist; the message is a fragment such as 'there is no place ...'."""


def require_size(area: geometry.Area) -> None:
    """Raise RegionError for an area in which no path can lie."""
    if not area.has_size:
        raise RegionError(NO_AREA)


@dataclass(frozen=True, eq=False)
class RegionPart:
    """A part of the map that can be visited: a place, a disc, a box, ...

    `width` is the metres across it, which say how deep a visit has to go. `reach`, if above 0, is
    how near one has to come to it instead: nobody can stand in it. `cell` is the square of the
    cell that holds a point: to pass it visits the point too.
    """

    area: geometry.Area
    width: float = math.inf
    reach: float = 0.0
    cell: BaseGeometry = geometry.NOTHING

    @cached_property
    def visited(self) -> geometry.Area:
        """What a path has to touch to have visited the part."""
        if self.reach:
            return self.area.grown(self.reach + geometry.EDGE)
        if len(self.area.discs):
            return geometry.Area(self.cell, self.area.discs + (0.0, 0.0, geometry.EDGE))
        depth = min(regions.VISIT_DEPTH, self.width / 4.0)
        deep = self.area.shrunk(max(0.0, depth - geometry.EDGE))
        # A thin part of a wide rectangle, a ring for instance, may be nowhere so deep.
        while not deep.has_size and depth > geometry.EDGE:
            depth /= 2.0
            deep = self.area.shrunk(depth)
        return deep

    @cached_property
    def entered(self) -> geometry.Area:
        """Where a path has entered the part: inside of it, near to what one cannot stand in."""
        return self.visited if self.reach else self.area.shrunk(geometry.EDGE)

    @cached_property
    def ends(self) -> geometry.Area:
        """Where the last point of a path has to be to end in the part."""
        if self.reach:
            return self.visited
        return self.area if self.cell.is_empty else geometry.Area(self.cell, self.area.discs)


@dataclass(frozen=True, eq=False)
class Resolved:
    """A region on a map: its parts, of which a visit takes any one."""

    parts: tuple[RegionPart, ...]

    @cached_property
    def area(self) -> geometry.Area:
        """All of it."""
        return geometry.together(part.area for part in self.parts)

    @cached_property
    def visited(self) -> geometry.Area:
        """What a path has to touch to have visited the region."""
        return geometry.together(part.visited for part in self.parts)

    @cached_property
    def entered(self) -> geometry.Area:
        """Where a path has entered the region."""
        return geometry.together(part.entered for part in self.parts)

    @cached_property
    def ends(self) -> geometry.Area:
        """Where the last point of a path has to be to end in the region."""
        return geometry.together(part.ends for part in self.parts)

    @property
    def is_object(self) -> bool:
        """Whether nobody can stand in any of it."""
        return all(part.reach for part in self.parts)


@dataclass(frozen=True, eq=False)
class Regions:
    """Finds the regions of specifications on the map of a route."""

    route: Route
    walls: Walls

    @cached_property
    def map_outline(self) -> BaseGeometry:
        """The outline of the whole grid in the map's frame."""
        return geometry.outline_of(self.route.costmap.grid_map)

    def resolve(self, region: Region, radius: float = VISIT_RADIUS) -> Resolved:
        """Return where a region lies. `radius` is that of a point without one.

        Raises RegionError where a name or a tag does not exist, or the region has no meaning.
        """
        match region:
            case regions.Tagged(tag):
                places = self.route.places.with_tag(tag)
                if not places:
                    raise RegionError(f'there is no place of the kind or tag {tag!r}')
                return Resolved(tuple(self.place_part(place) for place in places))
            case regions.AnyOf(members):
                found = self.joinable(members, radius)
                return Resolved(tuple(part for one in found for part in one.parts))
            case regions.AllOf(members):
                found = sorted(self.joinable(members, radius), key=lambda one: not one.is_object)
                return reduce(partial(self.cut, shapely.intersection), found)
            case regions.Except(inner, others):
                found = self.joinable((inner, *others), radius)
                return reduce(partial(self.cut, shapely.difference), found)
        return Resolved((self.part(region, radius),))

    def resolve_avoided(self, region: Region) -> Resolved:
        """Return where a region to keep out of lies."""
        return self.resolve(region, regions.AVOID_RADIUS)

    def joinable(self, members: Iterable[Region], radius: float) -> list[Resolved]:
        """Return where regions lie that others are made of. Raises RegionError."""
        found = [self.resolve(region, radius) for region in members]
        if any(part.area.wall_distance > 0.0 for one in found for part in one.parts):
            raise RegionError('the strip along all walls is not joined with other regions')
        return found

    def cut(self, operation: Cut, one: Resolved, other: Resolved) -> Resolved:
        """Return what an operation with another region leaves of the parts of one.

        A part of which all is left stays as exact as it is.
        """
        parts = []
        for part in one.parts:
            left = geometry.polygons_of(operation(part.area.outline, other.area.outline))
            whole = left.equals(part.area.outline)
            parts.append(part if whole else replace(self.open_part(left), reach=part.reach))
        return Resolved(tuple(part for part in parts if part.area.has_size) or (parts[0],))

    def part(self, region: Region, radius: float) -> RegionPart:
        """Return where a region of one part lies. Raises RegionError."""
        match region:
            case regions.NamedPlace(name):
                return self.place_part(self.place(name))
            case regions.Disc(x, y, given):
                return self.disc_part((x, y), given or radius)
            case regions.End(end):
                goal = self.route.position(self.route.goal)
                return self.disc_part(self.route.begin if end == 'start' else goal, VISIT_RADIUS)
            case regions.Box():
                return self.open_part(self.box_polygon(region))
            case regions.Half():
                return self.half_part(region)
            case regions.Between(first, second):
                both = shapely.union_all([self.outline(name) for name in (first, second)])
                return area_part(shapely.difference(shapely.convex_hull(both), both))
            case regions.Along(place, width):
                return self.along_part(place, width)
        raise TypeError(type(region).__name__)

    def place(self, name: str) -> Place:
        """Return the place of a name. Raises RegionError if there is none."""
        place = self.route.places.get(name)
        if place is None:
            raise RegionError(f'there is no place named {name!r}')
        return place

    def outline(self, name: str) -> BaseGeometry:
        """Return the outline of a place. Raises RegionError if there is none."""
        return self.place_part(self.place(name)).area.outline

    def place_part(self, place: Place) -> RegionPart:
        """Return a place; a point is a disc of VISIT_RADIUS."""
        shape = shapely.force_2d(place.geometry)
        if shape.geom_type != 'Point' or shape.is_empty:
            return area_part(shape, regions.OBJECT_REACH if place.is_object else 0.0)
        if place.is_object:
            area = geometry.disc_area(shape.x, shape.y, VISIT_RADIUS)
            return RegionPart(area, reach=regions.OBJECT_REACH - VISIT_RADIUS)
        return self.disc_part((shape.x, shape.y), VISIT_RADIUS)

    def disc_part(self, centre: tuple[float, float], radius: float) -> RegionPart:
        """Return a disc, and the inside of the cell that holds its centre."""
        grid_map = self.route.costmap.grid_map
        cell = np.array(2 * grid_map.world_to_cell(*centre))
        half = 0.5 - geometry.EDGE
        square = shapely.box(*(cell + (-half, -half, half, half)))
        placed = shapely.transform(square, grid_map.grid_to_world)
        return RegionPart(geometry.disc_area(*centre, radius), 2.0 * radius, cell=placed)

    def open_part(self, polygon: BaseGeometry) -> RegionPart:
        """Return a polygon that may reach beyond the map; its width is that on the map."""
        on_map = geometry.polygons_of(shapely.intersection(polygon, self.map_outline))
        return RegionPart(geometry.polygon_area(polygon), width_of(on_map))

    def box_polygon(self, box: regions.Box) -> BaseGeometry:
        """Return a box with its open sides beyond the map; empty if its sides are in no order."""
        sides = np.array(box.sides)
        ends = [*shapely.bounds(self.map_outline), *sides[np.isfinite(sides)]]
        x0, y0, x1, y1 = np.clip(sides, min(ends) - BEYOND, max(ends) + BEYOND)
        return shapely.box(x0, y0, x1, y1) if x0 < x1 and y0 < y1 else geometry.NOTHING

    def half_part(self, half: regions.Half) -> RegionPart:
        """Return a half of the map or of a place."""
        whole = self.outline(half.of) if half.of else self.map_outline
        if whole.is_empty:
            return area_part(geometry.NOTHING)
        x0, y0, x1, y1 = shapely.bounds(whole)
        middle = np.array([(x0 + x1) / 2.0, (y0 + y1) / 2.0])
        if half.side in regions.ROUTE_SIDES and not half.of:
            middle = np.array(self.route.begin)
        size = 2.0 * self.map_outline.length + BEYOND
        plane = half_plane(middle, size * self.direction(half.side))
        return area_part(shapely.intersection(whole, plane)) if half.of else self.open_part(plane)

    def direction(self, side: str) -> NDArray[np.float64]:
        """Return the direction of a side, of length 1: the compass's or the direct way's.

        Raises RegionError for left and right where start and goal are one cell.
        """
        if side not in regions.ROUTE_SIDES:
            return np.array(COMPASS_DIRECTIONS[side], dtype=np.float64)
        start = np.array(self.route.begin)
        way = np.array(self.route.position(self.route.goal)) - start
        if not way.any():
            raise RegionError(f'start and goal are one cell, which has no {side} side')
        way /= np.hypot(*way)
        left = np.array([-way[1], way[0]])
        return left if side == 'left' else -left

    def along_part(self, place: str, width: float) -> RegionPart:
        """Return the strip around a place, or all that is near a wall."""
        if place == regions.WALLS:
            if not self.walls.exist:
                raise RegionError('the map has no walls')
            return RegionPart(self.walls.zone(width), width)
        inner = self.outline(place)
        outer = shapely.buffer(inner, width, quad_segs=geometry.QUARTER_SIDES)
        return RegionPart(geometry.polygon_area(shapely.difference(outer, inner)), width)


def area_part(shape: BaseGeometry, reach: float = 0.0) -> RegionPart:
    """Return the polygons of a shape; nobody can stand in what has a reach."""
    area = geometry.polygon_area(shape)
    return RegionPart(area, width_of(area.polygon), reach)


def half_plane(origin: NDArray[np.float64], ahead: NDArray[np.float64]) -> BaseGeometry:
    """Return everything beyond a point in a direction, as far as the vector `ahead` reaches."""
    across = np.array([-ahead[1], ahead[0]])
    near, far = origin - across, origin + across
    return shapely.Polygon([near, far, far + ahead, near + ahead])


def width_of(polygon: BaseGeometry) -> float:
    """Return the smaller side of the smallest rectangle, however turned, around a polygon."""
    if polygon.is_empty:
        return 0.0
    corners = shapely.get_coordinates(shapely.oriented_envelope(polygon))
    if len(corners) < 4:
        return 0.0
    return float(min(math.dist(corners[0], corners[1]), math.dist(corners[1], corners[2])))
