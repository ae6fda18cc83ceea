# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The machine checks of a suite: what a path that follows an instruction fulfils.

They are measured on the path's own straight pieces, in code apart from the enforcement and from
what the verification makes of a clause. Places, halves and boxes lie where the verification has
them; the tests hold them against a reading of their own. Kinds of checks and forms of regions are
described in `suite`.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple, get_type_hints

import numpy as np
import shapely
from llm_astar_msgs_adapter.errors import short_repr
from llm_astar_planner.instructions import fields, regions
from llm_astar_planner.instructions.verification import geometry as plane
from llm_astar_planner.instructions.verification.geometry import QUARTER_SIDES, Polyline, Spans
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from llm_astar_lab.instruct_bench.maps import Scene, SuiteError, SuiteMap, as_list

# Metres. A measured length this close to its limit keeps it.
ROUNDING = 1e-6
MAX_TIMES = 1000
# The limits of entries, where a check has none.
COUNTS = {'at_least': 0, 'at_most': MAX_TIMES}
MAX_REGIONS = 16
MAX_POINTS = 1000
MAX_PARTS = 100
# How deep unions and the like may be nested.
MAX_DEPTH = 4
# What a form of a region may have besides its own name.
EXTRAS = {'half': ('of',), 'near': ('width',)}
# Fields that every check may have.
COMMON = {'check', 'clause', 'least_possible', 'note'}
NOTHING = np.array([], dtype=np.object_)


@dataclass(frozen=True, eq=False)
class Entry:
    """A check or a region that is being read: its fields, how errors name it, how deep it lies.

    `value` is that of the field that gives the form of a region.
    """

    values: Mapping[str, Any]
    where: str
    scene: Scene
    value: Any = None
    depth: int = 0

    @property
    def suite_map(self) -> SuiteMap:
        """The map."""
        return self.scene.suite_map

    def resolved(self, region: regions.Region) -> BaseGeometry:
        """Return where the verification has a region."""
        return self.scene.regions.resolve(region).area.outline

    def part(self, value: object) -> BaseGeometry:
        """Return the geometry of a region inside this one."""
        return region_geometry(value, self.where, self.scene, self.depth + 1)

    def parts(self) -> list[BaseGeometry]:
        """Return the geometries of a list of regions; raises as `region_geometry` does."""
        return [
            self.part(item) for item in as_list(self.value, self.where, 1, MAX_PARTS, 'regions')
        ]

    def given(self, name: str, default: object = None) -> tuple[Any, str]:
        """Return what a field holds, and how errors name it."""
        return self.values.get(name, default), f'{self.where}: {name}'

    def region(self, name: str) -> BaseGeometry:
        """Return the region in a field, grown by `tol` metres if the check has that field."""
        return self.grown(*self.given(name))

    def grown(self, value: object, where: str) -> BaseGeometry:
        """Return a region, grown by `tol` metres. Raises SuiteError if it is empty."""
        tol = self.number('tol', 0.0, -fields.MAX_METRES)
        geometry = region_geometry(value, where, self.scene)
        if tol:
            geometry = geometry.buffer(tol, quad_segs=QUARTER_SIDES)
        if geometry.is_empty:
            raise SuiteError(f'{where}: nothing lies {-tol:g} m deep in it')
        return geometry

    def number(self, name: str, default: float | None = None, least: float = 0.0) -> float:
        """Return a number from `least` to MAX_METRES. Raises SpecificationError."""
        return fields.as_number(*self.given(name, default), least, fields.MAX_METRES)


def region_geometry(value: object, where: str, scene: Scene, depth: int = 0) -> BaseGeometry:
    """Return the geometry of a region; `where` names it in errors.

    Raises SuiteError or SpecificationError for a malformed, unknown or empty region.
    """
    values = fields.as_mapping(value, where)
    form = next((name for name in FORMS if name in values), None)
    if form is None or depth > MAX_DEPTH:
        problem = f'has none of {", ".join(FORMS)}' if form is None else 'is nested too deep'
        raise SuiteError(f'{where}: {problem}')
    unknown = set(values) - {form, *EXTRAS.get(form, ())}
    if unknown:
        raise SuiteError(f'{where}: {form} has no field {short_repr(min(unknown))}')
    where = f'{where}: {form}'
    geometry = FORMS[form](Entry(values, where, scene, values[form], depth))
    if geometry.is_empty or not geometry.is_valid:
        raise SuiteError(f'{where}: is empty or crosses itself')
    return geometry


def read_place(entry: Entry) -> BaseGeometry:
    """Return the geometry of a named place. Raises SuiteError."""
    name = entry.suite_map.place_name(entry.value, entry.where)
    return entry.resolved(regions.NamedPlace(name))


def read_tag(entry: Entry) -> BaseGeometry:
    """Return the geometry of all places with a tag. Raises SuiteError."""
    entry.suite_map.tagged_names(entry.value, entry.where)
    return entry.resolved(regions.Tagged(entry.value))


def read_circle(entry: Entry) -> BaseGeometry:
    """Return a circle. Raises SpecificationError."""
    return plane.disc_area(*fields.as_numbers(entry.value, entry.where, 3)).outline


def read_polygon(entry: Entry) -> BaseGeometry:
    """Return a polygon from its corners. Raises SuiteError or SpecificationError."""
    corners = as_list(entry.value, entry.where, 3, MAX_POINTS, 'points')
    return shapely.Polygon([fields.as_numbers(point, entry.where, 2) for point in corners])


def read_half(entry: Entry) -> BaseGeometry:
    """Return half of the map's extent, of a place, or of the plane beside the direct way."""
    (of, of_where), where, scene = entry.given('of'), entry.where, entry.scene
    side = fields.as_choice(entry.value, where, regions.SIDES if of is None else regions.COMPASS)
    if of is not None:
        return entry.resolved(regions.Half(side, entry.suite_map.place_name(of, of_where)))
    if side in regions.COMPASS:
        return entry.resolved(regions.Half(side)) & shapely.box(*scene.suite_map.extent)
    if scene.start == scene.goal:
        raise SuiteError(f'{where}: {side}: start and goal are the same point')
    return entry.resolved(regions.Half(side))


def read_between(entry: Entry) -> BaseGeometry:
    """Return the convex hull of two regions without them. Raises SuiteError."""
    parts = entry.parts()
    if len(parts) != 2:
        raise SuiteError(f'{entry.where}: is not a list of two regions')
    both = shapely.union_all(parts)
    return both.convex_hull.difference(both)


def read_near(entry: Entry) -> BaseGeometry:
    """Return all within some metres of a region. Raises SuiteError or SpecificationError."""
    width = entry.number('width')
    return entry.part(entry.value).buffer(width, quad_segs=QUARTER_SIDES)


def read_walls(entry: Entry) -> BaseGeometry:
    """Return all within some metres of occupied cells. Raises SpecificationError."""
    width = fields.as_number(entry.value, entry.where, 0.0, fields.MAX_METRES)
    return shapely.union_all(shapely.buffer(entry.scene.suite_map.walls, width))


FORMS: dict[str, Callable[[Entry], BaseGeometry]] = {
    'place': read_place,
    'tag': read_tag,
    'circle': read_circle,
    'rect': lambda entry: entry.resolved(regions.box_from_json(entry.value, entry.where)),
    'polygon': read_polygon,
    'half': read_half,
    'union': lambda entry: shapely.union_all(entry.parts()),
    'between': read_between,
    'near': read_near,
    'walls': read_walls,
}


def read_opened(entry: Entry, name: str) -> BaseGeometry:
    """Read a region without its edge, so that what lies on the edge lies outside; not grown."""
    geometry = region_geometry(*entry.given(name), entry.scene)
    return geometry.buffer(-plane.EDGE, join_style='mitre')


def read_regions(entry: Entry, name: str) -> list[BaseGeometry]:
    """Read regions, grown by `tol` metres."""
    listed, where = entry.given(name)
    as_list(listed, where, 2, MAX_REGIONS, 'regions')
    return [entry.grown(value, f'{where}[{number}]') for number, value in enumerate(listed)]


def read_segment(entry: Entry, name: str) -> BaseGeometry:
    """Read a segment. Raises SuiteError where it has no length."""
    x0, y0, x1, y1 = fields.as_numbers(*entry.given(name), 4)
    if (x0, y0) == (x1, y1):
        raise SuiteError(f'{entry.where}: {name}: is a point')
    return shapely.LineString([(x0, y0), (x1, y1)])


def read_times(entry: Entry, name: str) -> int | str:
    """Read how often a segment is met: a number or `some`."""
    times, where = entry.given(name)
    if times == 'some' or (type(times) is int and 0 <= times <= MAX_TIMES):
        return times  # type: ignore[no-any-return]
    raise SuiteError(f'{where}: {short_repr(times)} is neither a number nor "some"')


def read_count(entry: Entry, name: str) -> int:
    """Read a number of entries; without it there is no limit. Raises SpecificationError."""
    return fields.as_count(*entry.given(name, COUNTS[name]), MAX_TIMES)


def read_limit(entry: Entry, name: str) -> float:
    """Read one of the limits of a length, inf where only the other one is given."""
    if name in entry.values:
        return entry.number(name)
    if not {'of_direct', 'metres'} & set(entry.values):
        raise SuiteError(f'{entry.where}: has neither of_direct nor metres')
    return math.inf


# What the fields of checks are, and what reads them.
Region = Annotated[BaseGeometry, Entry.region]
Opened = Annotated[BaseGeometry, read_opened]
Regions = Annotated[list[BaseGeometry], read_regions]
Segment = Annotated[BaseGeometry, read_segment]
Times = Annotated[int | str, read_times]
Count = Annotated[int, read_count]
Metres = Annotated[float, Entry.number]
Limit = Annotated[float, read_limit]
Ends = Annotated[float, lambda entry, name: entry.number(name, 0.0)]


def spans_in(path: Polyline, geometry: BaseGeometry) -> Spans:
    """Return where a path lies in closed geometry."""
    return plane.joined(path.spans_in_polygon(geometry))


def without_ends(path: Polyline, ends: float) -> NDArray[np.object_]:
    """Return the straight pieces without the first and last `ends` metres; [] if all of it is."""
    if ends <= 0.0 or path.length == 0.0:
        return path.segments
    return path.part(ends, path.length - ends).segments if 2.0 * ends < path.length else NOTHING


class Verdict(NamedTuple):
    """Whether a path fulfils a check, and the measured fact in a few words."""

    holds: bool
    detail: str


class Walk(NamedTuple):
    """A path in metres, the length in metres of the path without instruction, and the scene."""

    path: Polyline
    direct_length: float
    scene: Scene


def inside_max(walk: Walk, region: Opened, metres: Metres) -> Verdict:
    """Check that at most so many metres lie inside a region."""
    inside = plane.total(spans_in(walk.path, region))
    return Verdict(inside <= metres + ROUNDING, f'{inside:.2f} m inside, at most {metres:g}')


def outside_max(walk: Walk, region: Region, metres: Metres) -> Verdict:
    """Check that at most so many metres lie outside of a region."""
    outside = max(walk.path.length - plane.total(spans_in(walk.path, region)), 0.0)
    return Verdict(outside <= metres + ROUNDING, f'{outside:.2f} m outside, at most {metres:g}')


def touch(walk: Walk, region: Region) -> Verdict:
    """Check that the path comes near enough to a region, or deep enough into it."""
    missing = float(shapely.distance(walk.path.segments, region).min())
    touched = missing <= ROUNDING
    return Verdict(touched, 'touched' if touched else f'missed by {missing:.2f} m')


def order(walk: Walk, regions: Regions) -> Verdict:
    """Check that the path touches regions in order."""
    along = 0.0
    for number, region in enumerate(regions):
        before, along = along, plane.first_from(spans_in(walk.path, region), along)
        if math.isinf(along):
            return Verdict(False, f'regions[{number}] is not touched after {before:.2f} m')
    return Verdict(True, f'all in order after {along:.2f} m')


def visit_before(walk: Walk, first: Region, second: Opened) -> Verdict:
    """Check that the path enters a region only after it touched another."""
    touched, entered = (plane.first_from(spans_in(walk.path, one), 0.0) for one in (first, second))
    if math.isinf(entered):
        return Verdict(True, 'second is not entered')
    detail = f'first touched at {touched:.2f} m, second entered at {entered:.2f} m'
    return Verdict(touched <= entered + ROUNDING, detail)


def visit_after(walk: Walk, first: Opened, second: Region) -> Verdict:
    """Check that the path touches a region after it was in another for the last time."""
    inside = spans_in(walk.path, first)
    if not len(inside):
        return Verdict(True, 'first is not entered')
    left, touched = inside[-1, 1], plane.first_from(spans_in(walk.path, second), inside[-1, 1])
    detail = f'first left at {left:.2f} m, second touched at {touched:.2f} m'
    return Verdict(math.isfinite(touched), detail)


def never_after(walk: Walk, first: Opened, second: Opened, metres: Metres) -> Verdict:
    """Check that at most so many metres lie inside a region after another was entered."""
    entered = plane.first_from(spans_in(walk.path, first), 0.0)
    if math.isinf(entered):
        return Verdict(True, 'first is not entered')
    inside = plane.total(spans_in(walk.path, second).clip(min=entered))
    return Verdict(inside <= metres + ROUNDING, f'{inside:.2f} m inside after the first')


def entries(walk: Walk, region: Region, apart: Metres, at_least: Count, at_most: Count) -> Verdict:
    """Check how often the path comes to a region from more than `apart` metres outside of it."""
    near = spans_in(walk.path, region.buffer(apart, quad_segs=QUARTER_SIDES))
    inside = spans_in(walk.path, region)
    found = len(np.unique(np.searchsorted(near[:, 0], inside[:, 0] + ROUNDING)))
    return Verdict(at_least <= found <= at_most, f'entered {found} times')


def end_in(walk: Walk, region: Region) -> Verdict:
    """Check that the last point lies in a region."""
    off = float(region.distance(shapely.Point(walk.path.corners[-1])))
    return Verdict(off <= ROUNDING, f'ends {off:.2f} m off' if off else 'ends inside')


def dist_min(walk: Walk, region: Region, metres: Metres, ends: Ends) -> Verdict:
    """Check that the path keeps away from a region, its ends excepted."""
    return keeps_away(shapely.distance(without_ends(walk.path, ends), region), metres)


def wall_dist_min(walk: Walk, metres: Metres, ends: Ends) -> Verdict:
    """Check that the path keeps away from all occupied cells, its ends excepted."""
    _, distances = walk.scene.suite_map.wall_tree.query_nearest(
        without_ends(walk.path, ends), return_distance=True, all_matches=False
    )
    return keeps_away(distances, metres)


def keeps_away(distances: NDArray[np.float64], metres: float) -> Verdict:
    """Check that all distances in metres have at least the limit."""
    nearest = float(distances.min(initial=math.inf))
    return Verdict(nearest >= metres - ROUNDING, f'{nearest:.2f} m away, at least {metres:g}')


def cross(walk: Walk, segment: Segment, times: Times) -> Verdict:
    """Check that the path meets a segment so many times."""
    met = len(spans_in(walk.path, segment))
    return Verdict(met > 0 if times == 'some' else met == times, f'met {met} times')


def length_max(walk: Walk, of_direct: Limit, metres: Limit) -> Verdict:
    """Check the path's length, in metres or against the path without instruction."""
    limit = metres if math.isinf(of_direct) else min(metres, of_direct * walk.direct_length)
    length = walk.path.length
    return Verdict(length <= limit + ROUNDING, f'{length:.2f} m long, at most {limit:.2f}')


# How each kind of check is measured: the fields besides the common ones and `tol` are parameters.
JUDGES: tuple[Callable[..., Verdict], ...] = (
    inside_max, outside_max, touch, order, visit_before, visit_after, never_after, entries, end_in,
    dist_min, wall_dist_min, cross, length_max,
)  # fmt: skip
CHECK_KINDS = {judge.__name__: judge for judge in JUDGES}
HAVE_TOL = ('touch', 'order', 'visit_before', 'visit_after', 'entries', 'end_in')


@dataclass(frozen=True, eq=False)
class Check:
    """A check: its kind, what its fields say, and the index of its clause (None: of all)."""

    kind: str
    values: Mapping[str, Any]
    scene: Scene
    clause: int | None = None

    def measure(self, path: Polyline, direct_length: float) -> Verdict:
        """Judge a path in metres; without instruction it has `direct_length` metres."""
        return CHECK_KINDS[self.kind](Walk(path, direct_length, self.scene), **self.values)


def read_check(value: object, where: str, scene: Scene, clauses: int) -> Check:
    """Read a check of an instruction whose truth has so many clauses; `where` names it in errors.

    Raises SuiteError or SpecificationError, which name the field.
    """
    values = fields.as_mapping(value, where)
    kind = values.get('check')
    if not isinstance(kind, str) or kind not in CHECK_KINDS:
        raise SuiteError(
            f'{where}: check: {short_repr(kind)} is not one of {", ".join(CHECK_KINDS)}'
        )
    where = f'{where} ({kind})'
    hints = get_type_hints(CHECK_KINDS[kind], include_extras=True)
    del hints['walk'], hints['return']
    readers = {name: hint.__metadata__[0] for name, hint in hints.items()}
    known = COMMON.union(readers, ('tol',) if kind in HAVE_TOL else ())
    unknown = set(values) - known
    if unknown:
        problem = f'has no field {short_repr(min(unknown))}'
        raise SuiteError(f'{where}: {problem}; its fields are {", ".join(sorted(known))}')
    clause = values.get('clause')
    if clause is not None and (type(clause) is not int or not 0 <= clause < clauses):
        problem = f'{short_repr(clause)} is not the index of one of {clauses}'
        raise SuiteError(f'{where}: clause: {problem}')
    entry = Entry(values, where, scene)
    return Check(kind, {name: read(entry, name) for name, read in readers.items()}, scene, clause)
