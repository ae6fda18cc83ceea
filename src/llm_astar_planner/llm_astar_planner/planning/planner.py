# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Planner: a request in, a plan out. Nodes, benchmark, bag evaluation and users share it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING

from llm_astar_msgs_adapter.maps.places import NO_PLACES

from llm_astar_planner.planning.endpoints import Endpoints, ViapointSource
from llm_astar_planner.planning.path_planner import PathPlanner
from llm_astar_planner.planning.types import (
    COMPILED,
    EXPLAINED,
    PLANNED_ON,
    Plan,
    PlanningFailure,
    PlanRequest,
    ResultCode,
    finite_or_none,
    kind_of_plan,
)
from llm_astar_planner.search.stop import StopFlag, no_stop

if TYPE_CHECKING:
    from llm_astar_planner.instructions.interpretation import RouteInstruction

NO_ALTERNATIVES = 'no alternatives: they go with no via points, footprint or instruction'
NOT_COMPILED = 'cancelled while the searches were compiled'


class Planner(PathPlanner):
    """Plans on one costmap. Immutable, so safe to share between threads."""

    def plan(self, request: PlanRequest, stop: StopFlag | None = None) -> Plan:
        """Answer a request. Never raises for what a request, a source or a map may hold.

        Another thread cancels by setting `stop[0] = 1`: the answer is then the best path so far,
        or TIMEOUT.
        """
        *_, plan = self.plans(request, stop, anytime=False)
        # So that a notebook can draw it. Those of `plans`, which nodes keep, hold no map.
        places = NO_PLACES if request.instruction is None else request.instruction.places
        PLANNED_ON[plan] = self.costmap, places
        return plan

    def plans(
        self, request: PlanRequest, stop: StopFlag | None = None, *, anytime: bool = True
    ) -> Iterator[Plan]:
        """Compile what a request takes, and return its plans: each better one, then the answer.

        Each is validated, and made when it is asked for; the time of the request begins with the
        first. Only `guided` and plug-ins that are generators find several, and only without via
        points and instruction. `anytime` False yields the answer alone. Otherwise as `plan`.
        """
        stop = no_stop() if stop is None else stop
        if request.viapoints:
            source = ViapointSource(request.viapoints, request.tolerance)
            request = replace(request, source=source)
        if not self.compile(request, stop):
            failure = PlanningFailure(ResultCode.TIMEOUT, NOT_COMPILED)
            endpoints = Endpoints(request.start, request.goal, request.via)
            return iter([self.build_plan(request, endpoints, [], failure=failure)])
        plans = self.direct_plans(request, stop, anytime=anytime)
        if request.instruction is not None:
            plans = self.instructed_plans(request, request.instruction, stop)
        if request.last_way is not None:
            from llm_astar_planner.planning.kept_way import kept_plans  # noqa: PLC0415

            plans = kept_plans(self, request, request.last_way, plans, stop)
        return self.explained_plans(request, plans, stop)

    def explained_plans(
        self, request: PlanRequest, plans: Iterator[Plan], stop: StopFlag
    ) -> Iterator[Plan]:
        """Yield plans; one without a path says why, or leads as near as possible if it may."""
        deadline = time.monotonic() + request.time_limit
        for plan in plans:
            if plan.is_final and request.alternatives and plan.code is ResultCode.NONE:
                yield self.with_alternatives(plan, request, stop, deadline)
                continue
            if plan.code not in EXPLAINED or stop[0]:
                yield plan
                continue
            # Only after a failure: other plans do not need it.
            from llm_astar_planner.planning.why import explained  # noqa: PLC0415

            again = partial(self.plan, stop=stop)
            yield explained(self.costmap, request, plan, again, deadline)

    def with_alternatives(
        self, plan: Plan, request: PlanRequest, stop: StopFlag, deadline: float
    ) -> Plan:
        """Return a plan with the ways to choose from that are found until the deadline."""
        if request.via or request.footprint or request.instruction:
            return replace(plan, warnings=(*plan.warnings, NO_ALTERNATIVES))
        from llm_astar_planner.planning.alternatives import WaysSearch  # noqa: PLC0415

        between = replace(request, start=plan.start, goal=plan.goal)
        found = WaysSearch(self.costmap, between, stop, deadline).ways()
        ways = [
            way._replace(clearance=finite_or_none(self.checker.measure(way.path).clearance))
            for way in islice(found, request.alternatives)
            if self.checker.path_problem(way.path, plan.start, plan.goal) is None
        ]
        return replace(plan, alternatives=tuple(ways))

    def compile(self, request: PlanRequest, stop: StopFlag | None = None) -> bool:
        """Compile what a request takes, or load it; tell whether that is done.

        Only the first one of its kind in a process takes time: up to half a minute where numba
        has nothing in its cache. `stop` ends it as it ends a plan.
        """
        is_graded = self.costmap.grid_graph.cell_surcharge.size > 0
        kind = self.config, request, is_graded, self.landmarks.current is not None
        if kind_of_plan(*kind) in COMPILED:
            return True
        # Importing it takes a while, and a process whose plans are compiled needs it no more.
        from llm_astar_planner.planning.compile import compile_for  # noqa: PLC0415

        with suppress(Exception):  # where it does not compile, the plan says why
            return compile_for(*kind, stop)
        return True

    def instructed_plans(
        self, request: PlanRequest, instruction: RouteInstruction, stop: StopFlag
    ) -> Iterator[Plan]:
        """Yield the plan of a request with an instruction."""
        # What instructions take is many modules, which other plans do not need.
        from llm_astar_planner.planning.instruction import (  # noqa: PLC0415
            plan_with_instruction,
        )

        yield plan_with_instruction(self, request, instruction, stop)
