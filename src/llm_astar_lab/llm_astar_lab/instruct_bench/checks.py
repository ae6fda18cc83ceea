"""The machine checks of a suite: what a path that follows an instruction fulfils.

They are measured on the path's own straight pieces, in code apart from the enforcement and the
verification of instructions. The kinds are described in `suite`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import shapely
from llm_astar_msgs_adapter.errors import short_repr
from llm_astar_planner.instructions.specification import MAX_METRES
from llm_astar_planner.instructions.specification_json import as_mapping, as_number, as_numbers
from shapely.geometry.base import BaseGeometry

from llm_astar_lab.instruct_bench.measured_path import MeasuredPath, opened
from llm_astar_lab.instruct_bench.regions import (
    QUARTER,
    Scene,
    SuiteError,
    region_geometry,
)

# Metres. A measured length this close to its limit keeps it.
ROUNDING = 1e-6
MAX_TIMES = 1000
MAX_REGIONS = 16
# Fields that every check may have.
COMMON = {'check', 'clause', 'least_possible', 'note'}


class Verdict(NamedTuple):
    """Whether a path fulfils a check, and the measured fact in a few words."""

    holds: bool
    detail: str


Measure = Callable[[MeasuredPath], Verdict]


@dataclass(frozen=True, eq=False)
class Check:
    """A check: its kind, the index of the clause it belongs to (None: all), how it is measured."""

    kind: str
    measure: Measure
    clause: int | None = None


@dataclass(frozen=True, eq=False)
class Reading:
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


def read_inside_max(reading: Reading) -> Measure:
    """Check that at most so many metres lie inside a region."""
    region, limit = opened(reading.region('region')), reading.number('metres')

    def measure(path: MeasuredPath) -> Verdict:
        inside = path.length_in(region)
        return Verdict(inside <= limit + ROUNDING, f'{inside:.2f} m inside, at most {limit:g}')

    return measure


def read_outside_max(reading: Reading) -> Measure:
    """Check that at most so many metres lie outside of a region."""
    region, limit = reading.region('region'), reading.number('metres')

    def measure(path: MeasuredPath) -> Verdict:
        outside = max(path.length - path.length_in(region), 0.0)
        return Verdict(outside <= limit + ROUNDING, f'{outside:.2f} m outside, at most {limit:g}')

    return measure


def read_touch(reading: Reading) -> Measure:
    """Check that the path comes near enough to a region, or deep enough into it."""
    region = reading.region('region', reading.tol)

    def measure(path: MeasuredPath) -> Verdict:
        missing = float(shapely.distance(path.pieces, region).min())
        touched = missing <= ROUNDING
        return Verdict(touched, 'touched' if touched else f'missed by {missing:.2f} m')

    return measure


def read_order(reading: Reading) -> Measure:
    """Check that the path touches regions in order."""
    listed = reading.fields.get('regions')
    if not isinstance(listed, list) or not 2 <= len(listed) <= MAX_REGIONS:
        raise SuiteError(f'{reading.where}: regions: is not a list of 2 to {MAX_REGIONS} regions')
    regions = [
        reading.grown(value, f'regions[{number}]', reading.tol)
        for number, value in enumerate(listed)
    ]

    def measure(path: MeasuredPath) -> Verdict:
        along = 0.0
        for number, region in enumerate(regions):
            before, along = along, path.first_touch(region, along)
            if math.isinf(along):
                return Verdict(False, f'regions[{number}] is not touched after {before:.2f} m')
        return Verdict(True, f'all in order after {along:.2f} m')

    return measure


def read_visit_before(reading: Reading) -> Measure:
    """Check that the path enters a region only after it touched another."""
    first, second = reading.region('first', reading.tol), opened(reading.region('second'))

    def measure(path: MeasuredPath) -> Verdict:
        touched, entered = path.first_touch(first), path.first_touch(second)
        if math.isinf(entered):
            return Verdict(True, 'second is not entered')
        detail = f'first touched at {touched:.2f} m, second entered at {entered:.2f} m'
        return Verdict(touched <= entered + ROUNDING, detail)

    return measure


def read_end_in(reading: Reading) -> Measure:
    """Check that the last point lies in a region."""
    region = reading.region('region', reading.tol)

    def measure(path: MeasuredPath) -> Verdict:
        off = float(region.distance(shapely.Point(path.points[-1])))
        return Verdict(off <= ROUNDING, f'ends {off:.2f} m off' if off else 'ends inside')

    return measure


def read_dist_min(reading: Reading) -> Measure:
    """Check that the path keeps away from a region, its ends excepted."""
    region, limit, ends = reading.region('region'), *distance_fields(reading)

    def measure(path: MeasuredPath) -> Verdict:
        pieces = path.without_ends(ends)
        nearest = float(shapely.distance(pieces, region).min(initial=math.inf))
        return Verdict(nearest >= limit - ROUNDING, f'{nearest:.2f} m away, at least {limit:g}')

    return measure


def read_wall_dist_min(reading: Reading) -> Measure:
    """Check that the path keeps away from all occupied cells, its ends excepted."""
    (limit, ends), suite_map = distance_fields(reading), reading.scene.suite_map

    def measure(path: MeasuredPath) -> Verdict:
        _, distances = suite_map.wall_tree.query_nearest(
            path.without_ends(ends), return_distance=True, all_matches=False
        )
        nearest = float(distances.min(initial=math.inf))
        return Verdict(nearest >= limit - ROUNDING, f'{nearest:.2f} m away, at least {limit:g}')

    return measure


def distance_fields(reading: Reading) -> tuple[float, float]:
    """Return the least distance and the length of the ends that are excepted, in metres."""
    return reading.number('metres'), reading.number('ends', 0.0)


def read_cross(reading: Reading) -> Measure:
    """Check that the path meets a segment so many times."""
    x0, y0, x1, y1 = as_numbers(reading.fields.get('segment'), f'{reading.where}: segment', 4)
    if (x0, y0) == (x1, y1):
        raise SuiteError(f'{reading.where}: segment: is a point')
    segment, times = shapely.LineString([(x0, y0), (x1, y1)]), reading.fields.get('times')
    is_count = isinstance(times, int) and not isinstance(times, bool) and 0 <= times <= MAX_TIMES
    if not (is_count or times == 'some'):
        problem = f'{short_repr(times)} is neither a number nor "some"'
        raise SuiteError(f'{reading.where}: times: {problem}')

    def measure(path: MeasuredPath) -> Verdict:
        met = len(path.stretches(segment))
        return Verdict(met > 0 if times == 'some' else met == times, f'met {met} times')

    return measure


def read_length_max(reading: Reading) -> Measure:
    """Check the path's length, in metres or against the path without instruction."""
    factor = reading.number('of_direct', math.inf) if 'of_direct' in reading.fields else math.inf
    metres = reading.number('metres') if 'metres' in reading.fields else math.inf
    if math.isinf(factor) and math.isinf(metres):
        raise SuiteError(f'{reading.where}: has neither of_direct nor metres')

    def measure(path: MeasuredPath) -> Verdict:
        limit = metres if math.isinf(factor) else min(metres, factor * path.direct_length)
        detail = f'{path.length:.2f} m long, at most {limit:.2f}'
        return Verdict(path.length <= limit + ROUNDING, detail)

    return measure


# How each kind of check is read, and which fields it may have besides the common ones.
KINDS: dict[str, tuple[Callable[[Reading], Measure], set[str]]] = {
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
    return Check(kind, read(Reading(fields, where, scene)), clause)
