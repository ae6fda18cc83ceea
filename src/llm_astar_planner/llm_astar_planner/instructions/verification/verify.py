# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Holds a path against a specification, clause by clause."""

import math
from dataclasses import replace
from importlib import import_module

from numpy.typing import ArrayLike

from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.outcome import ClauseOutcome, ClauseStatus
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.instructions.verification.geometry import polyline
from llm_astar_planner.instructions.verification.measurement import Measurement
from llm_astar_planner.instructions.verification.regions import RegionError


def verify(
    specification: Specification, points: ArrayLike, route: Route, deadline: float = math.inf
) -> tuple[ClauseOutcome, ...]:
    """Hold a path against a specification: the outcome of each clause, in their order.

    `points` [n, 2], n > 0, are the path's points in metres in the map's frame, joined by straight
    segments: the centres of its cells, or any others. Clauses about order and number are judged
    on the way driven so far and the path together, those about lengths on the path. It shares no
    code with what enforces instructions. A clause is only kept if the path was measured to keep
    it. No search for what is possible goes on beyond `deadline` (of time.monotonic). Raises
    PathError for a path without points or with a coordinate that is not finite.
    """
    measurement = Measurement(specification, polyline(points), route, deadline)
    return tuple(
        outcome_of(measurement, clause, index)
        for index, clause in enumerate(specification.clauses)
    )


def outcome_of(measurement: Measurement, clause: Clause, index: int) -> ClauseOutcome:
    """Judge one clause; what is not certain or does not exist is never kept.

    The check is that of the module here with the name of the clause's module: it judges a clause,
    the `index`th, and raises RegionError if a region does not exist.
    """
    name = type(clause).__module__.rpartition('.')[2]
    try:
        outcome: ClauseOutcome = import_module(f'{__package__}.{name}').check(
            measurement, clause, index
        )
    except RegionError as problem:
        return ClauseOutcome(clause, ClauseStatus.NOT_UNDERSTOOD, str(problem))
    if clause.unsure and outcome.status is not ClauseStatus.NOT_UNDERSTOOD:
        fact = f': {outcome.detail}' if outcome.detail else ''
        earlier = {one.unsure for one in measurement.specification.clauses[:index]}
        asked = 'the same question' if clause.unsure in earlier else clause.unsure
        detail = f'{asked} ({outcome.status.value}{fact})'
        return replace(outcome, status=ClauseStatus.UNSURE, detail=detail)
    return outcome
