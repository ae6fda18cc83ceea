"""Checks of clauses that are about order: visit and before."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray

from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.outcome import ClauseOutcome
from llm_astar_planner.instructions.verification.geometry import (
    EDGE,
    Area,
    Polyline,
    Spans,
    first_from,
    total,
)
from llm_astar_planner.instructions.verification.lengths import unreachable_reason
from llm_astar_planner.instructions.verification.measurement import (
    NEGLIGIBLE,
    Measurement,
    Point,
    length_text,
    no_size,
    point_text,
    satisfied,
    violated,
)
from llm_astar_planner.instructions.verification.reference import grown_by_a_cell
from llm_astar_planner.instructions.verification.regions import RegionError, Resolved

Vector = NDArray[np.float64]


def check_pass(measurement: Measurement, clause: Pass, index: int) -> ClauseOutcome:
    """Judge where a path crosses the rays from an object's centre to the side and its opposite.

    Region 0 of the clause counts as visited once the ray to the side was crossed.
    """
    region = measurement.regions.resolve(clause.region).area
    if region.wall_distance > 0.0 or not region.has_size:
        return no_size(clause)
    ahead = measurement.regions.direction(clause.side)
    centre = centre_of(region)
    inside = region.shrunk(EDGE).spans(measurement.path)
    right = crossings(measurement.path, centre, ahead, touching=False)
    wrong = crossings(measurement.path, centre, -ahead, touching=True)
    passed = (index, 0) in measurement.route.visited
    metres = total(inside)
    where = measurement.start
    if metres > NEGLIGIBLE:
        where = measurement.first_point(inside)
        detail = f'{length_text(metres)} through it, from {point_text(where)}'
    elif wrong:
        where = measurement.path.point(wrong[0])
        detail = f'passed on the other side, at {point_text(where)}'
    elif right:
        return satisfied(clause, f'passed at {point_text(measurement.path.point(right[0]))}')
    elif passed:
        return satisfied(clause, 'passed before')
    else:
        detail = 'not passed on this side'
    impossible = not passed and cannot_pass(measurement, region, centre, ahead)
    return violated(clause, detail, metres, where, impossible=impossible)


def has_passed(measurement: Measurement, clause: Pass) -> bool:
    """Tell whether a path crosses the ray to the side. Raises RegionError."""
    centre = centre_of(measurement.regions.resolve(clause.region).area)
    ahead = measurement.regions.direction(clause.side)
    return bool(crossings(measurement.path, centre, ahead, touching=False))


def centre_of(region: Area) -> Vector:
    """Return the centre of mass (x, y) of a region."""
    centre: Vector = shapely.get_coordinates(shapely.centroid(region.outline))[0]
    return centre


def crossings(path: Polyline, origin: Vector, ahead: Vector, *, touching: bool) -> list[float]:
    """Return the places where a path crosses a ray, from one side of it to the other.

    With `touching` also where it comes to the ray and leaves it on the same side, which is no
    crossing. A path that runs along the ray's line between leaving its two sides crosses where
    all of that stretch is on the ray, or, with `touching`, where any of it is. Where the path
    begins or ends on the ray it neither crosses nor touches it.
    """
    off = path.corners - origin
    across = ahead[0] * off[:, 1] - ahead[1] * off[:, 0]
    along = off @ ahead
    beside = np.flatnonzero(np.abs(across) > EDGE)
    found = []
    for before, after in pairwise(beside):
        is_change = across[before] * across[after] < 0.0
        if after > before + 1:
            on_ray = along[before + 1 : after] > 0.0
            met = on_ray.any() if touching else is_change and on_ray.all()
            place = path.at[before + 1]
        elif is_change:
            share = across[before] / (across[before] - across[after])
            met = along[before] + share * (along[after] - along[before]) > 0.0
            place = path.at[before] + share * (path.at[after] - path.at[before])
        else:
            continue
        if met:
            found.append(float(place))
    return found


def cannot_pass(measurement: Measurement, region: Area, centre: Vector, ahead: Vector) -> bool:
    """Tell whether no path passes the object on the side.

    Every one crosses the object or the ray to the opposite side, or none the ray to the side.
    """
    reference = measurement.reference
    if not reference.small_enough:
        return False
    grid_map = measurement.route.costmap.grid_map
    origin, beyond = grid_map.world_to_grid([centre, centre - ahead])
    step = beyond - origin
    line = np.concatenate((origin, step / np.hypot(*step)))
    reached = reference.reach(reference.inside(region.shrunk(EDGE)), line) > 0
    if not (reached & reference.goal_mask).any():
        return True
    far = centre + ahead * measurement.regions.map_outline.length
    ray = shapely.LineString([centre, far])
    return not (reached & reference.near(ray)).any()


BEFORE_THE_PATH = -math.inf


@dataclass(frozen=True, eq=False)
class Attempt:
    """Whether a path visits a region of a visit clause when its turn has come.

    `place` is where on the path it does, inf if nowhere, BEFORE_THE_PATH if it was visited on the
    way before; `turn` is where on the path its turn begins.
    """

    clause: int
    number: int
    region: Resolved
    spans: Spans
    turn: float
    place: float

    @property
    def done(self) -> bool:
        """Whether the region is visited."""
        return self.place < math.inf


def attempts(measurement: Measurement) -> Iterator[list[Attempt]]:
    """Yield the attempts at the regions of each visit clause, clauses in their order.

    Each region counts at the first place where the path touches it once its turn has come. That
    decides rightly: the turn of a clause begins where the last region of the one before is first
    visited, and no choice of visits lets it begin earlier, because (by induction over the
    clauses) a region's earliest visit after the earliest turn is the earliest of all its visits
    that are allowed, and the regions of one clause do not depend on each other. So if any choice
    of places in order exists, this one does. A region that is never visited holds up nothing.
    Regions that do not exist are left out.
    """
    turn = 0.0
    for index, clause in enumerate(measurement.specification.clauses):
        if isinstance(clause, Visit):
            tried = list(attempts_at(measurement, index, clause, turn))
            yield tried
            turn = max([turn, *(one.place for one in tried if one.done)])


def attempts_at(
    measurement: Measurement, index: int, clause: Visit, turn: float
) -> Iterator[Attempt]:
    """Yield the attempts at the regions of one clause, whose turn begins at a place."""
    for number, wanted in enumerate(clause.regions):
        try:
            region = measurement.regions.resolve(wanted)
        except RegionError:
            continue
        spans = region.visited.spans(measurement.path)
        place = first_from(spans, turn)
        if (index, number) in measurement.route.visited:
            place = BEFORE_THE_PATH
        yield Attempt(index, number, region, spans, turn, place)


def check_visit(measurement: Measurement, clause: Visit, index: int) -> ClauseOutcome:
    """Judge one visit clause in the order of all of them."""
    for wanted in clause.regions:
        measurement.regions.resolve(wanted)
    tried = next(group for group in attempts(measurement) if group and group[0].clause == index)
    failed = [one for one in tried if not one.done]
    if not failed:
        return satisfied(clause, '; '.join(visit_text(measurement, one) for one in tried))
    reasons = [unreachable_reason(measurement, one.region.visited) for one in failed]
    worst = next((one for one, reason in zip(failed, reasons) if reason), failed[0])
    reason = next((reason for reason in reasons if reason), '')
    detail, metres, where = miss(measurement, worst)
    return violated(clause, reason or detail, metres, where, impossible=bool(reason))


def visit_text(measurement: Measurement, attempt: Attempt) -> str:
    """Say where a region was visited."""
    if attempt.place == BEFORE_THE_PATH:
        return 'visited before'
    return f'reached at {point_text(measurement.path.point(attempt.place))}'


def miss(measurement: Measurement, attempt: Attempt) -> tuple[str, float, Point]:
    """Say how a path misses a region: a sentence, by how many metres, and where."""
    rest = measurement.path.part(attempt.turn)
    metres = attempt.region.visited.distance(rest.shape)
    where = attempt.region.visited.nearest_point(rest.shape)
    if len(attempt.spans):
        early = point_text(measurement.first_point(attempt.spans))
        return f'reached before its turn, at {early}, and not again', metres, where
    away = attempt.region.area.distance(measurement.path.shape)
    if away > 0.0:
        return f'never nearer than {length_text(away)}', metres, where
    return f'entered, but {length_text(metres)} short of a visit', metres, where


def check_before(measurement: Measurement, clause: Before, index: int) -> ClauseOutcome:
    """Judge whether a path enters the second region only after it has visited the first."""
    first = measurement.regions.resolve(clause.first)
    second = measurement.regions.resolve(clause.second)
    if not (first.area.has_size and second.area.has_size):
        return no_size(clause)
    entered = second.visited if second.is_object else second.area.shrunk(EDGE)
    spans = entered.spans(measurement.path)
    if not len(spans):
        return satisfied(clause, 'the second is not entered')
    entry = float(spans[0, 0])
    place = first_from(first.visited.spans(measurement.path), 0.0)
    if (index, 0) in measurement.route.visited:
        return satisfied(clause, 'the first was visited before')
    where = measurement.path.point(entry)
    if place <= entry:
        there = point_text(measurement.path.point(place))
        return satisfied(clause, f'{there} is reached before {point_text(where)}')
    metres = total(np.minimum(spans, place))
    detail = f'entered at {point_text(where)}, before the first is visited'
    impossible = cannot_be_first(measurement, first, second)
    return violated(clause, detail, metres, where, impossible=impossible)


def cannot_be_first(measurement: Measurement, first: Resolved, second: Resolved) -> bool:
    """Tell whether no path visits the first region before it enters the second.

    Nor does one reach the goal without entering the second.
    """
    reference = measurement.reference
    if not reference.small_enough:
        return False
    removed = reference.inside(second.visited if second.is_object else second.area.shrunk(EDGE))
    reached = reference.reach(removed) > 0
    if (reached & reference.goal_mask).any():
        return False
    return not reference.can_touch(first.visited, grown_by_a_cell(reached))


def visited_regions_of(measurement: Measurement) -> frozenset[tuple[int, int]]:
    """Return the regions that a path has visited in their turn, with those visited before.

    (index of the clause, index of the region in it); the first region of a `before` clause and
    the object of a `pass` clause are region 0. A visit clause's turn comes when all regions
    before it are visited, those aside that nobody can visit.
    """
    done = set(measurement.route.visited)
    groups = list(attempts(measurement))
    while any(one.done for group in groups for one in group):
        tried = groups.pop(0)
        done |= {(one.clause, one.number) for one in tried if one.done}
        missing = [one for one in tried if not one.done]
        further = any(one.done for group in groups for one in group)
        if further and not all(
            unreachable_reason(measurement, one.region.visited) for one in missing
        ):
            break
    for index, clause in enumerate(measurement.specification.clauses):
        if is_behind(measurement, clause):
            done.add((index, 0))
    return frozenset(done)


def is_behind(measurement: Measurement, clause: Clause) -> bool:
    """Tell whether a path has done what a `before` or `pass` clause asks to do once."""
    try:
        if isinstance(clause, Pass):
            return has_passed(measurement, clause)
        if isinstance(clause, Before):
            first = measurement.regions.resolve(clause.first)
            return bool(len(first.visited.spans(measurement.path)))
    except RegionError:
        pass
    return False
