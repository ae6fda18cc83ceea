# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""keep_distance: how near the path comes to a region, or to the walls."""

import math

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.instructions.clauses.clause import SHOULD
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.outcome import ClauseOutcome, as_length, as_point, broken, kept
from llm_astar_planner.instructions.verification.geometry import EDGE, Area, Polyline, Spans, total
from llm_astar_planner.instructions.verification.measurement import Measurement, Point
from llm_astar_planner.lazy import ndimage

# A distance may be short by this share or by these metres, whichever is more.
SHORT_SHARE = 0.02
SHORT_METRES = 0.05
# Cells. So exactly the greatest distance that is possible is found, and so much may lack of it,
# since a move comes nearer than the centres of its two cells.
STEP = 0.125
DIP = 0.5


def check(measurement: Measurement, clause: KeepDistance, _: int) -> ClauseOutcome:
    """Measure the least distance of a path to a region or to the walls.

    Where start or goal itself is nearer, the path up to where it first leaves the zone is not
    counted, as long as it is the least possible and within the distance of that end. Where no
    path keeps the distance, the greatest that one keeps is as far as possible; of a wish, the
    least length that is nearer, too.
    """
    path, region = measurement.path, clause.region
    target = measurement.sized(region).area if region else measurement.walls.zone(0.0)
    limit = clause.metres - short_by(clause.metres)
    nearest = target.distance(path.shape)
    if nearest >= limit - EDGE:
        # What is short of it by a rounding is not to look like less.
        text = as_length(nearest) if nearest >= clause.metres else f'{nearest:.2f} m'
        away = f'never nearer than {text}'
        return kept(clause, away if math.isfinite(nearest) else 'nothing is near')
    zone = target.grown(limit - EDGE)
    spans = zone.spans(path)
    metres, least = total(spans), measurement.reference.least_inside(zone)
    middle = apart_from_ends(path, spans, clause.metres)
    if metres <= measurement.allowed(least):
        detail = f'{as_length(metres)} nearer, the least possible'
        at_ends = total(middle) <= EDGE
        if at_ends or clause.strength == SHOULD:
            nearest, where = nearest_in(path, target, spans if at_ends else middle)
            detail += ', at its ends' * at_ends
            detail += f', {as_length(nearest)} away at {as_point(where)}'
            return broken(clause, detail, metres, where, least, is_least=True)
    return fall_short(measurement, clause, target, middle if len(middle) else spans)


def short_by(metres: float) -> float:
    """Return by how much a distance may be short."""
    return min(max(SHORT_SHARE * metres, SHORT_METRES), metres / 2.0)


def fall_short(
    measurement: Measurement, clause: KeepDistance, target: Area, counted: Spans
) -> ClauseOutcome:
    """Judge a path that is short of the distance by what the greatest possible one is.

    None is possible where every path begins or ends in what it is kept from.
    """
    path, asked = measurement.path, clause.metres
    greatest = greatest_clearance(measurement, target, asked)
    begins_or_ends_in = any(measurement.ends_in(target.spans(path)))
    is_partly_possible = 0.0 < greatest < asked and not begins_or_ends_in
    dip = DIP * measurement.route.costmap.grid_map.resolution
    slack = min(max(short_by(greatest), dip), greatest / 2.0)
    is_most = is_partly_possible and not len(
        apart_from_ends(path, target.grown(greatest - slack - EDGE).spans(path), asked)
    )
    if is_most:
        zones = (target.grown(near - EDGE).spans(path) for near in (greatest, asked))
        counted = between_ends(path, np.concatenate([*zones]), asked)
    nearest, where = nearest_in(path, target, counted)
    detail = f'least distance {as_length(nearest)} of {asked:g} m, at {as_point(where)}'
    if is_most:
        detail = f'{as_length(nearest)} of {asked:g} m, the most that passes'
        detail += f', at {as_point(where)}'
    elif is_partly_possible:
        detail += f', {as_length(greatest)} is possible'
    impossible = clause.strength != SHOULD and (greatest == 0.0 or begins_or_ends_in)
    return broken(
        clause, detail, asked - nearest, where, asked - greatest,
        impossible=impossible, is_least=is_most,
    )  # fmt: skip


def apart_from_ends(path: Polyline, spans: Spans, metres: float) -> Spans:
    """Return the stretches that are not the path's way from or to an end, `metres` around it."""
    counts = [not is_end(path, span, metres) for span in spans]
    return spans[np.array(counts, dtype=np.bool_)]


def is_end(path: Polyline, span: NDArray[np.float64], metres: float) -> bool:
    """Tell whether a stretch begins or ends the path and lies within `metres` of that end."""
    points = path.part(*span).corners
    ends = []
    if span[0] <= EDGE:
        ends.append(path.point(0.0))
    if span[1] >= path.length - EDGE:
        ends.append(path.point(path.length))
    return any(bool((np.hypot(*(points - end).T) <= metres + EDGE).all()) for end in ends)


def between_ends(path: Polyline, spans: Spans, metres: float) -> Spans:
    """Return what is left of a path without its way from and to its ends, all if nothing is."""
    ends = [span for span in spans if is_end(path, span, metres)]
    first = max((last for begin, last in ends if begin <= EDGE), default=0.0)
    last = min((begin for begin, last in ends if last > first), default=path.length)
    return np.array([[first, last] if first < last else [0.0, path.length]])


def nearest_in(path: Polyline, target: Area, spans: Spans) -> tuple[float, Point]:
    """Return the least distance of stretches of a path, and the point there."""
    shape = min(
        (path.part(*span).shape for span in spans), key=target.distance, default=path.shape
    )
    return target.distance(shape), target.nearest_point(shape)


def greatest_clearance(measurement: Measurement, target: Area, metres: float) -> float:
    """Return the greatest distance up to `metres` that a path keeps from an area, by bisection.

    What lies as near to start or goal is not counted. To STEP cells and of the centres of
    cells, so it may be a little too much; 0 where every path touches the area, NaN where the map
    is too large.
    """
    reference = measurement.reference
    if not reference.small_enough:
        return math.nan
    resolution = measurement.route.costmap.grid_map.resolution
    ends = reference.start_mask | reference.goal_mask
    from_ends = ndimage.distance_transform_edt(~ends) * resolution

    def passes(distance: float) -> bool:
        near = reference.inside(target.grown(distance - EDGE))
        return not reference.separates(near & (from_ends > distance))

    low, high = 3.0 * EDGE, metres
    if not passes(low) or passes(high):
        return 0.0 if not passes(low) else metres
    while high - low > STEP * resolution:
        middle = (low + high) / 2.0
        low, high = (middle, high) if passes(middle) else (low, middle)
    return low - 2.0 * EDGE
