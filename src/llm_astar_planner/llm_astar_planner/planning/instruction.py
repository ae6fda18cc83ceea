"""Plans with an instruction: the search keeps to it, and the path is held against it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.costmap.costmap import ClosedCostmap
from llm_astar_planner.instructions.enforcement import (
    Enforced,
    Enforcer,
    contradictions,
    demands_of,
)
from llm_astar_planner.instructions.interpretation import RouteInstruction, Understanding
from llm_astar_planner.instructions.outcome import (
    ClauseOutcome,
    ClauseStatus,
    InstructionOutcome,
)
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.sentence import clause_sentence
from llm_astar_planner.instructions.specification import SHOULD
from llm_astar_planner.instructions.text import REQUIRE
from llm_astar_planner.instructions.verification import verify
from llm_astar_planner.planning.endpoints import Endpoints, resolve_endpoints
from llm_astar_planner.planning.footprint_search import fit_footprint
from llm_astar_planner.planning.path_planner import PathPlanner
from llm_astar_planner.planning.path_validator import footprint_problem
from llm_astar_planner.planning.segment import SegmentPlanner
from llm_astar_planner.planning.types import (
    Plan,
    PlanningFailure,
    PlanRequest,
    ResultCode,
    check_request,
)
from llm_astar_planner.plugins import PluginError
from llm_astar_planner.search.astar import PathTooLongError
from llm_astar_planner.search.landmarks import LandmarkManager
from llm_astar_planner.search.layered import LayersTooLargeError
from llm_astar_planner.search.result import SearchStatus

# The part of a request's time for paths that keep to the instruction; the rest is for the check,
# and for the direct path if there is none in time.
INSTRUCTED_SHARE = 0.6


class InstructedSearch:
    """Searches for the path on one route that keeps to an instruction as far as possible."""

    def __init__(
        self,
        route: Route,
        request: PlanRequest,
        instruction: RouteInstruction,
        landmarks: LandmarkManager,
        stop: NDArray[np.uint8],
    ) -> None:
        """Take a request whose start and goal are those of the route; its time begins now."""
        self.deadline = time.monotonic() + INSTRUCTED_SHARE * request.time_limit
        self.route = route
        self.request = request
        self.policy = instruction.policy
        self.landmarks = landmarks
        self.stop = stop
        self.demands = demands_of(instruction.interpretation.specification, route)
        self.expansions = 0
        self.is_kept = True

    @property
    def can_be_enforced(self) -> bool:
        """Whether there is anything to enforce."""
        return any(demand.problem is None for demand in self.demands)

    def search(self) -> SegmentPlanner:
        """Return the search that found the path that violates the clauses least.

        Raises PlanningFailure where the policy is `require` and no path keeps every `must` clause,
        and where no path was found in time.
        """
        enforcer = Enforcer(self.demands, self.route)
        problem = enforcer.strict()
        segment = None if problem is None else self.solve(problem)
        if segment is None and self.policy == REQUIRE:
            message = 'every way breaks a clause of the instruction (the policy is require)'
            raise PlanningFailure(ResultCode.NO_VALID_PATH, message)
        if segment is None:
            self.is_kept = False
            segment = self.solve(enforcer.relaxed())
        if segment is None:
            message = 'every reachable cell was searched'
            raise PlanningFailure(ResultCode.NO_VALID_PATH, message)
        return segment

    def solve(self, problem: Enforced) -> SegmentPlanner | None:
        """Return a search that found a path, None if there is none. Raises PlanningFailure."""
        costmap = self.route.costmap
        if problem.closed is not None:
            costmap = ClosedCostmap(costmap, problem.closed)
        try:
            # Landmarks hold on the map with more cells closed, too.
            with self.landmarks.lend(self.route.costmap.grid_graph) as landmarks:
                segment = SegmentPlanner(
                    costmap, self.request, self.deadline, self.stop, landmarks
                )
                if problem.visits is None:
                    for _ in segment.search():
                        pass
                else:
                    segment.search_visits(problem.visits)
        except LayersTooLargeError as error:
            raise PlanningFailure(ResultCode.UNKNOWN, str(error)) from None
        self.expansions += segment.result.expansions
        if len(segment.result.path):
            return segment
        if segment.result.status is SearchStatus.STOPPED:
            raise segment.failure(self.expansions)
        return None

    def note(self) -> str:
        """Say which clauses contradict each other, or that no path keeps all; else ''."""
        pairs = [
            f'"{clause_sentence(one)}" contradicts "{clause_sentence(other)}"'
            for one, other in contradictions(self.demands)
        ]
        return '; '.join(pairs) or ('' if self.is_kept else 'no path of cells keeps every clause')


def plan_with_instruction(
    planner: PathPlanner,
    request: PlanRequest,
    instruction: RouteInstruction,
    stop: NDArray[np.uint8],
) -> Plan:
    """Answer a request with an instruction: the path keeps to its clauses as far as possible.

    Under the policy `prefer` an instruction never costs the plan: where the search that keeps to
    it ends without a path, the direct one is the answer.
    """
    deadline = time.monotonic() + request.time_limit
    direct = replace(request, instruction=None)
    try:
        check_request(request)
        endpoints = resolve_endpoints(planner.costmap, request)
    except PlanningFailure:
        outcome = InstructionOutcome(instruction.interpretation, note='there is no path')
        return with_outcome(planner.direct_plan(direct, stop), outcome)
    places, visited = instruction.places, instruction.visited
    route = Route(planner.costmap, endpoints.start, endpoints.goal, places, visited)
    part = replace(direct, start=endpoints.start, goal=endpoints.goal)
    search = InstructedSearch(route, part, instruction, planner.landmarks, stop)
    note = ''
    if not search.can_be_enforced:
        plan = planner.direct_plan(direct, stop)
    elif request.via:
        plan = planner.direct_plan(direct, stop)
        note = 'not enforced, as the request has via points of its own'
    else:
        plan, failure = search_plan(planner, request, endpoints, search)
        note = search.note()
        if failure and instruction.policy != REQUIRE:
            note = f'{note}; {failure}: the direct path is taken'.lstrip('; ')
            time_left = max(0.0, search.deadline - time.monotonic()) + spare_time(request)
            plan = planner.direct_plan(replace(direct, source=None, time_limit=time_left), stop)
    plan, outcome = verified(plan, route, instruction, note, deadline)
    problem = required_problem(outcome) if instruction.policy == REQUIRE else None
    if problem is not None and plan.code is ResultCode.NONE:
        withheld = PlanningFailure(ResultCode.NO_VALID_PATH, problem)
        plan = planner.build_plan(request, endpoints, [], failure=withheld)
        outcome = replace(outcome, note='of a path that was withheld')
    return with_outcome(plan, outcome)


def spare_time(request: PlanRequest) -> float:
    """Return the seconds of a request that are kept for the direct path."""
    return (1.0 - INSTRUCTED_SHARE) * request.time_limit / 2.0


def search_plan(
    planner: PathPlanner, request: PlanRequest, endpoints: Endpoints, search: InstructedSearch
) -> tuple[Plan, str]:
    """Return the plan that keeps to the instruction best, and why there is none, '' if found."""
    try:
        segment = search.search()
        if request.footprint is not None:
            costmap, deadline = segment.costmap, search.deadline + spare_time(request)
            endpoints = fit_footprint(costmap, request, endpoints, [segment], deadline)
        path = segment.result.path
        last = (int(path[-1][0]), int(path[-1][1]))
        if last == endpoints.goal:
            problem = planner.problem(request, endpoints, path)
        else:  # a clause says where to end
            endpoints = endpoints._replace(goal=last)
            problem = planner.checker.path_problem(path, endpoints.start, last)
            problem = problem or footprint_problem(path, planner.costmap, request)
        if problem is not None:
            message = f'the path found was withheld: {problem}'
            raise PlanningFailure(ResultCode.UNKNOWN, message)
        deadline = search.deadline + spare_time(request)
        plan = planner.build_plan(request, endpoints, [segment], segment.result, deadline=deadline)
        return plan, ''
    except (PlanningFailure, PathTooLongError, PluginError) as failure:
        return planner.build_plan(request, endpoints, [], failure=failure), str(failure)


def verified(
    plan: Plan, route: Route, instruction: RouteInstruction, note: str, deadline: float
) -> tuple[Plan, InstructionOutcome]:
    """Hold the path that is published against the instruction.

    A path at any angle that keeps fewer clauses than the path of cells is left out.
    """
    interpretation = instruction.interpretation
    if not len(plan.path):
        return plan, InstructionOutcome(interpretation, note=note or 'there is no path')

    def hold(cells: NDArray[Any]) -> tuple[ClauseOutcome, ...]:
        points = route.costmap.grid_map.grid_to_world(cells)
        return verify(interpretation.specification, points, route, deadline)

    clauses = hold(plan.path)
    if plan.any_angle is not None:
        shortened = hold(plan.any_angle.points)
        if count_satisfied(shortened) >= count_satisfied(clauses):
            clauses = shortened
        else:
            plan = replace(plan, any_angle=None)
    note = '' if count_satisfied(clauses) == len(clauses) else note
    return plan, InstructionOutcome(interpretation, clauses, note)


def count_satisfied(clauses: Sequence[ClauseOutcome]) -> int:
    """Count the satisfied clauses."""
    return sum(clause.status is ClauseStatus.SATISFIED for clause in clauses)


def required_problem(outcome: InstructionOutcome) -> str | None:
    """Say which `must` clause a path does not keep for certain, None if it keeps all."""
    status = outcome.interpretation.status
    if status in (Understanding.PENDING, Understanding.NONE):
        return f'the instruction is {status.value}'
    for clause in outcome.clauses:
        if clause.status is not ClauseStatus.SATISFIED and clause.clause.strength != SHOULD:
            return f'{clause_sentence(clause.clause)}: {clause.status.value} ({clause.detail})'
    return None


def with_outcome(plan: Plan, outcome: InstructionOutcome) -> Plan:
    """Return a plan that says what became of the instruction."""
    words = outcome.interpretation.status.value
    if plan.code and outcome.interpretation.status is Understanding.WHOLE and not outcome.clauses:
        return replace(plan, instruction=outcome)
    if outcome.clauses:
        words = f'{count_satisfied(outcome.clauses)} of {len(outcome.clauses)} clauses satisfied'
    return replace(plan, instruction=outcome, message=f'{plan.message}; instruction: {words}')
