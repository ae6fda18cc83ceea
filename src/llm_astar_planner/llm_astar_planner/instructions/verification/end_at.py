# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""end_at: how far the last point of the path is from a region."""

import math

from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.outcome import ClauseOutcome, as_length, as_point, broken, kept
from llm_astar_planner.instructions.verification.measurement import Measurement
from llm_astar_planner.instructions.verification.regions import NO_AREA


def check(measurement: Measurement, clause: EndAt, _: int) -> ClauseOutcome:
    """Measure how far the last point of a path is from a region."""
    region, goal = measurement.regions.resolve(clause.region), measurement.goal
    if not region.area.has_size:
        return broken(clause, NO_AREA, math.nan, goal, impossible=True)
    if region.ends.contains([goal])[0]:
        return kept(clause, f'ends at {as_point(goal)}')
    away = region.ends.distance(measurement.path.part(measurement.path.length).shape)
    reference = measurement.reference
    reason = ''
    if not measurement.on_map(region.ends):
        reason = 'the region lies off the map'
    elif not (reference.cells_in(region.ends) & reference.reachable).any():
        reason = 'no free cell of it can be reached'
    detail = f'ends {as_length(away)} away, at {as_point(goal)}'
    return broken(clause, reason or detail, away, goal, impossible=bool(reason))
