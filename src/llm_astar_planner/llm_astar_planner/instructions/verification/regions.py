"""Where the regions of a specification lie, for the verification alone."""

from __future__ import annotations

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

from llm_astar_planner.instructions.regions import (
    AVOID_RADIUS,
    OBJECT_REACH,
    ROUTE_SIDES,
    VISIT_DEPTH,
    VISIT_RADIUS,
    WALLS,
    AllOf,
    Along,
    AnyOf,
    Between,
    Box,
    Disc,
    End,
    Except,
    Half,
    NamedPlace,
    Region,
    Tagged,
)
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.verification.geometry import (
    EDGE,
    NOTHING,
    QUARTER_SIDES,
    Area,
    disc_area,
    polygon_area,
    polygons_of,
    together,
)
from llm_astar_planner.instructions.verification.walls import Walls

# Metres that open sides reach beyond everything on the map.
BEYOND = 1000.0
COMPASS_DIRECTIONS = {
    'north': (0.0, 1.0),
    'south': (0.0, -1.0),
    'east': (1.0, 0.0),
    'west': (-1.0, 0.0),
}
Cut = Callable[[BaseGeometry, BaseGeometry], BaseGeometry]


class RegionError(LlmAstarError, ValueError):
    """A region that does not exist; the message is a fragment such as 'there is no place ...'."""


@dataclass(frozen=True, eq=False)
class RegionPart:
    """A part of the map that can be visited: a place, a disc, a box, ...

    `width` is the metres across it, which say how deep a visit has to go. `reach`, if above 0, is
    how near one has to come to it instead: nobody can stand in it. `cell` is the square of the
    cell that holds a point: to pass it visits the point too.
    """

    area: Area
    width: float = math.inf
    reach: float = 0.0
    cell: BaseGeometry = NOTHING

    @cached_property
    def visited(self) -> Area:
        """What a path has to touch to have visited the part."""
        if self.reach:
            return self.area.grown(self.reach + EDGE)
        if len(self.area.discs):
            return Area(self.cell, self.area.discs + (0.0, 0.0, EDGE))
        depth = min(VISIT_DEPTH, self.width / 4.0)
        deep = self.area.shrunk(max(0.0, depth - EDGE))
        # A thin part of a wide rectangle, a ring for instance, may be nowhere so deep.
        while not deep.has_size and depth > EDGE:
            depth /= 2.0
            deep = self.area.shrunk(depth)
        return deep

    @cached_property
    def entered(self) -> Area:
        """Where a path has entered the part: inside of it, near to what one cannot stand in."""
        return self.visited if self.reach else self.area.shrunk(EDGE)

    @cached_property
    def ends(self) -> Area:
        """Where the last point of a path has to be to end in the part."""
        if self.reach:
            return self.area.grown(self.reach + EDGE)
        if self.cell.is_empty:
            return self.area
        return Area(self.cell, self.area.discs)


@dataclass(frozen=True, eq=False)
class Resolved:
    """A region on a map: its parts, of which a visit takes any one."""

    parts: tuple[RegionPart, ...]

    @cached_property
    def area(self) -> Area:
        """All of it."""
        return together(part.area for part in self.parts)

    @cached_property
    def visited(self) -> Area:
        """What a path has to touch to have visited the region."""
        return together(part.visited for part in self.parts)

    @cached_property
    def entered(self) -> Area:
        """Where a path has entered the region."""
        return together(part.entered for part in self.parts)

    @cached_property
    def ends(self) -> Area:
        """Where the last point of a path has to be to end in the region."""
        return together(part.ends for part in self.parts)

    @property
    def is_object(self) -> bool:
        """Whether nobody can stand in any of it."""
        return all(part.reach for part in self.parts)


class Regions:
    """Finds the regions of specifications on the map of a route."""

    def __init__(self, route: Route, walls: Walls) -> None:
        """Take the route and its walls."""
        self._route = route
        self._walls = walls
        grid_map = route.costmap.grid_map
        width, height = grid_map.width, grid_map.height
        corners = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
        # The outline of the whole grid in the map's frame.
        self.map_outline = shapely.Polygon(grid_map.grid_to_world(corners))

    def resolve(self, region: Region, radius: float = VISIT_RADIUS) -> Resolved:
        """Return where a region lies. `radius` is that of a point without one.

        Raises RegionError where a name or a tag does not exist, or the region has no meaning.
        """
        match region:
            case NamedPlace(name):
                return Resolved((self.place_part(self.place(name)),))
            case Tagged(tag):
                places = self._route.places.with_tag(tag)
                if not places:
                    raise RegionError(f'there is no place of the kind or tag {tag!r}')
                return Resolved(tuple(self.place_part(place) for place in places))
            case Disc(x, y, given):
                return Resolved((self.disc_part(x, y, given or radius),))
            case Box():
                return Resolved((self.open_part(self.box_polygon(region)),))
            case Half():
                return Resolved((self.half_part(region),))
            case Between(first, second):
                return Resolved((self.between_part(first, second),))
            case Along(place, width):
                return Resolved((self.along_part(place, width),))
            case End(end):
                at_start, goal = end == 'start', self._route.position(self._route.goal)
                x, y = self._route.begin if at_start else goal
                return Resolved((self.disc_part(x, y, VISIT_RADIUS),))
            case AnyOf(regions):
                found = self.joinable(regions, radius)
                return Resolved(tuple(part for one in found for part in one.parts))
            case AllOf(regions):
                found = sorted(self.joinable(regions, radius), key=lambda one: not one.is_object)
                return reduce(partial(self.cut, shapely.intersection), found)
            case Except(inner, others):
                found = self.joinable((inner, *others), radius)
                return reduce(partial(self.cut, shapely.difference), found)
        raise TypeError(type(region).__name__)

    def resolve_avoided(self, region: Region) -> Resolved:
        """Return where a region to keep out of lies."""
        return self.resolve(region, AVOID_RADIUS)

    def joinable(self, regions: Iterable[Region], radius: float) -> list[Resolved]:
        """Return where regions lie that others are made of. Raises RegionError."""
        found = [self.resolve(region, radius) for region in regions]
        if any(part.area.wall_distance > 0.0 for one in found for part in one.parts):
            raise RegionError('the strip along all walls is not joined with other regions')
        return found

    def cut(self, operation: Cut, one: Resolved, other: Resolved) -> Resolved:
        """Return what an operation with another region leaves of the parts of one.

        A part of which all is left stays as exact as it is.
        """
        parts = []
        for part in one.parts:
            left = polygons_of(operation(part.area.outline, other.area.outline))
            whole = left.equals(part.area.outline)
            parts.append(part if whole else replace(self.open_part(left), reach=part.reach))
        return Resolved(tuple(part for part in parts if part.area.has_size) or (parts[0],))

    def place(self, name: str) -> Place:
        """Return the place of a name. Raises RegionError if there is none."""
        place = self._route.places.get(name)
        if place is None:
            raise RegionError(f'there is no place named {name!r}')
        return place

    def place_part(self, place: Place) -> RegionPart:
        """Return a place; a point is a disc of VISIT_RADIUS."""
        shape = shapely.force_2d(place.geometry)
        if shape.geom_type == 'Point' and not shape.is_empty:
            part = self.disc_part(shape.x, shape.y, VISIT_RADIUS)
            if place.is_object:
                return RegionPart(part.area, reach=OBJECT_REACH - VISIT_RADIUS)
            return part
        area = polygon_area(shape)
        return RegionPart(area, width_of(area.polygon), OBJECT_REACH if place.is_object else 0.0)

    def disc_part(self, x: float, y: float, radius: float) -> RegionPart:
        """Return a disc, and the inside of the cell that holds its centre."""
        grid_map = self._route.costmap.grid_map
        column, row = grid_map.world_to_cell(x, y)
        cell = NOTHING
        if grid_map.contains((column, row)):
            half = 0.5 - EDGE
            corners = shapely.box(column - half, row - half, column + half, row + half)
            cell = shapely.transform(corners, grid_map.grid_to_world)
        return RegionPart(disc_area(x, y, radius), 2.0 * radius, cell=cell)

    def open_part(self, polygon: BaseGeometry) -> RegionPart:
        """Return a polygon that may reach beyond the map; its width is that on the map."""
        on_map = polygons_of(shapely.intersection(polygon, self.map_outline))
        return RegionPart(polygon_area(polygon), width_of(on_map))

    def box_polygon(self, box: Box) -> BaseGeometry:
        """Return a box with its open sides beyond the map; empty if its sides are in no order."""
        low_x, low_y, high_x, high_y = shapely.bounds(self.map_outline)
        finite = [side for side in (box.x0, box.x1, box.y0, box.y1) if math.isfinite(side)]
        low = min(low_x, low_y, *finite) - BEYOND
        high = max(high_x, high_y, *finite) + BEYOND
        x0, x1 = max(box.x0, low), min(box.x1, high)
        y0, y1 = max(box.y0, low), min(box.y1, high)
        return shapely.box(x0, y0, x1, y1) if x0 < x1 and y0 < y1 else NOTHING

    def half_part(self, half: Half) -> RegionPart:
        """Return a half of the map or of a place."""
        whole = self.place_part(self.place(half.of)).area.outline if half.of else self.map_outline
        if whole.is_empty:
            return RegionPart(polygon_area(NOTHING))
        x0, y0, x1, y1 = shapely.bounds(whole)
        middle = np.array([(x0 + x1) / 2.0, (y0 + y1) / 2.0])
        if half.side in ROUTE_SIDES and not half.of:
            middle = np.array(self._route.begin)
        plane = self.half_plane(middle, self.direction(half.side))
        if not half.of:
            return self.open_part(plane)
        area = polygon_area(shapely.intersection(whole, plane))
        return RegionPart(area, width_of(area.polygon))

    def direction(self, side: str) -> NDArray[np.float64]:
        """Return the direction of a side, of length 1: the compass's or the direct way's.

        Raises RegionError for left and right where start and goal are one cell.
        """
        if side not in ROUTE_SIDES:
            return np.array(COMPASS_DIRECTIONS[side])
        start = np.array(self._route.begin)
        way = np.array(self._route.position(self._route.goal)) - start
        if not way.any():
            raise RegionError(f'start and goal are one cell, which has no {side} side')
        way /= np.hypot(*way)
        left = np.array([-way[1], way[0]])
        return left if side == 'left' else -left

    def half_plane(
        self, origin: NDArray[np.float64], direction: NDArray[np.float64]
    ) -> BaseGeometry:
        """Return everything beyond a point in a direction, as far as the map matters."""
        size = 2.0 * self.map_outline.length + BEYOND
        across = np.array([-direction[1], direction[0]]) * size
        ahead = direction * size
        corners = [origin - across, origin + across, origin + across + ahead]
        return shapely.Polygon([*corners, origin - across + ahead])

    def between_part(self, first: str, second: str) -> RegionPart:
        """Return the convex hull of two places without them."""
        shapes = [self.place_part(self.place(name)).area.outline for name in (first, second)]
        both = shapely.union_all(shapes)
        area = polygon_area(shapely.difference(shapely.convex_hull(both), both))
        return RegionPart(area, width_of(area.polygon))

    def along_part(self, place: str, width: float) -> RegionPart:
        """Return the strip around a place, or all that is near a wall."""
        if place == WALLS:
            if not self._walls.exist:
                raise RegionError('the map has no walls')
            return RegionPart(self._walls.zone(width), width)
        inner = self.place_part(self.place(place)).area.outline
        outer = shapely.buffer(inner, width, quad_segs=QUARTER_SIDES)
        return RegionPart(polygon_area(shapely.difference(outer, inner)), width)


def width_of(polygon: BaseGeometry) -> float:
    """Return the smaller side of the smallest rectangle, however turned, around a polygon."""
    if polygon.is_empty:
        return 0.0
    corners = shapely.get_coordinates(shapely.oriented_envelope(polygon))
    if len(corners) < 4:
        return 0.0
    return float(min(math.dist(corners[0], corners[1]), math.dist(corners[1], corners[2])))
