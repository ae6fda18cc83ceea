# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""unsupported: nothing is claimed of what a path does not have."""

from llm_astar_planner.instructions.clauses.unsupported import Unsupported
from llm_astar_planner.instructions.outcome import ClauseOutcome, ClauseStatus
from llm_astar_planner.instructions.verification.measurement import Measurement


def check(_: Measurement, clause: Unsupported, __: int) -> ClauseOutcome:
    """Say that no path has it."""
    return ClauseOutcome(clause, ClauseStatus.UNSUPPORTED)
