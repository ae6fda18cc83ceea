"""stay_in: the metres of the path outside of a region."""

from __future__ import annotations

import numpy as np

from llm_astar_planner.instructions.clauses.clause import SHOULD
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.outcome import ClauseOutcome
from llm_astar_planner.instructions.verification.geometry import EDGE, Spans, total
from llm_astar_planner.instructions.verification.measurement import (
    NEGLIGIBLE,
    Measurement,
    Point,
    as_far,
    broken,
    kept,
    metres_text,
)


def check(measurement: Measurement, clause: StayIn, _: int) -> ClauseOutcome:
    """Measure the metres of a path outside of a region.

    A wish is kept as far as possible by the least that any path has outside.
    """
    region = measurement.regions.resolve(clause.region).area
    area = region.grown(EDGE)
    inside = area.spans(measurement.path) if region.has_size else np.empty((0, 2))
    metres = max(0.0, measurement.path.length - total(inside))
    if len(inside) and metres <= NEGLIGIBLE:
        return kept(clause, '0.0 m outside')
    where = first_outside(measurement, inside)
    reason = '' if len(inside) else measurement.unreachable_reason(area)
    if reason:
        return broken(clause, reason, metres, where, impossible=True)
    least = measurement.reference.least_inside(area, outside=True)
    detail = metres_text(metres, 'outside', least, where)
    if clause.strength == SHOULD:
        judged = as_far if metres <= measurement.allowed(least) else broken
        return judged(clause, detail, metres, where, least)
    impossible = least > measurement.route.costmap.grid_map.resolution or not bool(
        area.contains(measurement.fixed_ends).all()
    )
    return broken(clause, detail, metres, where, least, impossible=impossible)


def first_outside(measurement: Measurement, inside: Spans) -> Point:
    """Return where a path is outside of a region for the first time, given where it is inside."""
    if len(inside) and inside[0, 0] <= NEGLIGIBLE:
        return measurement.path.point(float(inside[0, 1]))
    return measurement.start
