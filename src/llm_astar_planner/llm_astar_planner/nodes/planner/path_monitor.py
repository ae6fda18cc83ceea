"""Looks at the last path again when the ground has changed, and replans a broken one."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from rclpy.node import Node

from llm_astar_planner.nodes.common.parameters import Parameters
from llm_astar_planner.nodes.planner.preemption import CancellationToken, PreemptingGoalSlot
from llm_astar_planner.nodes.planner.request_handler import RequestHandler, Standing
from llm_astar_planner.planning.plan_reuse import standing_problem
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import ResultCode

# A costmap changes every second: what is well is logged once in so many.
QUIET_SECONDS = 10.0


class PathMonitor:
    """Keeps the last published path true to the map, on a thread of its own."""

    def __init__(self, node: Node, settings: Parameters, answering: RequestHandler) -> None:
        """Take whose path it is."""
        self._logger = node.get_logger()
        self._settings = settings
        self._answering = answering
        self._newest = PreemptingGoalSlot()
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix='revalidation')
        self.last = 'no path yet'

    def look(self, planner: Planner) -> None:
        """Look at the last path on this ground, soon; a look that still goes on is given up."""
        cancel = self._newest.begin('the map has changed again')
        self._thread.submit(self._look, planner, cancel)

    def give_up(self, reason: str) -> None:
        """Give up a look that goes on: what it would publish is out of date."""
        self._newest.cancel(reason)

    def close(self) -> None:
        """End."""
        self.give_up('the node ends')
        self._thread.shutdown(cancel_futures=True)

    def _look(self, planner: Planner, cancel: CancellationToken) -> None:
        standing = self._answering.standing
        if standing is None or not self._answering.is_active or cancel.reason:
            return
        digest = planner.grid_map.digest
        problem = standing_problem(standing.plan, standing.grid_map, planner)
        if problem is None and not self._settings['replan_on_map']:
            self._settle(standing, replace(standing, grid_map=planner.grid_map))
            self.last = f'the path stands on map {digest}'
            self._logger.info(self.last, throttle_duration_sec=QUIET_SECONDS)
            return
        cause = problem or 'replan_on_map is set'
        self._replan(standing, cancel, f'replanned on map {digest}: {cause}')

    def _replan(self, standing: Standing, cancel: CancellationToken, why: str) -> None:
        self.last = why
        answer = self._answering.answer(standing.question, cancel, why=why)
        if answer.code is not ResultCode.NONE and not cancel.reason:
            # There is no path any more to look at.
            self._settle(standing, None)
            self.last = answer.message

    def _settle(self, before: Standing, after: Standing | None) -> None:
        """Note what became of the path looked at, unless a newer one was published."""
        if self._answering.standing is before:
            self._answering.standing = after
