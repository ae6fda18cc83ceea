"""The regions of a suite's checks as shapely geometry, in code of its own.

Neither the enforcement nor the verification of instructions shares anything with it. The forms
are described in `suite`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from llm_astar_msgs_adapter.errors import LlmAstarError, short_repr
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import Place, Places
from llm_astar_planner.instructions.specification import (
    COMPASS,
    MAX_METRES,
    ROUTE_SIDES,
    SIDES,
    VISIT_RADIUS,
)
from llm_astar_planner.instructions.specification_json import (
    FAR,
    as_choice,
    as_mapping,
    as_number,
    as_numbers,
    as_text,
    box_from_json,
)
from llm_astar_planner.search.result import Cell
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

# Straight lines for a quarter of a circle; of a circle of 10 m the edge is 0.8 mm off.
QUARTER = 64
MAX_POINTS = 1000
MAX_PARTS = 100
# How deep unions and the like may be nested.
MAX_DEPTH = 4
# What a form may have besides its own name.
EXTRAS = {'half': ('of',), 'near': ('width',)}


class SuiteError(LlmAstarError, ValueError):
    """A suite that cannot be used; the message names the file, the instruction and the field."""


@dataclass(frozen=True, eq=False)
class SuiteMap:
    """A map of a suite with its places; `barrier_map` where its grid was made from one.

    `occupied_threshold` is the occupancy from which a cell counts as wall.
    """

    name: str
    grid_map: GridMap
    places: Places
    barrier_map: BarrierMap | None = None
    occupied_threshold: int = 65

    @cached_property
    def walls(self) -> NDArray[Any]:
        """The occupied cells as polygons [n], neighbours in a row joined."""
        blocked = np.pad(self.grid_map.blocked(self.occupied_threshold), ((0, 0), (1, 1)))
        steps = np.diff(blocked.astype(np.int8), axis=1)
        rows, first = np.nonzero(steps == 1)
        _, end = np.nonzero(steps == -1)
        corners = [(first, rows), (end, rows), (end, rows + 1), (first, rows + 1)]
        cells = np.stack([np.stack(corner, axis=1) for corner in corners], axis=1) - 0.5
        return np.asarray(shapely.polygons(self.grid_map.grid_to_world(cells).reshape(-1, 4, 2)))

    @cached_property
    def wall_tree(self) -> shapely.STRtree:
        """The walls, indexed for nearest neighbours."""
        return shapely.STRtree(self.walls)

    def position(self, cell: Cell) -> tuple[float, float]:
        """Return the centre (x, y) of a cell in metres."""
        x, y = self.grid_map.grid_to_world([cell])[0]
        return float(x), float(y)

    @cached_property
    def extent(self) -> tuple[float, float, float, float]:
        """The least box x0, y0, x1, y1 around the whole grid, in the map's frame."""
        width, height = self.grid_map.width - 0.5, self.grid_map.height - 0.5
        corners = [(-0.5, -0.5), (width, -0.5), (width, height), (-0.5, height)]
        points = self.grid_map.grid_to_world(corners)
        (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
        return float(x0), float(y0), float(x1), float(y1)


@dataclass(frozen=True, eq=False)
class Scene:
    """What the checks of one instruction refer to: a map, and start and goal in metres."""

    suite_map: SuiteMap
    start: tuple[float, float]
    goal: tuple[float, float]


def region_geometry(value: object, where: str, scene: Scene, depth: int = 0) -> BaseGeometry:
    """Return the geometry of a region; `where` names it in errors.

    Raises SuiteError or SpecificationError for a malformed, unknown or empty region.
    """
    fields = as_mapping(value, where)
    form = next((name for name in FORMS if name in fields), None)
    if form is None or depth > MAX_DEPTH:
        problem = f'has none of {", ".join(FORMS)}' if form is None else 'is nested too deep'
        raise SuiteError(f'{where}: {problem}')
    unknown = set(fields) - {form, *EXTRAS.get(form, ())}
    if unknown:
        raise SuiteError(f'{where}: {form} has no field {short_repr(min(unknown))}')
    geometry = FORMS[form](Reading(fields, form, f'{where}: {form}', scene, depth))
    if geometry.is_empty or not geometry.is_valid:
        raise SuiteError(f'{where}: {form}: is empty or crosses itself')
    return geometry


@dataclass(frozen=True, eq=False)
class Reading:
    """A region that is being read: its fields, its form, how errors name it, how deep it lies."""

    fields: Mapping[str, Any]
    form: str
    where: str
    scene: Scene
    depth: int

    @property
    def value(self) -> object:
        """The value of the field that gives the form."""
        return self.fields[self.form]

    @property
    def places(self) -> Places:
        """The map's places."""
        return self.scene.suite_map.places

    def part(self, value: object) -> BaseGeometry:
        """Return the geometry of a region inside this one."""
        return region_geometry(value, self.where, self.scene, self.depth + 1)


def read_place(reading: Reading) -> BaseGeometry:
    """Return the geometry of a named place. Raises SuiteError."""
    return place_geometry(find_place(reading.value, reading.where, reading.places))


def read_tag(reading: Reading) -> BaseGeometry:
    """Return the geometry of all places with a tag. Raises SuiteError."""
    tagged = find_tagged(reading.value, reading.where, reading.places)
    return shapely.union_all([place_geometry(place) for place in tagged])


def read_circle(reading: Reading) -> BaseGeometry:
    """Return a disc. Raises SpecificationError."""
    x, y, radius = as_numbers(reading.value, reading.where, 3)
    return disc(x, y, radius)


def read_rect(reading: Reading) -> BaseGeometry:
    """Return a box, whose open sides lie FAR away. Raises SpecificationError."""
    box = box_from_json(reading.value, reading.where)
    sides = (box.x0, box.y0, box.x1, box.y1)
    return shapely.box(*(min(max(side, -FAR), FAR) for side in sides))


def read_polygon(reading: Reading) -> BaseGeometry:
    """Return a polygon. Raises SuiteError or SpecificationError."""
    return polygon(reading.value, reading.where)


def read_half(reading: Reading) -> BaseGeometry:
    """Return half of the map's extent, of a place, or of the plane beside the direct way."""
    of, where = reading.fields.get('of'), reading.where
    side = as_choice(reading.value, where, COMPASS if of is not None else SIDES)
    if side in ROUTE_SIDES:
        return half_plane(reading.scene.start, reading.scene.goal, side, where)
    if of is None:
        return box_half(side, reading.scene.suite_map.extent)
    place = place_geometry(find_place(of, f'{where}: of', reading.places))
    return box_half(side, place.bounds).intersection(place)


def read_union(reading: Reading) -> BaseGeometry:
    """Return several regions together. Raises SuiteError or SpecificationError."""
    return shapely.union_all(parts_of(reading))


def read_between(reading: Reading) -> BaseGeometry:
    """Return the convex hull of two regions without them. Raises SuiteError."""
    parts = parts_of(reading)
    if len(parts) != 2:
        raise SuiteError(f'{reading.where}: is not a list of two regions')
    both = shapely.union_all(parts)
    return both.convex_hull.difference(both)


def read_near(reading: Reading) -> BaseGeometry:
    """Return all within some metres of a region. Raises SuiteError or SpecificationError."""
    width = as_number(reading.fields.get('width'), f'{reading.where}: width', 0.0, MAX_METRES)
    return reading.part(reading.value).buffer(width, quad_segs=QUARTER)


def read_walls(reading: Reading) -> BaseGeometry:
    """Return all within some metres of occupied cells. Raises SpecificationError."""
    width = as_number(reading.value, reading.where, 0.0, MAX_METRES)
    return shapely.union_all(shapely.buffer(reading.scene.suite_map.walls, width))


FORMS: dict[str, Callable[[Reading], BaseGeometry]] = {
    'place': read_place,
    'tag': read_tag,
    'circle': read_circle,
    'rect': read_rect,
    'polygon': read_polygon,
    'half': read_half,
    'union': read_union,
    'between': read_between,
    'near': read_near,
    'walls': read_walls,
}


def parts_of(reading: Reading) -> list[BaseGeometry]:
    """Return the geometries of a list of regions; raises as `region_geometry` does."""
    if not isinstance(reading.value, list) or not 1 <= len(reading.value) <= MAX_PARTS:
        raise SuiteError(f'{reading.where}: is not a list of 1 to {MAX_PARTS} regions')
    return [reading.part(item) for item in reading.value]


def find_place(name: object, where: str, places: Places) -> Place:
    """Return a place by name or alias. Raises SuiteError, which lists the map's places."""
    place = places.get(as_text(name, where))
    if place is None:
        known = ', '.join(place.name for place in places) or 'none'
        raise SuiteError(f'{where}: {name!r} is not a place of the map, which has: {known}')
    return place


def find_tagged(tag: object, where: str, places: Places) -> tuple[Place, ...]:
    """Return the places with a tag. Raises SuiteError where there are none."""
    tagged = places.with_tag(as_text(tag, where))
    if not tagged:
        known = ', '.join(places.tags) or 'none'
        raise SuiteError(
            f'{where}: {tag!r} is not a kind or tag of the places, which have: {known}'
        )
    return tagged


def place_geometry(place: Place) -> BaseGeometry:
    """Return the polygon of a place; of a point, the disc in which it counts as visited."""
    if isinstance(place.geometry, shapely.Point):
        return disc(place.geometry.x, place.geometry.y, VISIT_RADIUS)
    return place.geometry


def disc(x: float, y: float, radius: float) -> BaseGeometry:
    """Return a disc as a polygon; empty where the radius is not above 0."""
    return shapely.Point(x, y).buffer(max(radius, 0.0), quad_segs=QUARTER)


def polygon(value: object, where: str) -> BaseGeometry:
    """Return a polygon from its corners. Raises SuiteError or SpecificationError."""
    if not isinstance(value, list) or not 3 <= len(value) <= MAX_POINTS:
        raise SuiteError(f'{where}: is not a list of 3 to {MAX_POINTS} points')
    return shapely.Polygon([as_numbers(point, where, 2) for point in value])


def box_half(side: str, bounds: tuple[float, float, float, float]) -> BaseGeometry:
    """Return the half of a box on a compass side."""
    x0, y0, x1, y1 = bounds
    x, y = (x0 + x1) / 2.0, (y0 + y1) / 2.0
    halves = {
        'north': (x0, y, x1, y1),
        'south': (x0, y0, x1, y),
        'east': (x, y0, x1, y1),
        'west': (x0, y0, x, y1),
    }
    return shapely.box(*halves[side])


def half_plane(
    start: tuple[float, float], goal: tuple[float, float], side: str, where: str
) -> BaseGeometry:
    """Return all to the left or right of the line from start to goal, as far as FAR."""
    length = math.dist(start, goal)
    if length == 0.0:
        raise SuiteError(f'{where}: {side}: start and goal are the same point')
    along = (np.array(goal) - start) / length * FAR
    across = np.array([-along[1], along[0]]) * (1.0 if side == 'left' else -1.0)
    first, last = np.array(start) - along, np.array(goal) + along
    return shapely.Polygon([first, last, last + across, first + across])
