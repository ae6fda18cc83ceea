"""The maps of a suite, and the regions of its checks as shapely geometry.

Places, halves and boxes lie where the verification of instructions has them; the tests hold them
against a reading of their own. The forms are described in `suite`.
"""

from __future__ import annotations

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
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions import specification as spec
from llm_astar_planner.instructions import specification_json as checked
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.verification.geometry import disc_area, polyline
from llm_astar_planner.instructions.verification.regions import Regions
from llm_astar_planner.instructions.verification.walls import Walls
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

    @property
    def costmap(self) -> Costmap:
        """The map for a robot without a body."""
        return Costmap(self.grid_map, CostmapConfig(occupied_threshold=self.occupied_threshold))

    @cached_property
    def extent(self) -> tuple[float, float, float, float]:
        """The least box x0, y0, x1, y1 around the whole grid, in the map's frame."""
        x0, y0, x1, y1 = Scene(self, (0, 0), (0, 0)).regions.map_outline.bounds
        return x0, y0, x1, y1


@dataclass(frozen=True, eq=False)
class Scene:
    """What the checks of one instruction refer to: a map, and the cells of start and goal."""

    suite_map: SuiteMap
    start: Cell
    goal: Cell

    @cached_property
    def regions(self) -> Regions:
        """Where the verification has regions."""
        route = Route(self.suite_map.costmap, self.start, self.goal, self.suite_map.places)
        return Regions(route, Walls(route.costmap, polyline(route.position(self.start))))


def region_geometry(value: object, where: str, scene: Scene, depth: int = 0) -> BaseGeometry:
    """Return the geometry of a region; `where` names it in errors.

    Raises SuiteError or SpecificationError for a malformed, unknown or empty region.
    """
    fields = checked.as_mapping(value, where)
    form = next((name for name in FORMS if name in fields), None)
    if form is None or depth > MAX_DEPTH:
        problem = f'has none of {", ".join(FORMS)}' if form is None else 'is nested too deep'
        raise SuiteError(f'{where}: {problem}')
    unknown = set(fields) - {form, *EXTRAS.get(form, ())}
    if unknown:
        raise SuiteError(f'{where}: {form} has no field {short_repr(min(unknown))}')
    geometry = FORMS[form](RegionFields(fields, form, f'{where}: {form}', scene, depth))
    if geometry.is_empty or not geometry.is_valid:
        raise SuiteError(f'{where}: {form}: is empty or crosses itself')
    return geometry


@dataclass(frozen=True, eq=False)
class RegionFields:
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

    def resolved(self, region: spec.Region) -> BaseGeometry:
        """Return where the verification has a region."""
        return self.scene.regions.resolve(region).area.outline

    def part(self, value: object) -> BaseGeometry:
        """Return the geometry of a region inside this one."""
        return region_geometry(value, self.where, self.scene, self.depth + 1)


def read_place(fields: RegionFields) -> BaseGeometry:
    """Return the geometry of a named place. Raises SuiteError."""
    place = find_place(fields.value, fields.where, fields.places)
    return fields.resolved(spec.NamedPlace(place.name))


def read_tag(fields: RegionFields) -> BaseGeometry:
    """Return the geometry of all places with a tag. Raises SuiteError."""
    find_tagged(fields.value, fields.where, fields.places)
    return fields.resolved(spec.Tagged(str(fields.value)))


def read_circle(fields: RegionFields) -> BaseGeometry:
    """Return a disc, empty where its radius is not above 0. Raises SpecificationError."""
    return disc_area(*checked.as_numbers(fields.value, fields.where, 3)).outline


def read_rect(fields: RegionFields) -> BaseGeometry:
    """Return a box, whose open sides lie far away. Raises SpecificationError."""
    return fields.resolved(checked.box_from_json(fields.value, fields.where))


def read_polygon(fields: RegionFields) -> BaseGeometry:
    """Return a polygon from its corners. Raises SuiteError or SpecificationError."""
    corners, where = fields.value, fields.where
    if not isinstance(corners, list) or not 3 <= len(corners) <= MAX_POINTS:
        raise SuiteError(f'{where}: is not a list of 3 to {MAX_POINTS} points')
    return shapely.Polygon([checked.as_numbers(point, where, 2) for point in corners])


def read_half(fields: RegionFields) -> BaseGeometry:
    """Return half of the map's extent, of a place, or of the plane beside the direct way."""
    of, where, scene = fields.fields.get('of'), fields.where, fields.scene
    side = checked.as_choice(fields.value, where, spec.SIDES if of is None else spec.COMPASS)
    if of is not None:
        return fields.resolved(spec.Half(side, find_place(of, f'{where}: of', fields.places).name))
    if side in spec.COMPASS:
        return fields.resolved(spec.Half(side)) & shapely.box(*scene.suite_map.extent)
    if scene.start == scene.goal:
        raise SuiteError(f'{where}: {side}: start and goal are the same point')
    return fields.resolved(spec.Half(side))


def read_union(fields: RegionFields) -> BaseGeometry:
    """Return several regions together. Raises SuiteError or SpecificationError."""
    return shapely.union_all(parts_of(fields))


def read_between(fields: RegionFields) -> BaseGeometry:
    """Return the convex hull of two regions without them. Raises SuiteError."""
    parts = parts_of(fields)
    if len(parts) != 2:
        raise SuiteError(f'{fields.where}: is not a list of two regions')
    both = shapely.union_all(parts)
    return both.convex_hull.difference(both)


def read_near(fields: RegionFields) -> BaseGeometry:
    """Return all within some metres of a region. Raises SuiteError or SpecificationError."""
    width = checked.as_number(
        fields.fields.get('width'), f'{fields.where}: width', 0.0, spec.MAX_METRES
    )
    return fields.part(fields.value).buffer(width, quad_segs=QUARTER)


def read_walls(fields: RegionFields) -> BaseGeometry:
    """Return all within some metres of occupied cells. Raises SpecificationError."""
    width = checked.as_number(fields.value, fields.where, 0.0, spec.MAX_METRES)
    return shapely.union_all(shapely.buffer(fields.scene.suite_map.walls, width))


FORMS: dict[str, Callable[[RegionFields], BaseGeometry]] = {
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


def parts_of(fields: RegionFields) -> list[BaseGeometry]:
    """Return the geometries of a list of regions; raises as `region_geometry` does."""
    if not isinstance(fields.value, list) or not 1 <= len(fields.value) <= MAX_PARTS:
        raise SuiteError(f'{fields.where}: is not a list of 1 to {MAX_PARTS} regions')
    return [fields.part(item) for item in fields.value]


def find_place(name: object, where: str, places: Places) -> Place:
    """Return a place by name or alias. Raises SuiteError, which lists the map's places."""
    place = places.get(checked.as_text(name, where))
    if place is None:
        known = ', '.join(place.name for place in places) or 'none'
        raise SuiteError(f'{where}: {name!r} is not a place of the map, which has: {known}')
    return place


def find_tagged(tag: object, where: str, places: Places) -> tuple[Place, ...]:
    """Return the places with a tag. Raises SuiteError where there are none."""
    tagged = places.with_tag(checked.as_text(tag, where))
    if not tagged:
        known = ', '.join(places.tags) or 'none'
        raise SuiteError(
            f'{where}: {tag!r} is not a kind or tag of the places, which have: {known}'
        )
    return tagged
