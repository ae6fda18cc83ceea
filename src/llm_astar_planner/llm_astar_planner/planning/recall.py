"""Plans with a memory: a question is not searched twice, nor a source asked twice for a goal."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.planning.plan_memory import PlanMemory, is_settled
from llm_astar_planner.planning.plan_reuse import WaypointCache
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import Plan, PlanRequest
from llm_astar_planner.search.guided import AnytimeSolution


class Recall:
    """Answers requests from memory where it can, and else by a planner. Thread-safe."""

    def __init__(self, size: int) -> None:
        """Remember at most `size` plans; with 0 neither plans nor waypoints are remembered."""
        self._plans = PlanMemory(size)
        self._waypoints = WaypointCache()
        self._size = size
        self._forgotten = 0

    def resize(self, size: int) -> None:
        """Remember at most so many plans from now on; 0 forgets the waypoints too."""
        self._size = size
        self._plans.resize(size)
        if size == 0:
            self._waypoints.forget()

    def forget(self) -> None:
        """Forget all: the source may answer otherwise now."""
        self._forgotten += 1
        self._plans.forget()
        self._waypoints.forget()

    def plan(
        self,
        planner: Planner,
        request: PlanRequest,
        seconds: float,
        stop: NDArray[np.uint8],
        on_improvement: Callable[[AnytimeSolution], None] | None = None,
    ) -> tuple[Plan | None, str]:
        """Return the plan within `seconds` and how it was come by, as `PlanMemory.answer` does.

        Requests are the same where map, rules and all their fields are, whatever time is left.
        No plan: a caller that waited for another's search was stopped, or out of time.
        """
        deadline, forgotten = time.monotonic() + seconds, self._forgotten

        def make() -> Plan:
            source = self._waypoints.source_for(request, planner) if self._size else request.source
            # Another's search may have been waited for before.
            time_left = deadline - time.monotonic()
            asked = replace(request, source=source, time_limit=time_left)
            plan = planner.plan(asked, stop, on_improvement)
            # What was under way when all was forgotten is of the time before.
            if forgotten == self._forgotten:
                self._waypoints.keep(request, plan, planner.grid_map)
            return plan

        key = (planner.grid_map.digest, planner.config, request)
        return self._plans.answer(key, make, stop, seconds, lambda plan: is_settled(plan, request))
