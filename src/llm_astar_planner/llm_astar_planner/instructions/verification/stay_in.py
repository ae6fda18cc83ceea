# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""stay_in: the metres of the path outside of a region."""

import numpy as np

from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.outcome import ClauseOutcome, broken, kept
from llm_astar_planner.instructions.verification.geometry import EDGE, total
from llm_astar_planner.instructions.verification.measurement import Measurement


def check(measurement: Measurement, clause: StayIn, _: int) -> ClauseOutcome:
    """Measure the metres of a path outside of a region."""
    region, path = measurement.regions.resolve(clause.region).area, measurement.path
    area = region.grown(EDGE)
    inside = area.spans(path) if region.has_size else np.empty((0, 2))
    metres = max(0.0, path.length - total(inside))
    if len(inside) and metres <= EDGE:
        return kept(clause, '0.0 m outside')
    starts_inside = len(inside) and inside[0, 0] <= EDGE
    where = path.point(float(inside[0, 1])) if starts_inside else measurement.start
    reason = '' if len(inside) else measurement.unreachable_reason(area)
    if reason:
        return broken(clause, reason, metres, where, impossible=True)
    least = measurement.reference.least_inside(area, outside=True)
    impossible = least > measurement.route.costmap.grid_map.resolution
    impossible |= not all(measurement.ends_in(inside))
    return measurement.broken_by(clause, metres, 'outside', where, least, impossible=impossible)
