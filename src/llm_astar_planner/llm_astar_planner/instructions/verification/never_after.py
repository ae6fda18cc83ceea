# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""never_after: no part of the path is in the second region once it has entered the first."""

import math

import numpy as np

from llm_astar_planner.instructions.clauses.never_after import NeverAfter
from llm_astar_planner.instructions.outcome import ClauseOutcome, broken, kept
from llm_astar_planner.instructions.verification.geometry import first_from, total
from llm_astar_planner.instructions.verification.measurement import Measurement
from llm_astar_planner.instructions.verification.reference import Reference, grown_by_a_cell
from llm_astar_planner.instructions.verification.regions import Resolved


def check(measurement: Measurement, clause: NeverAfter, _: int) -> ClauseOutcome:
    """Measure the metres in the second region from the first entry of the first one on."""
    first, second = measurement.sized(clause.first), measurement.sized(clause.second)
    entries = first.entered.spans(measurement.drive)
    if not len(entries):
        return kept(clause, 'the first is not entered')
    entry = float(entries[0, 0])
    inside = second.entered.spans(measurement.drive)
    place = first_from(inside, entry)
    after = f'after the first at {measurement.place_text(entry)}'
    if math.isinf(place):
        return kept(clause, f'the second is not entered {after}')
    metres = total(np.maximum(inside, entry))
    detail = f'entered at {measurement.place_text(place)}, {after}'
    reference = measurement.reference
    impossible = reference.small_enough and cannot_keep_out(reference, first, second)
    return broken(clause, detail, metres, measurement.drive.point(place), impossible=impossible)


def cannot_keep_out(reference: Reference, first: Resolved, second: Resolved) -> bool:
    """Tell whether every path enters the first region, and the second one after that."""
    before = reference.reach(reference.inside(first.entered)) > 0
    if (before & reference.goal_mask).any():
        return False
    after = reference.reach(reference.inside(second.entered), starts=reference.goal_mask) > 0
    return not (grown_by_a_cell(before | reference.start_mask) & after).any()
