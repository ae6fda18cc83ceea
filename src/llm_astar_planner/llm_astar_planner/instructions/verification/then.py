# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""then: whenever the path is in the first region it visits the second one later, or there."""

import math

from llm_astar_planner.instructions.clauses.then import Then
from llm_astar_planner.instructions.outcome import ClauseOutcome, broken, kept
from llm_astar_planner.instructions.verification.geometry import ROUNDING, first_from
from llm_astar_planner.instructions.verification.measurement import Measurement
from llm_astar_planner.instructions.verification.reference import Reference, grown_by_a_cell
from llm_astar_planner.instructions.verification.regions import Resolved


def check(measurement: Measurement, clause: Then, _: int) -> ClauseOutcome:
    """Compare where the path is last in the first region with the last visit of the second."""
    first, second = measurement.sized(clause.first), measurement.sized(clause.second)
    entries = first.entered.spans(measurement.drive)
    if not len(entries):
        return kept(clause, 'the first is not entered')
    last = float(entries[-1, 1])
    visit = first_from(second.visited.spans(measurement.drive), last - ROUNDING)
    where = measurement.place_text(last)
    if math.isfinite(visit):
        return kept(clause, f'{measurement.place_text(visit)} is reached after {where}')
    metres = second.visited.distance(measurement.drive.part(last).shape)
    detail = f'the second is not visited after the first is last left, at {where}'
    reference = measurement.reference
    impossible = reference.small_enough and cannot_follow(reference, first, second)
    return broken(clause, detail, metres, measurement.drive.point(last), impossible=impossible)


def cannot_follow(reference: Reference, first: Resolved, second: Resolved) -> bool:
    """Tell whether every path enters the first region and cannot visit the second one later."""
    goals = reference.goal_mask
    after = reference.reach(reference.inside(first.entered), starts=goals) > 0
    if (after & reference.start_mask).any():
        return False
    near = grown_by_a_cell(after | goals) & reference.reachable
    return not reference.can_touch(second.visited, near)
