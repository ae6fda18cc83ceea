# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""avoid: the metres of the path in a region and its margin."""

from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.outcome import ClauseOutcome, kept
from llm_astar_planner.instructions.verification.geometry import EDGE, total
from llm_astar_planner.instructions.verification.measurement import Measurement
from llm_astar_planner.instructions.verification.regions import require_size


def check(measurement: Measurement, clause: Avoid, _: int) -> ClauseOutcome:
    """Measure the metres of a path in a region and its margin, without its edge.

    None is kept, even where start or goal lies inside.
    """
    area = measurement.regions.resolve_avoided(clause.region).area
    margin = clause.margin - EDGE
    area = area.grown(margin) if margin > 0.0 else area.shrunk(EDGE)
    require_size(area)
    spans = area.spans(measurement.path)
    metres, ends_inside = total(spans), any(measurement.ends_in(spans))
    if metres <= EDGE and not ends_inside:
        off = '' if measurement.on_map(area) else ', the region lies off the map'
        return kept(clause, f'0.0 m inside{off}')
    reference, where = measurement.reference, measurement.path.point(float(spans[0, 0]))
    impossible = ends_inside or (
        reference.small_enough and reference.separates(reference.inside(area))
    )
    least = reference.least_inside(area)
    return measurement.broken_by(clause, metres, 'inside', where, least, impossible=impossible)
