# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Plans with an instruction: the search keeps to it, and the path is held against it."""

import math
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.costmap.costmap import ClosedCostmap
from llm_astar_planner.instructions import enforcement
from llm_astar_planner.instructions.clauses.clause import SHOULD, Clause, Constraints
from llm_astar_planner.instructions.interpretation import RouteInstruction, Understanding
from llm_astar_planner.instructions.outcome import ClauseOutcome, ClauseStatus, InstructionOutcome
from llm_astar_planner.instructions.region_finder import RegionCells, RegionFinder
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.instructions.text import REQUIRE
from llm_astar_planner.instructions.verification.verify import verify
from llm_astar_planner.planning.footprint_search import fit_footprint
from llm_astar_planner.planning.path_planner import PathPlanner, resolve_endpoints
from llm_astar_planner.planning.path_validator import footprint_problem
from llm_astar_planner.planning.segment import SegmentPlanner
from llm_astar_planner.planning.types import (
    Endpoints,
    Plan,
    PlanningFailure,
    PlanRequest,
    ResultCode,
    check_request,
)
from llm_astar_planner.plugins import PluginError
from llm_astar_planner.search.arrays import Uint8s
from llm_astar_planner.search.astar import PathTooLongError
from llm_astar_planner.search.landmarks import LandmarkManager
from llm_astar_planner.search.methods import EXACT
from llm_astar_planner.search.product import ProductProblemError, ProductTooLargeError
from llm_astar_planner.search.result import SearchStatus

# The part of a request's time for paths that keep to the instruction; the rest is for the check,
# and for the direct path if there is none in time.
INSTRUCTED_SHARE = 0.6
# Parts of a cell to which the greatest distance is found.
FINENESS = 4
NOT_TOGETHER = 'no path of cells keeps every clause'
# Metres from the goal up to which a path passes it.
PASSES_GOAL = 1.0
ELSEWHERE = 'the path ends at {}, as the instruction says, and does not pass the goal {}'
# What is not certain may be the opposite of what was meant: it is followed where it costs at most
# this share of the length more.
UNSURE_SHARE = 1.0


class InstructedSearch:
    """Searches for the path on one route that keeps to an instruction as far as possible."""

    def __init__(
        self,
        route: Route,
        request: PlanRequest,
        instruction: RouteInstruction,
        landmarks: LandmarkManager,
        stop: Uint8s,
    ) -> None:
        """Take a request whose start and goal are those of the route; its time begins now."""
        self.deadline = time.monotonic() + INSTRUCTED_SHARE * request.time_limit
        self.route = route
        self.request = request
        self.policy = instruction.policy
        self.landmarks = landmarks
        self.stop = stop
        self.asked = enforcement.demands_of(instruction.interpretation.specification, route)
        # What of that is demanded, without what no path keeps.
        self.demands = self.asked
        self.expansions = 0
        self.is_kept = True

    @property
    def can_be_enforced(self) -> bool:
        """Whether there is anything to enforce."""
        return any(demand.problem is None for demand in self.demands)

    def search(self) -> SegmentPlanner:
        """Return the search that found the path that violates the clauses least.

        What no path can keep costs nothing, except a distance, of which the most that is possible
        is kept. Raises PlanningFailure where the policy is `require` and no path keeps every
        `must` clause, and where no path was found in time.
        """
        self.demands = tuple(map(self.affordable, self.demands))
        segment = self.strictly(self.demands)
        if segment is None and self.policy == REQUIRE:
            broken = [
                demand.clause.sentence()
                for demand in self.demands
                if self.possible(demand) is not demand
            ]
            which = f'no way keeps "{"; ".join(broken)}"' if broken else self.note()
            message = f'{which or NOT_TOGETHER} (the policy is require)'
            raise PlanningFailure(ResultCode.NO_VALID_PATH, message)
        if segment is None:
            self.is_kept = False
            self.demands = tuple(map(self.possible, self.demands))
            enforcer = enforcement.Enforcer(self.demands, self.route)
            segment = (
                self.strictly(self.demands)
                or self.solve(enforcer.relaxed())
                or self.solve(enforcer.relaxed(owes=False))
            )
        if segment is None:
            message = 'every reachable cell was searched'
            raise PlanningFailure(ResultCode.NO_VALID_PATH, message)
        return segment

    def strictly(self, demands: Sequence[enforcement.Demand]) -> SegmentPlanner | None:
        """Return a search that found a path that keeps every `must` clause, None for none."""
        enforcer = enforcement.Enforcer(demands, self.route)
        problem = enforcer.strict()
        if problem is None:
            return None
        segment = self.solve(problem)
        if segment is None and any(demand.ask.rules for demand in demands if not demand.is_must):
            segment = self.solve(enforcer.strict(owes_wishes=False) or problem)
        return segment

    def affordable(self, demand: enforcement.Demand) -> enforcement.Demand:
        """Return a demand, left out where its clause is a question and its answer costs much."""
        if not demand.clause.unsure or demand.problem is not None:
            return demand
        more = self.length_with(demand) - self.direct_length
        is_cheap = more <= UNSURE_SHARE * self.direct_length
        return demand if is_cheap else replace(demand, problem=f'{more:.1f} m longer')

    @cached_property
    def direct_length(self) -> float:
        """The metres of the best path without demands."""
        return self.length_with()

    def possible(self, demand: enforcement.Demand) -> enforcement.Demand:
        """Return a demand as far as some path keeps it, whatever the others ask."""
        if demand.problem is not None or not demand.is_must:
            return demand
        if self.can_keep(demand):
            return demand
        if demand.clause.reducible:
            return self.most_of(demand.clause) or replace(demand, problem='impossible')
        # Of regions to visit, those that can be.
        visits = tuple(zone for zone in demand.ask.visits if self.is_possible(demand, zone))
        if not visits:
            return replace(demand, problem='impossible')
        return replace(demand, ask=replace(demand.ask, visits=visits))

    def can_keep(self, *demands: enforcement.Demand) -> bool:
        """Tell whether some path keeps demands, without asking a waypoint source."""
        problem = enforcement.Enforcer(demands, self.route).strict()
        if problem is None or problem.product is None or not problem.product.automata:
            return problem is not None
        product = replace(problem.product, price=None)
        return self.solve(replace(problem, product=product)) is not None

    def is_possible(self, demand: enforcement.Demand, zone: RegionCells) -> bool:
        """Tell whether some path visits one region of a clause."""
        return self.can_keep(replace(demand, ask=Constraints(visits=(zone,))))

    def most_of(self, clause: Clause) -> enforcement.Demand | None:
        """Return the demand of the most metres of a clause that some path keeps, None for none."""
        finder, found = RegionFinder(self.route), None
        low, high = 0.0, float(getattr(clause, clause.reducible))
        while high - low > self.route.costmap.grid_map.resolution / FINENESS:
            middle = (low + high) / 2.0
            less: dict[str, Any] = {clause.reducible: middle}
            demand = enforcement.demand_of(replace(clause, **less), finder)
            if self.can_keep(demand):
                low, found = middle, demand
            else:
                high = middle
        return found

    def prices(self) -> list[float]:
        """Return for each clause by how many metres the best path is longer because of it.

        NaN for what is not demanded, and where there was no time left to search without it.
        """
        prices = [math.nan] * len(self.demands)
        asked = [number for number, demand in enumerate(self.demands) if demand.problem is None]
        with suppress(PlanningFailure):
            longest = self.shortest(asked)
            for number in asked:
                others = [other for other in asked if other != number]
                if self.demands[number].ask.goals is None:  # with it the goal is another one
                    prices[number] = max(0.0, longest - self.shortest(others))
        return prices

    def shortest(self, numbers: Sequence[int]) -> float:
        """Return the metres of the best path under some demands. Raises PlanningFailure."""
        return self.length_with(*(self.demands[number] for number in numbers))

    def length_with(self, *demands: enforcement.Demand) -> float:
        """Return the metres of the best path under demands. Raises PlanningFailure."""
        enforcer = enforcement.Enforcer(demands, self.route)
        exact = replace(self.request, method=EXACT, source=None, want_expanded=False)
        segment = self.solve(enforcer.strict() or enforcer.relaxed(), exact)
        cells = math.nan if segment is None else segment.result.length
        return cells * self.route.costmap.grid_map.resolution

    def solve(
        self, problem: enforcement.InstructedProblem, request: PlanRequest | None = None
    ) -> SegmentPlanner | None:
        """Return a search that found a path, None if there is none. Raises PlanningFailure."""
        costmap = self.route.costmap
        if problem.closed is not None:
            costmap = ClosedCostmap(costmap, problem.closed)
        try:
            # Landmarks hold on the map with more cells closed, too.
            with self.landmarks.lend(self.route.costmap.grid_graph) as landmarks:
                segment = SegmentPlanner(
                    costmap, request or self.request, self.deadline, self.stop, landmarks
                )
                if problem.product is None:
                    for _ in segment.search():
                        pass
                else:
                    segment.search_product(problem.product)
        except (ProductProblemError, ProductTooLargeError) as error:
            raise PlanningFailure(ResultCode.UNKNOWN, str(error)) from None
        self.expansions += segment.result.expansions
        if len(segment.result.path):
            return segment
        if segment.result.status is SearchStatus.STOPPED:
            raise segment.failure(self.expansions)
        return None

    def note(self) -> str:
        """Say which clauses contradict each other, or that no path keeps all; else ''."""
        found = [
            f'"{one.sentence()}" contradicts "{other.sentence()}"'
            for one, other in enforcement.contradictions(self.asked)
        ]
        found = found or ([] if self.is_kept else [NOT_TOGETHER])
        found += [
            f'"{demand.clause.sentence()}" waits for the answer: it would be {demand.problem}'
            for demand, asked in zip(self.demands, self.asked)
            if demand.clause.unsure and demand.problem and not asked.problem
        ]
        return '; '.join(found)


def plan_with_instruction(
    planner: PathPlanner, request: PlanRequest, instruction: RouteInstruction, stop: Uint8s
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
    places, driven = instruction.places, instruction.driven
    route = Route(planner.costmap, endpoints.start, endpoints.goal, places, driven)
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
    if instruction.want_prices and search.can_be_enforced and outcome.clauses:
        outcome = replace(
            outcome, clauses=tuple(map(with_price, outcome.clauses, search.prices()))
        )
    problem = required_problem(outcome) if instruction.policy == REQUIRE else None
    if problem is not None and plan.code is ResultCode.NONE:
        withheld = PlanningFailure(ResultCode.NO_VALID_PATH, problem)
        plan = planner.build_plan(request, endpoints, [], failure=withheld)
        outcome = replace(outcome, note='of a path that was withheld')
    return with_outcome(plan, outcome)


def with_price(outcome: ClauseOutcome, price: float) -> ClauseOutcome:
    """Return the outcome of a clause with what it costs, be it kept or not."""
    return outcome if outcome.status is ClauseStatus.UNSURE else replace(outcome, price=price)


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
            away = np.hypot(*(path - endpoints.goal).T).min() * planner.grid_map.resolution
            if away > PASSES_GOAL:
                places = map(planner.costmap.describe_cell, (last, endpoints.goal))
                warnings = (*endpoints.warnings, ELSEWHERE.format(*places))
                endpoints = endpoints._replace(warnings=warnings)
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
        if count_kept(shortened) >= count_kept(clauses):
            clauses = shortened
        else:
            plan = replace(plan, any_angle=None, smoothed=None)
    if plan.smoothed is not None and count_kept(hold(plan.smoothed)) < count_kept(clauses):
        plan = replace(plan, smoothed=None)
    note = '' if count_kept(clauses) == len(clauses) else note
    return plan, InstructionOutcome(interpretation, clauses, note)


def count_kept(clauses: Sequence[ClauseOutcome]) -> int:
    """Count the clauses that are kept."""
    return sum(clause.status is ClauseStatus.KEPT for clause in clauses)


def required_problem(outcome: InstructionOutcome) -> str | None:
    """Say which demand a path does not keep, or which clause is a question; None for neither."""
    status = outcome.interpretation.status
    if status in (Understanding.PENDING, Understanding.NONE):
        return f'the instruction is {status.value}'
    for clause in outcome.clauses:
        is_fine = clause.status in (ClauseStatus.KEPT, ClauseStatus.UNSUPPORTED)
        is_asked = clause.clause.strength != SHOULD or clause.status is ClauseStatus.UNSURE
        if not is_fine and is_asked:
            return f'{clause.clause.sentence()}: {clause.status.value} ({clause.detail})'
    return None


def with_outcome(plan: Plan, outcome: InstructionOutcome) -> Plan:
    """Return a plan that says what became of the instruction."""
    words = outcome.interpretation.status.value
    if plan.code and outcome.interpretation.status is Understanding.WHOLE and not outcome.clauses:
        return replace(plan, instruction=outcome)
    if outcome.clauses:
        words = f'{count_kept(outcome.clauses)} of {len(outcome.clauses)} clauses kept'
    return replace(plan, instruction=outcome, message=f'{plan.message}; instruction: {words}')
