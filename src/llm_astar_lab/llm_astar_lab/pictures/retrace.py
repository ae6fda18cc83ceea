# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Runs the searches of a plan again to learn in which order they expanded the cells."""

from collections import deque
from dataclasses import replace
from itertools import pairwise

from llm_astar_planner.costmap.costmap import ClosedCostmap, Costmap
from llm_astar_planner.instructions.enforcement import Enforcer, demands_of
from llm_astar_planner.instructions.interpretation import RouteInstruction
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.segment import guiding_points, target_list
from llm_astar_planner.planning.types import Plan, PlanRequest
from llm_astar_planner.search.astar import EXPANSION_SLICE, PlainSearch
from llm_astar_planner.search.expansion_order import ExpansionOrder, ExpansionRecorder
from llm_astar_planner.search.guided import GuidedSearch
from llm_astar_planner.search.methods import EXACT, GUIDED, METHODS
from llm_astar_planner.search.paper import PAPER_METHODS
from llm_astar_planner.search.problem import SearchProblem
from llm_astar_planner.search.result import SearchStatus


def retrace(planner: Planner, request: PlanRequest, plan: Plan) -> ExpansionOrder | None:
    """Return in which order a plan's searches expanded the cells, those to via points in turn.

    `plan` is the planner's answer to `request`. The searches run again as they ran for the plan,
    and what they expand is compared with what the plan says. None where the order cannot be
    known: with an instruction that does more than to close cells, after a search by heading, for
    the method of a plug-in, and where it depended on time (waypoints that came in during the
    search, a time limit, landmarks that were not there yet).
    """
    costmap = planner.costmap
    if request.instruction is not None:
        closed = instructed_costmap(costmap, request.instruction, plan)
        if closed is None:
            return None
        costmap = closed
    if not plan.expansions or request.method not in METHODS:
        return None
    recorder = ExpansionRecorder(planner.costmap.blocked.shape, plan.expansions)
    cells = [plan.start, *plan.via, plan.goal]
    try:
        for start, goal in pairwise(cells):
            segment = replace(request, start=start, goal=goal, via=())
            status = search_again(planner, costmap, segment, plan, recorder)
            if status is not SearchStatus.FOUND:
                break
            recorder.next_search()
    except OverflowError:
        return None
    order = recorder.order()
    return order if order.expansions == plan.expansions else None


def instructed_costmap(
    costmap: Costmap, instruction: RouteInstruction, plan: Plan
) -> Costmap | None:
    """Return the costmap that was searched to keep to an instruction.

    None where closed cells were not enough: for visits, and where no path keeps every clause.
    """
    route = Route(costmap, plan.start, plan.goal, instruction.places, instruction.driven)
    demands = demands_of(instruction.interpretation.specification, route)
    if all(demand.problem is not None for demand in demands):
        return costmap
    problem = Enforcer(demands, route).strict()
    if problem is None or problem.product is not None:
        return None
    return costmap if problem.closed is None else ClosedCostmap(costmap, problem.closed)


def search_again(
    planner: Planner,
    costmap: Costmap,
    request: PlanRequest,
    plan: Plan,
    recorder: ExpansionRecorder,
) -> SearchStatus:
    """Run the search of one segment as the plan's; return how it ended. Raises OverflowError."""
    graph, ends = costmap.grid_graph, (request.start, request.goal)
    if request.method == GUIDED:
        # Landmarks hold with more cells closed, too.
        with planner.landmarks.lend(planner.costmap.grid_graph) as landmarks:
            problem = SearchProblem(
                graph, *ends, want_expanded=False, landmarks=landmarks,
                max_suboptimality=request.max_suboptimality,
            )  # fmt: skip
            search = GuidedSearch(problem, recorder=recorder)
            search.guide(guiding_points(plan.checked_waypoints))
            deque(search.solutions(), maxlen=0)
            return search.result().status
    if request.method == EXACT:
        return record_exact(PlainSearch(graph, *ends), recorder)
    targets = target_list(plan.checked_waypoints, *ends)[1:]
    problem = SearchProblem(
        graph, *ends, targets, heuristic=request.heuristic, weight=request.weight
    )
    return PAPER_METHODS[request.method](problem, recorder).status


def record_exact(search: PlainSearch, recorder: ExpansionRecorder) -> SearchStatus:
    """Run an exact search to its end and record it. Raises OverflowError."""
    try:
        while search.status is None:
            recorder.advance(search, EXPANSION_SLICE)
        return search.status
    finally:
        search.grid.give_back(search.workspace)
