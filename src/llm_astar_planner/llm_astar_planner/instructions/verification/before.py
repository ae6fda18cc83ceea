# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""before: the path enters the second region only after it has visited the first."""

import numpy as np

from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.outcome import ClauseOutcome, broken, kept
from llm_astar_planner.instructions.verification.geometry import first_from, total
from llm_astar_planner.instructions.verification.measurement import Measurement
from llm_astar_planner.instructions.verification.reference import Reference, grown_by_a_cell
from llm_astar_planner.instructions.verification.regions import Resolved


def check(measurement: Measurement, clause: Before, _: int) -> ClauseOutcome:
    """Compare the first entry of the second region with the first visit of the first one."""
    first, second = measurement.sized(clause.first), measurement.sized(clause.second)
    entries = second.entered.spans(measurement.drive)
    if not len(entries):
        return kept(clause, 'the second is not entered')
    entry = float(entries[0, 0])
    visit = first_from(first.visited.spans(measurement.drive), 0.0)
    where = measurement.place_text(entry)
    if visit <= entry:
        return kept(clause, f'{measurement.place_text(visit)} is reached before {where}')
    metres = total(np.minimum(entries, visit))
    detail = f'entered at {where}, before the first is visited'
    reference = measurement.reference
    impossible = reference.small_enough and cannot_be_first(reference, first, second)
    point = measurement.drive.point(entry)
    return broken(clause, detail, metres, point, impossible=impossible)


def cannot_be_first(reference: Reference, first: Resolved, second: Resolved) -> bool:
    """Tell whether no path visits the first region before it enters the second.

    Nor does one reach the goal without entering the second.
    """
    reached = reference.reach(reference.inside(second.entered)) > 0
    if (reached & reference.goal_mask).any():
        return False
    return not reference.can_touch(first.visited, grown_by_a_cell(reached))
