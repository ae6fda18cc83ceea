# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Regions of a specification as polygons in metres, as enforcement sees them.

Verification has its own reading of the same definitions.
"""

import math
from collections.abc import Callable
from functools import partial, reduce
from typing import NamedTuple

import numpy as np
import shapely
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.places import Place
from shapely.geometry.base import BaseGeometry

from llm_astar_planner.instructions import regions
from llm_astar_planner.instructions.regions import VISIT_RADIUS, Region
from llm_astar_planner.instructions.route import Route

# Directions of the sides in the map's frame, as in REP-103.
DIRECTIONS = {'north': (0.0, 1.0), 'south': (0.0, -1.0), 'east': (1.0, 0.0), 'west': (-1.0, 0.0)}
# A circle is a polygon of so many corners to a quarter, drawn around it.
QUARTER = 32
Cut = Callable[[BaseGeometry, BaseGeometry], BaseGeometry]
AROUND = 1.0 / math.cos(math.pi / (4 * QUARTER))


class NoRegionError(LlmAstarError, ValueError):
    """A region that this map does not have; the message says which and why."""


class Part(NamedTuple):
    """A part of a region.

    One with a `reach` is an object, visited within so many metres; a `shallow` one is visited
    wherever it is entered.
    """

    polygon: BaseGeometry
    reach: float = 0.0
    shallow: bool = False

    @property
    def visited(self) -> BaseGeometry:
        """Where it counts as visited."""
        if self.reach:
            return self.polygon.buffer(self.reach, quad_segs=QUARTER)
        return self.polygon if self.shallow else inner(self.polygon)


def region_polygon(region: Region, route: Route, default_radius: float) -> BaseGeometry:
    """Return a region as a polygon, or several, in metres.

    `default_radius` is for points without a radius. Raises NoRegionError for an unknown place or
    tag, and for walls, which are cells and no polygon.
    """
    return shapely.union_all([part.polygon for part in parts_of(region, route, default_radius)])


def visit_polygon(region: Region, route: Route) -> BaseGeometry:
    """Return where the path has to have a point for a visit. Raises as `region_polygon`.

    Well inside an area, near an object, and within the radius of a point.
    """
    return shapely.union_all([part.visited for part in parts_of(region, route)])


def entered_polygon(region: Region, route: Route) -> BaseGeometry:
    """Return where a path has entered a region: any part of an area, or near an object."""
    return shapely.union_all(
        [part.visited if part.reach else part.polygon for part in parts_of(region, route)]
    )


def parts_of(region: Region, route: Route, radius: float = VISIT_RADIUS) -> list[Part]:
    """Return the parts of a region; a visit takes any one. `radius` is that of bare points."""
    match region:
        case regions.NamedPlace(name):
            return [place_part(find_place(name, route))]
        case regions.Tagged(tag):
            places = route.places.with_tag(tag)
            if not places:
                raise NoRegionError(f'no place is tagged {tag!r}')
            return [place_part(place) for place in places]
        case regions.AnyOf(members):
            return [part for one in members for part in parts_of(one, route, radius)]
        case regions.AllOf(members):
            # An object stays one, whatever it has in common with.
            found = [parts_of(one, route, radius) for one in members]
            first, *others = sorted(found, key=lambda parts: not all(p.reach for p in parts))
            return reduce(partial(cut, shapely.intersection), others, first)
        case regions.Except(inside, others):
            found = [parts_of(one, route, radius) for one in others]
            return reduce(partial(cut, shapely.difference), found, parts_of(inside, route, radius))
        case regions.Disc(x, y, given):
            return [disc(shapely.Point(x, y), given or radius)]
        case regions.End(end):
            point = route.begin if end == 'start' else route.position(route.goal)
            return [disc(shapely.Point(point), VISIT_RADIUS)]
        case regions.Box():
            return [Part(box_polygon(region, route))]
        case regions.Half(side, of):
            return [Part(half_polygon(side, of, route))]
        case regions.Between(first, second):
            both = shapely.union_all([find_polygon(name, route) for name in (first, second)])
            return [Part(shapely.convex_hull(both).difference(both))]
        case regions.Along(place, width) if place != regions.WALLS:
            polygon = find_polygon(place, route)
            return [Part(grown(polygon, width).difference(polygon))]
    raise NoRegionError('the strip along all walls is no polygon')


def disc(point: BaseGeometry, radius: float) -> Part:
    """Return a disc."""
    return Part(grown(point, radius), shallow=True)


def cut(operation: Cut, parts: list[Part], others: list[Part]) -> list[Part]:
    """Return what an operation with other parts leaves of parts."""
    shape = shapely.union_all([part.polygon for part in others])
    left = [(part, operation(part.polygon, shape)) for part in parts]
    return [
        part if polygon.equals(part.polygon) else Part(polygon, part.reach)
        for part, polygon in left
    ]


def place_part(place: Place) -> Part:
    """Return a place."""
    is_area = place.geometry.geom_type in ('Polygon', 'MultiPolygon')
    reach = regions.OBJECT_REACH if is_area else regions.OBJECT_REACH - VISIT_RADIUS
    return Part(place_polygon(place), reach * place.is_object, shallow=not is_area)


def inner(polygon: BaseGeometry) -> BaseGeometry:
    """Return the part of an area that is deep enough inside to count as visited."""
    box = shapely.minimum_rotated_rectangle(polygon)
    if box.geom_type != 'Polygon' or box.is_empty:
        return polygon
    corners = shapely.get_coordinates(box)
    width = min(np.hypot(*(corners[1] - corners[0])), np.hypot(*(corners[2] - corners[1])))
    deep = polygon.buffer(-min(regions.VISIT_DEPTH, width / 4))
    return polygon if deep.is_empty else deep


def grown(geometry: BaseGeometry, distance: float) -> BaseGeometry:
    """Return what lies within a distance, by polygons drawn around the circles."""
    return geometry.buffer(distance * AROUND, quad_segs=QUARTER)


def find_place(name: str, route: Route) -> Place:
    """Return the place of a name. Raises NoRegionError where there is none."""
    place = route.places.get(name)
    if place is None:
        raise NoRegionError(f'there is no place named {name!r}')
    return place


def find_polygon(name: str, route: Route) -> BaseGeometry:
    """Return the polygon of the place of a name. Raises NoRegionError where there is none."""
    return place_polygon(find_place(name, route))


def place_polygon(place: Place) -> BaseGeometry:
    """Return the polygon of a place; a point or a line has a width."""
    if place.geometry.geom_type in ('Polygon', 'MultiPolygon'):
        return place.geometry
    return grown(place.geometry, VISIT_RADIUS)


def map_polygon(route: Route) -> BaseGeometry:
    """Return the outline of the map."""
    grid_map = route.costmap.grid_map
    x, y = grid_map.width - 0.5, grid_map.height - 0.5
    corners = [(-0.5, -0.5), (x, -0.5), (x, y), (-0.5, y)]
    return shapely.Polygon(grid_map.grid_to_world(corners))


def box_polygon(box: regions.Box, route: Route) -> BaseGeometry:
    """Return a box whose open sides end beyond the map."""
    bounds = np.array(map_polygon(route).bounds)
    low = np.maximum(box.sides[:2], bounds[:2] - 1.0)
    high = np.minimum(box.sides[2:], bounds[2:] + 1.0)
    return shapely.box(*low, *high) if (low < high).all() else shapely.Polygon()


def half_polygon(side: str, of: str, route: Route) -> BaseGeometry:
    """Return the half of the map, or of the place `of`, on a side."""
    whole = find_polygon(of, route) if of else map_polygon(route)
    x0, y0, x1, y1 = whole.bounds
    here = route.begin if side in regions.ROUTE_SIDES else ((x0 + x1) / 2, (y0 + y1) / 2)
    return whole.intersection(half_plane(here, side_direction(side, route), whole))


def half_plane(
    point: tuple[float, float], direction: tuple[float, float], whole: BaseGeometry
) -> BaseGeometry:
    """Return the part of the plane that lies in a direction from a point, as far as `whole`."""
    x0, y0, x1, y1 = whole.bounds
    reach = 2.0 * (math.dist((x0, y0), (x1, y1)) + math.dist(point, (x0, y0)) + 1.0)
    forward = reach * np.array(direction)
    aside = np.array([-forward[1], forward[0]])
    here = np.array(point)
    return shapely.Polygon(
        [here - aside, here - aside + forward, here + aside + forward, here + aside]
    )


def side_direction(side: str, route: Route) -> tuple[float, float]:
    """Return the unit vector towards a side; left and right are of the way from start to goal."""
    if side not in regions.ROUTE_SIDES:
        return DIRECTIONS[side]
    (x0, y0), (x1, y1) = route.begin, route.position(route.goal)
    length = math.dist((x0, y0), (x1, y1))
    if length == 0.0:
        raise NoRegionError(f'{side}: start and goal are the same, so the way has no sides')
    x, y = (x1 - x0) / length, (y1 - y0) / length
    return (-y, x) if side == 'left' else (y, -x)


def ray(region: Region, side: str, route: Route, *, opposite: bool = False) -> BaseGeometry:
    """Return the line from a region's centre to the edge of the map on a side, or the other one.

    Raises NoRegionError as `region_polygon`, and for an empty region.
    """
    centre = region_polygon(region, route, VISIT_RADIUS).centroid
    if centre.is_empty:
        raise NoRegionError('the region has no area on this map')
    x, y = side_direction(side, route)
    sign = -1.0 if opposite else 1.0
    x0, y0, x1, y1 = map_polygon(route).union(centre).bounds
    reach = math.dist((x0, y0), (x1, y1)) + 1.0
    return shapely.LineString([centre, (centre.x + sign * x * reach, centre.y + sign * y * reach)])
