"""The independent check of a path against a specification."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from numpy.typing import ArrayLike

from llm_astar_planner.instructions.clauses.avoid import Avoid
from llm_astar_planner.instructions.clauses.before import Before
from llm_astar_planner.instructions.clauses.clause import Clause
from llm_astar_planner.instructions.clauses.end_at import EndAt
from llm_astar_planner.instructions.clauses.keep_distance import KeepDistance
from llm_astar_planner.instructions.clauses.pass_by import Pass
from llm_astar_planner.instructions.clauses.stay_in import StayIn
from llm_astar_planner.instructions.clauses.unknown import Unknown
from llm_astar_planner.instructions.clauses.visit import Visit
from llm_astar_planner.instructions.outcome import ClauseOutcome, ClauseStatus
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.specification import Specification
from llm_astar_planner.instructions.verification.geometry import polyline
from llm_astar_planner.instructions.verification.lengths import (
    check_avoid,
    check_end_at,
    check_keep_distance,
    check_stay_in,
)
from llm_astar_planner.instructions.verification.measurement import Measurement
from llm_astar_planner.instructions.verification.regions import RegionError
from llm_astar_planner.instructions.verification.visits import (
    check_before,
    check_pass,
    check_visit,
    visited_regions_of,
)


def verify(
    specification: Specification, points: ArrayLike, route: Route, deadline: float = math.inf
) -> tuple[ClauseOutcome, ...]:
    """Hold a path against a specification: the outcome of each clause, in their order.

    `points` [n, 2], n > 0, are the path's points in metres in the map's frame, joined by straight
    segments: the centres of its cells, or any others. It shares no code with what enforces
    instructions. A clause is only satisfied if the path was measured to satisfy it. No search for
    what is possible goes on beyond `deadline` (of time.monotonic). Raises PathError for a path
    without points or with a coordinate that is not finite.
    """
    measurement = Measurement(specification, polyline(points), route, deadline)
    return tuple(
        outcome_of(measurement, clause, index)
        for index, clause in enumerate(specification.clauses)
    )


def visited_regions(
    specification: Specification, points: ArrayLike, route: Route
) -> frozenset[tuple[int, int]]:
    """Return which regions a path driven so far, [n, 2] metres, n > 0, has visited in their turn.

    As (index of the clause, index of the region in it), with those of `route.visited`; the first
    region of a `before` clause is its region 0. Raises PathError as `verify` does.
    """
    return visited_regions_of(Measurement(specification, polyline(points), route))


def outcome_of(measurement: Measurement, clause: Clause, index: int) -> ClauseOutcome:
    """Judge one clause; what is guessed or does not exist is never satisfied."""
    try:
        outcome = CHECKS[type(clause)](measurement, clause, index)
    except RegionError as problem:
        return ClauseOutcome(clause, ClauseStatus.NOT_UNDERSTOOD, str(problem))
    if clause.unsure and outcome.status is not ClauseStatus.NOT_UNDERSTOOD:
        return replace(outcome, status=ClauseStatus.UNSURE)
    return outcome


def not_understood(_: Measurement, clause: Unknown, __: int) -> ClauseOutcome:
    """Claim nothing of words that were not understood."""
    return ClauseOutcome(clause, ClauseStatus.NOT_UNDERSTOOD)


# Each judges a clause, the `index`th; RegionError if a region does not exist.
CHECKS: dict[type[Clause], Callable[..., ClauseOutcome]] = {
    Avoid: check_avoid,
    Visit: check_visit,
    Before: check_before,
    StayIn: check_stay_in,
    Pass: check_pass,
    KeepDistance: check_keep_distance,
    EndAt: check_end_at,
    Unknown: not_understood,
}
