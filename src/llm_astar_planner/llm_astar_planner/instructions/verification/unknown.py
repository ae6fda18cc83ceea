# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""unknown: nothing is claimed of words that were not understood."""

from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.outcome import ClauseOutcome, ClauseStatus
from llm_astar_planner.instructions.verification.measurement import Measurement


def check(_: Measurement, clause: Unknown, __: int) -> ClauseOutcome:
    """Say that they were not understood."""
    return ClauseOutcome(clause, ClauseStatus.NOT_UNDERSTOOD)
