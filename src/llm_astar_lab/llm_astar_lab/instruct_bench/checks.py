"""The machine checks of a suite: what a path that follows an instruction fulfils.

They are measured on the path's own straight pieces, in code apart from the enforcement and from
what the verification makes of a clause. The kinds are described in `suite`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import shapely
from llm_astar_msgs_adapter.errors import short_repr
from llm_astar_planner.instructions.specification import MAX_METRES
from llm_astar_planner.instructions.specification_json import as_mapping, as_number, as_numbers
from llm_astar_planner.instructions.verification.geometry import (
    EDGE,
    Polyline,
    Spans,
    first_from,
    joined,
    total,
)
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from llm_astar_lab.instruct_bench.regions import QUARTER, Scene, SuiteError, region_geometry

# Metres. A measured length this close to its limit keeps it.
ROUNDING = 1e-6
MAX_TIMES = 1000
MAX_REGIONS = 16
# Fields that every check may have.
NOTHING = np.array([], dtype=np.object_)
COMMON = {'check', 'clause', 'least_possible', 'note'}


class Verdict(NamedTuple):
    """Whether a path fulfils a check, and the measured fact in a few words."""

    holds: bool
    detail: str


# Of a path in metres, and the length in metres of the path without instruction.
Measure = Callable[[Polyline, float], Verdict]


@dataclass(frozen=True, eq=False)
class Check:
    """A check: its kind, the index of the clause it belongs to (None: all), how it is measured."""

    kind: str
    measure: Measure
    clause: int | None = None


@dataclass(frozen=True, eq=False)
class CheckFields:
    """A check that is being read: its fields, how errors name it, what it refers to."""

    fields: Mapping[str, Any]
    where: str
    scene: Scene

    def region(self, name: str, grow: float = 0.0) -> BaseGeometry:
        """Return the geometry of a region, grown by some metres, less than 0 to shrink it."""
        return self.grown(self.fields.get(name), name, grow)

    def grown(self, value: object, name: str, grow: float) -> BaseGeometry:
        """Return the geometry of a region's JSON form, grown. Raises SuiteError if it is empty."""
        where = f'{self.where}: {name}'
        geometry = region_geometry(value, where, self.scene)
        if grow:
            geometry = geometry.buffer(grow, quad_segs=QUARTER)
        if geometry.is_empty:
            raise SuiteError(f'{where}: nothing lies {-grow:g} m deep in it')
        return geometry

    def number(self, name: str, default: float | None = None, least: float = 0.0) -> float:
        """Return a number from `least` to MAX_METRES. Raises SpecificationError."""
        value = self.fields.get(name, default)
        return as_number(value, f'{self.where}: {name}', least, MAX_METRES)

    @property
    def tol(self) -> float:
        """The tolerance in metres, negative for a depth. Raises SpecificationError."""
        return self.number('tol', 0.0, -MAX_METRES)


def path_of(points: ArrayLike) -> Polyline:
    """Return a path through points [n, 2] in metres, n at least 1; repeated ones are dropped."""
    given = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    xy = given[np.concatenate(([True], (np.diff(given, axis=0) != 0.0).any(axis=1)))]
    lengths = np.linalg.norm(np.diff(xy, axis=0), axis=1)
    return Polyline(xy, np.concatenate(([0.0], np.cumsum(lengths))))


def spans_in(path: Polyline, geometry: BaseGeometry) -> Spans:
    """Return where a path lies in closed geometry."""
    return joined(path.spans_in_polygon(geometry))


def opened(geometry: BaseGeometry) -> BaseGeometry:
    """Return geometry without its edge, so that what lies on the edge lies outside."""
    return geometry.buffer(-EDGE, join_style='mitre')


def without_ends(path: Polyline, ends: float) -> NDArray[np.object_]:
    """Return the straight pieces without the first and last `ends` metres; [] if all of it is."""
    if ends <= 0.0 or path.length == 0.0:
        return path.segments
    return path.part(ends, path.length - ends).segments if 2.0 * ends < path.length else NOTHING


def read_inside_max(fields: CheckFields) -> Measure:
    """Check that at most so many metres lie inside a region."""
    region, limit = opened(fields.region('region')), fields.number('metres')

    def measure(path: Polyline, _: float) -> Verdict:
        inside = total(spans_in(path, region))
        return Verdict(inside <= limit + ROUNDING, f'{inside:.2f} m inside, at most {limit:g}')

    return measure


def read_outside_max(fields: CheckFields) -> Measure:
    """Check that at most so many metres lie outside of a region."""
    region, limit = fields.region('region'), fields.number('metres')

    def measure(path: Polyline, _: float) -> Verdict:
        outside = max(path.length - total(spans_in(path, region)), 0.0)
        return Verdict(outside <= limit + ROUNDING, f'{outside:.2f} m outside, at most {limit:g}')

    return measure


def read_touch(fields: CheckFields) -> Measure:
    """Check that the path comes near enough to a region, or deep enough into it."""
    region = fields.region('region', fields.tol)

    def measure(path: Polyline, _: float) -> Verdict:
        missing = float(shapely.distance(path.segments, region).min())
        touched = missing <= ROUNDING
        return Verdict(touched, 'touched' if touched else f'missed by {missing:.2f} m')

    return measure


def read_order(fields: CheckFields) -> Measure:
    """Check that the path touches regions in order."""
    listed = fields.fields.get('regions')
    if not isinstance(listed, list) or not 2 <= len(listed) <= MAX_REGIONS:
        raise SuiteError(f'{fields.where}: regions: is not a list of 2 to {MAX_REGIONS} regions')
    regions = [
        fields.grown(value, f'regions[{number}]', fields.tol)
        for number, value in enumerate(listed)
    ]

    def measure(path: Polyline, _: float) -> Verdict:
        along = 0.0
        for number, region in enumerate(regions):
            before, along = along, first_from(spans_in(path, region), along)
            if math.isinf(along):
                return Verdict(False, f'regions[{number}] is not touched after {before:.2f} m')
        return Verdict(True, f'all in order after {along:.2f} m')

    return measure


def read_visit_before(fields: CheckFields) -> Measure:
    """Check that the path enters a region only after it touched another."""
    first, second = fields.region('first', fields.tol), opened(fields.region('second'))

    def measure(path: Polyline, _: float) -> Verdict:
        touched, entered = (first_from(spans_in(path, one), 0.0) for one in (first, second))
        if math.isinf(entered):
            return Verdict(True, 'second is not entered')
        detail = f'first touched at {touched:.2f} m, second entered at {entered:.2f} m'
        return Verdict(touched <= entered + ROUNDING, detail)

    return measure


def read_end_in(fields: CheckFields) -> Measure:
    """Check that the last point lies in a region."""
    region = fields.region('region', fields.tol)

    def measure(path: Polyline, _: float) -> Verdict:
        off = float(region.distance(shapely.Point(path.corners[-1])))
        return Verdict(off <= ROUNDING, f'ends {off:.2f} m off' if off else 'ends inside')

    return measure


def read_dist_min(fields: CheckFields) -> Measure:
    """Check that the path keeps away from a region, its ends excepted."""
    region, limit, ends = fields.region('region'), *distance_fields(fields)

    def measure(path: Polyline, _: float) -> Verdict:
        pieces = without_ends(path, ends)
        nearest = float(shapely.distance(pieces, region).min(initial=math.inf))
        return Verdict(nearest >= limit - ROUNDING, f'{nearest:.2f} m away, at least {limit:g}')

    return measure


def read_wall_dist_min(fields: CheckFields) -> Measure:
    """Check that the path keeps away from all occupied cells, its ends excepted."""
    (limit, ends), suite_map = distance_fields(fields), fields.scene.suite_map

    def measure(path: Polyline, _: float) -> Verdict:
        _, distances = suite_map.wall_tree.query_nearest(
            without_ends(path, ends), return_distance=True, all_matches=False
        )
        nearest = float(distances.min(initial=math.inf))
        return Verdict(nearest >= limit - ROUNDING, f'{nearest:.2f} m away, at least {limit:g}')

    return measure


def distance_fields(fields: CheckFields) -> tuple[float, float]:
    """Return the least distance and the length of the ends that are excepted, in metres."""
    return fields.number('metres'), fields.number('ends', 0.0)


def read_cross(fields: CheckFields) -> Measure:
    """Check that the path meets a segment so many times."""
    x0, y0, x1, y1 = as_numbers(fields.fields.get('segment'), f'{fields.where}: segment', 4)
    if (x0, y0) == (x1, y1):
        raise SuiteError(f'{fields.where}: segment: is a point')
    segment, times = shapely.LineString([(x0, y0), (x1, y1)]), fields.fields.get('times')
    is_count = isinstance(times, int) and not isinstance(times, bool) and 0 <= times <= MAX_TIMES
    if not (is_count or times == 'some'):
        problem = f'{short_repr(times)} is neither a number nor "some"'
        raise SuiteError(f'{fields.where}: times: {problem}')

    def measure(path: Polyline, _: float) -> Verdict:
        met = len(spans_in(path, segment))
        return Verdict(met > 0 if times == 'some' else met == times, f'met {met} times')

    return measure


def read_length_max(fields: CheckFields) -> Measure:
    """Check the path's length, in metres or against the path without instruction."""
    factor = fields.number('of_direct', math.inf) if 'of_direct' in fields.fields else math.inf
    metres = fields.number('metres') if 'metres' in fields.fields else math.inf
    if math.isinf(factor) and math.isinf(metres):
        raise SuiteError(f'{fields.where}: has neither of_direct nor metres')

    def measure(path: Polyline, direct_length: float) -> Verdict:
        limit = metres if math.isinf(factor) else min(metres, factor * direct_length)
        detail = f'{path.length:.2f} m long, at most {limit:.2f}'
        return Verdict(path.length <= limit + ROUNDING, detail)

    return measure


# How each kind of check is read, and which fields it may have besides the common ones.
KINDS: dict[str, tuple[Callable[[CheckFields], Measure], set[str]]] = {
    'inside_max': (read_inside_max, {'region', 'metres'}),
    'outside_max': (read_outside_max, {'region', 'metres'}),
    'touch': (read_touch, {'region', 'tol'}),
    'order': (read_order, {'regions', 'tol'}),
    'visit_before': (read_visit_before, {'first', 'second', 'tol'}),
    'end_in': (read_end_in, {'region', 'tol'}),
    'dist_min': (read_dist_min, {'region', 'metres', 'ends'}),
    'wall_dist_min': (read_wall_dist_min, {'metres', 'ends'}),
    'cross': (read_cross, {'segment', 'times'}),
    'length_max': (read_length_max, {'of_direct', 'metres'}),
}


def read_check(value: object, where: str, scene: Scene, clauses: int) -> Check:
    """Read a check of an instruction whose truth has so many clauses; `where` names it in errors.

    Raises SuiteError or SpecificationError, which name the field.
    """
    fields = as_mapping(value, where)
    kind = fields.get('check')
    if not isinstance(kind, str) or kind not in KINDS:
        raise SuiteError(f'{where}: check: {short_repr(kind)} is not one of {", ".join(KINDS)}')
    where = f'{where} ({kind})'
    read, own = KINDS[kind]
    unknown = set(fields) - own - COMMON
    if unknown:
        problem = f'has no field {short_repr(min(unknown))}'
        raise SuiteError(f'{where}: {problem}; its fields are {", ".join(sorted(own | COMMON))}')
    clause = fields.get('clause')
    if clause is not None and (type(clause) is not int or not 0 <= clause < clauses):
        problem = f'{short_repr(clause)} is not the index of one of {clauses}'
        raise SuiteError(f'{where}: clause: {problem}')
    return Check(kind, read(CheckFields(fields, where, scene)), clause)
