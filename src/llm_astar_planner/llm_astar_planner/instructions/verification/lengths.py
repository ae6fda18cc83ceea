"""Checks of clauses that are about lengths: avoid, stay in, keep a distance, end at."""

from __future__ import annotations

import math
from typing import TypeGuard

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.clause import SHOULD
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.outcome import ClauseOutcome
from llm_astar_planner.instructions.regions import WALLS, Along, Region
from llm_astar_planner.instructions.verification.geometry import EDGE, Area, Spans, total
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
from llm_astar_planner.lazy import ndimage

# A distance may be short by this share or by these metres, whichever is more.
SHORT_SHARE = 0.02
SHORT_METRES = 0.05
# Metres beyond a distance that is kept, up to which it is told how much more it is.
REPORTED_BEYOND = 0.25


def check_avoid(measurement: Measurement, clause: Avoid, _: int) -> ClauseOutcome:
    """Measure the metres of a path in a region and its margin.

    A must allows none, even where start or goal lies inside, so that satisfied means clear of it;
    a `should` allows the least possible.
    """
    area = avoided_area(measurement, clause)
    if not area.has_size:
        return no_size(clause)
    spans = area.spans(measurement.path)
    metres = total(spans)
    ends_inside = bool(area.contains_inside(measurement.fixed_ends).any())
    if metres <= NEGLIGIBLE and not ends_inside:
        off = '' if measurement.on_map(area) else ', the region lies off the map'
        return satisfied(clause, f'0.0 m inside{off}')
    least = measurement.reference.least_inside(area)
    detail = f'{length_text(metres)} inside, from {point_text(measurement.first_point(spans))}'
    impossible = False
    if clause.strength != SHOULD:
        reference = measurement.reference
        impossible = ends_inside or (
            reference.small_enough and reference.separates(reference.inside(area))
        )
    elif metres <= measurement.allowed(least):
        return satisfied(clause, f'{detail}, {least_text(least)}', metres, least)
    return violated(
        clause,
        f'{detail}, {least_text(least)}' if least > 0.0 else detail,
        metres,
        measurement.first_point(spans),
        least,
        impossible=impossible,
    )


def avoided_area(measurement: Measurement, clause: Avoid) -> Area:
    """Return the region to avoid with its margin, without its edge; it may have no size."""
    if is_walls(clause.region):
        strip = Along(WALLS, clause.region.width + clause.margin)
        return measurement.regions.resolve(strip).area.shrunk(EDGE)
    region = measurement.regions.resolve_avoided(clause.region).area
    if clause.margin > EDGE and region.has_size:
        return region.grown(clause.margin - EDGE)
    return region.shrunk(EDGE)


def check_stay_in(measurement: Measurement, clause: StayIn, _: int) -> ClauseOutcome:
    """Measure the metres of a path outside of a region: a `should` allows the least possible."""
    region = measurement.regions.resolve(clause.region).area
    area = region.grown(EDGE)
    inside = area.spans(measurement.path) if region.has_size else np.empty((0, 2))
    metres = max(0.0, measurement.path.length - total(inside))
    if len(inside) and metres <= NEGLIGIBLE:
        return satisfied(clause, '0.0 m outside')
    where = first_outside(measurement, inside)
    if not len(inside):
        reason = unreachable_reason(measurement, area)
        if reason:
            return violated(clause, reason, metres, where, impossible=True)
    least = measurement.reference.least_inside(area, outside=True)
    detail = f'{length_text(metres)} outside, from {point_text(where)}'
    detail += '' if math.isnan(least) else f', {least_text(least)}'
    if clause.strength == SHOULD:
        if metres <= measurement.allowed(least):
            return satisfied(clause, detail, metres, least)
        return violated(clause, detail, metres, where, least)
    impossible = least > measurement.route.costmap.grid_map.resolution or not bool(
        area.contains(measurement.fixed_ends).all()
    )
    return violated(clause, detail, metres, where, least, impossible=impossible)


def first_outside(measurement: Measurement, inside: Spans) -> Point:
    """Return where a path is outside of a region for the first time, given where it is inside."""
    if len(inside) and inside[0, 0] <= NEGLIGIBLE:
        return measurement.path.point(float(inside[0, 1]))
    return measurement.start


def check_keep_distance(measurement: Measurement, clause: KeepDistance, _: int) -> ClauseOutcome:
    """Measure the least distance of a path to a region or to the walls.

    Where start or goal itself is nearer, the path up to where it first leaves the zone is not
    counted, as long as it is the least possible and, of a must, within the distance of that end.
    """
    limit = clause.metres - min(
        max(SHORT_SHARE * clause.metres, SHORT_METRES), clause.metres / 2.0
    )
    region = kept_from(clause)
    if is_walls(region):
        reach = region.width + limit + REPORTED_BEYOND
        nearest = measurement.walls.nearest(measurement.path, reach)[0] - region.width
        if nearest >= limit:
            return satisfied(clause, distance_text(nearest, reach - region.width))
        return check_zone(measurement, clause, measurement.walls.zone(region.width + limit - EDGE))
    area = measurement.regions.resolve(region).area
    if not area.has_size:
        return no_size(clause)
    nearest = area.distance(measurement.path.shape)
    if nearest >= limit:
        return satisfied(clause, distance_text(nearest))
    return check_zone(measurement, clause, area.grown(limit - EDGE))


def kept_from(clause: KeepDistance) -> Region:
    """Return what a distance is kept from; the walls are the strip of no width along them."""
    return Along(WALLS, 0.0) if clause.region is None else clause.region


def is_walls(region: Region) -> TypeGuard[Along]:
    """Tell whether a region is a strip along the walls."""
    return isinstance(region, Along) and region.place == WALLS


def check_zone(measurement: Measurement, clause: KeepDistance, zone: Area) -> ClauseOutcome:
    """Judge a path that enters `zone`, all that is nearer than is allowed."""
    spans = zone.spans(measurement.path)
    counts = [not is_end(measurement, span, clause.metres) for span in spans]
    middle = spans[np.array(counts, dtype=np.bool_)]
    is_preference = clause.strength == SHOULD
    counted = spans if is_preference else middle
    if len(spans) and (is_preference or total(middle) <= NEGLIGIBLE):
        least = measurement.reference.least_inside(zone)
        metres = total(spans)
        if metres <= measurement.allowed(least):
            detail = f'{length_text(metres)} nearer, {least_text(least)}'
            return satisfied(clause, detail, metres, least)
        counted = spans
    nearest, where = nearest_in(measurement, clause, counted)
    impossible = not is_preference and too_narrow(measurement, zone)
    detail = f'least distance {length_text(nearest)} of {clause.metres:g} m'
    detail += f', at {point_text(where)}'
    return violated(clause, detail, clause.metres - nearest, where, impossible=impossible)


def is_end(measurement: Measurement, span: NDArray[np.float64], metres: float) -> bool:
    """Tell whether a stretch begins or ends the path and lies within `metres` of that end."""
    points = measurement.path.part(*span).corners
    ends = []
    if span[0] <= NEGLIGIBLE:
        ends.append(measurement.start)
    if span[1] >= measurement.path.length - EDGE:
        ends.append(measurement.goal)
    return any(bool((np.hypot(*(points - end).T) <= metres + EDGE).all()) for end in ends)


def nearest_in(
    measurement: Measurement, clause: KeepDistance, spans: Spans
) -> tuple[float, Point]:
    """Return the least distance of stretches of a path, and the point there."""
    found = math.inf, measurement.start
    region = kept_from(clause)
    stretches = [measurement.path.part(first, last) for first, last in spans]
    for stretch in stretches or [measurement.path]:
        if is_walls(region):
            away, point = measurement.walls.nearest(stretch, clause.metres + region.width)
            away = max(0.0, away - region.width)
        else:
            area = measurement.regions.resolve(region).area
            away, point = area.distance(stretch.shape), area.nearest_point(stretch.shape)
        found = min(found, (away, point))
    return found


def too_narrow(measurement: Measurement, zone: Area) -> bool:
    """Tell whether every path enters a zone, away from its ends."""
    reference = measurement.reference
    if not reference.small_enough:
        return False
    near = reference.inside(zone) & ~reference.blocked
    start_x, start_y = measurement.route.start
    allowed = reference.goal_mask.copy()
    allowed[start_y, start_x] = True
    patches, _ = ndimage.label(near, structure=np.ones((3, 3)))
    own = np.unique(patches[allowed & near])
    return reference.separates(near & ~np.isin(patches, own[own > 0]))


def check_end_at(measurement: Measurement, clause: EndAt, _: int) -> ClauseOutcome:
    """Measure how far the last point of a path is from a region."""
    region = measurement.regions.resolve(clause.region)
    if not region.area.has_size:
        return violated(
            clause, 'the region has no area', math.nan, measurement.goal, impossible=True
        )
    if region.ends.contains([measurement.goal])[0]:
        return satisfied(clause, f'ends at {point_text(measurement.goal)}')
    away = region.ends.distance(measurement.path.part(measurement.path.length).shape)
    reference = measurement.reference
    reason = ''
    if not measurement.on_map(region.ends):
        reason = 'the region lies off the map'
    elif not (reference.cells_in(region.ends) & reference.reachable).any():
        reason = 'no free cell of it can be reached'
    detail = f'ends {length_text(away)} away, at {point_text(measurement.goal)}'
    return violated(clause, reason or detail, away, measurement.goal, impossible=bool(reason))


def unreachable_reason(measurement: Measurement, area: Area) -> str:
    """Say why no path can touch an area, '' if one can."""
    if not area.has_size:
        return 'the region has no area'
    if not measurement.on_map(area):
        return 'the region lies off the map'
    if not measurement.reference.can_touch(area, measurement.reference.reachable):
        return 'no free cell of it can be reached'
    return ''


def least_text(least: float) -> str:
    """Say what the least possible is."""
    return f'the least possible is {length_text(least)}'


def distance_text(nearest: float, looked: float = math.inf) -> str:
    """Say how near a path comes; `looked` is how far was looked."""
    if math.isinf(nearest):
        return f'more than {looked:g} m away' if math.isfinite(looked) else 'nothing is near'
    return f'never nearer than {length_text(nearest)}'
