# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Planner: a request in, a plan out. Nodes, benchmark, bag evaluation and users share it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING

from llm_astar_planner.planning.path_planner import COMPILED, PathPlanner, kind_of_plan
from llm_astar_planner.planning.types import (
    Endpoints,
    Plan,
    PlanningFailure,
    PlanRequest,
    ResultCode,
    finite_or_none,
)
from llm_astar_planner.search.arrays import StopFlag
from llm_astar_planner.search.kernel_cache import INTERPRETED

if TYPE_CHECKING:
    from llm_astar_planner.instructions.interpretation import RouteInstruction

NO_ALTERNATIVES = 'no alternatives: they go with no via points, footprint or instruction'
NOT_COMPILED = 'cancelled while the searches were compiled'


class Planner(PathPlanner):
    """Plans on one costmap. Immutable, so safe to share between threads."""

    def more_plans(self, request: PlanRequest, stop: StopFlag, *, anytime: bool) -> Iterator[Plan]:
        """Return the plans of a request that is not compiled yet, or asks for more than a path."""
        # Each of these imports takes a while, and most plans need none of them.
        if request.viapoints:
            from llm_astar_planner.planning.endpoints import ViapointSource  # noqa: PLC0415

            source = ViapointSource(request.viapoints, request.tolerance)
            request = replace(request, source=source)
        if not self.compile(request, stop):
            failure = PlanningFailure(ResultCode.TIMEOUT, NOT_COMPILED)
            endpoints = Endpoints(request.start, request.goal, request.via)
            return iter([self.build_plan(request, endpoints, [], failure=failure)])
        plans = self.direct_plans(request, stop, anytime=anytime)
        if request.instruction is not None:
            plans = self.instructed_plans(request, request.instruction, stop)
        if request.last_path is not None:
            from llm_astar_planner.planning.plan_reuse import kept_plans  # noqa: PLC0415

            plans = kept_plans(self, request, request.last_path, plans, stop)
        return self.plans_with_reasons(request, plans, stop)

    def instructed_plans(
        self, request: PlanRequest, instruction: RouteInstruction, stop: StopFlag
    ) -> Iterator[Plan]:
        """Yield the plan of a request with an instruction."""
        from llm_astar_planner.planning.instruction import plan_with_instruction  # noqa: PLC0415

        yield plan_with_instruction(self, request, instruction, stop)

    def plans_with_reasons(
        self, request: PlanRequest, plans: Iterator[Plan], stop: StopFlag
    ) -> Iterator[Plan]:
        """Yield plans: one without a path says why, one with a path has other ways if asked."""
        deadline = time.monotonic() + request.time_limit
        for plan in plans:
            if plan.is_final and request.alternatives and plan.code is ResultCode.NONE:
                yield self.with_alternatives(plan, request, stop, deadline)
            else:
                yield self.explained(request, plan, stop, deadline)

    def with_alternatives(
        self, plan: Plan, request: PlanRequest, stop: StopFlag, deadline: float
    ) -> Plan:
        """Return a plan with the ways to choose from that are found until the deadline."""
        if request.via or request.footprint or request.instruction:
            return replace(plan, warnings=(*plan.warnings, NO_ALTERNATIVES))
        from llm_astar_planner.planning.alternatives import AlternativesSearch  # noqa: PLC0415

        between = replace(request, start=plan.start, goal=plan.goal)
        found = AlternativesSearch(self.costmap, between, stop, deadline).ways()
        ways = [
            way._replace(clearance=finite_or_none(self.checker.measure(way.path).clearance))
            for way in islice(found, request.alternatives)
            if self.checker.path_problem(way.path, plan.start, plan.goal) is None
        ]
        return replace(plan, alternatives=tuple(ways))

    def compile(self, request: PlanRequest, stop: StopFlag | None = None) -> bool:
        """Compile what a request takes, or load it; tell whether that is done.

        Only the first one of its kind in a process takes time, `compile.EXPECTED` where numba has
        nothing in its cache. `stop` ends it as it ends a plan.
        """
        is_graded = self.costmap.grid_graph.cell_surcharge.size > 0
        kind = self.config, request, is_graded, self.landmarks.current is not None
        if INTERPRETED or kind_of_plan(*kind) in COMPILED:
            return True
        # A process whose plans are compiled needs it no more.
        from llm_astar_planner.planning.compile import compile_for  # noqa: PLC0415

        with suppress(Exception):  # where it does not compile, the plan says why
            return compile_for(*kind, stop)
        return True
