# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Owns the last published path; checks it when the map changes and replans a broken one."""

import threading
import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from queue import SimpleQueue

from rclpy.impl.rcutils_logger import RcutilsLogger

from llm_astar_planner.nodes.common.parameters import Parameters
from llm_astar_planner.nodes.planner import goals
from llm_astar_planner.nodes.planner.map_manager import MapManager
from llm_astar_planner.nodes.planner.robot_footprint import RobotFootprint
from llm_astar_planner.planning.plan_reuse import WaypointCache, reuse_problem
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import ResultCode

# A costmap changes every second: that all is well is logged once in so many seconds.
QUIET_SECONDS = 10.0
NO_PATH = 'no path yet'


@dataclass(eq=False)
class PathMonitor:
    """Keeps the last published path valid on the newest map, on a thread of its own.

    Its `tasks` are done one after the other; a check that comes faster than that replaces the one
    that waits. The methods but `start`, `check`, `check_again` and `close` are for that thread. A
    replan runs in the slot `replans`; `cache` is given the waypoints of the paths watched, which
    are held against `footprint`.
    """

    logger: RcutilsLogger
    settings: Parameters
    maps: MapManager
    replans: goals.PreemptingGoalSlot
    cache: WaypointCache | None
    footprint: RobotFootprint
    state: str = NO_PATH

    def __post_init__(self) -> None:
        """Watch nothing yet."""
        self.tasks: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._watched: goals.PlanResponse | None = None
        self._to_check: tuple[Planner, goals.CancellationToken | None, str] | None = None
        self._is_replanning = False

    def start(self, goal_handler: goals.GoalHandler) -> None:
        """Begin; `goal_handler` plans again."""
        self._goal_handler = goal_handler
        self._thread = threading.Thread(target=self.work, name='path_monitor', daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop."""
        self.replans.cancel('the node ends')
        self.tasks.put(None)
        self._thread.join()

    def work(self) -> None:
        """Do tasks, until closed."""
        while (task := self.tasks.get()) is not None:
            try:
                task()
            except Exception:  # noqa: BLE001 - a failure must not end the thread unnoticed
                self.logger.error(traceback.format_exc())
            # A thread that waits must not keep a map alive.
            del task

    def watch(self, response: goals.PlanResponse) -> None:
        """Watch the path of a response instead of the last one; a failure changes nothing."""
        planner = response.planner
        if response.plan.code is not ResultCode.NONE or planner is None:
            return
        self._watched = response
        self.state = f'planned on map {planner.grid_map.digest}: {response.plan.message}'
        self.remember(response)
        newest = self.maps.newest
        if newest is not None and newest.planner is not planner:
            self.check(newest.planner)  # the map changed while the path was planned

    def forget(self) -> None:
        """Stop watching: no robot follows the path any more."""
        self._watched = None
        self.state = NO_PATH

    def check(self, planner: Planner, change: str = '') -> None:
        """Check the path on this map soon, once a replan that runs has ended.

        `change` says what else has changed, '' for the map alone: that cancels the replan. A map
        does not, since maps may come faster than one is made.
        """
        token = None
        if change or not self._is_replanning:
            token = self.replans.begin(change or 'the map has changed again')
        self._to_check = (planner, token, change)
        self.tasks.put(self.check_newest)

    def check_again(self, change: str) -> None:
        """Check the path on the newest map, if there is one, since something else has changed."""
        newest = self.maps.newest
        if newest is not None:
            self.check(newest.planner, change)

    def check_newest(self) -> None:
        """Do the check that came last, unless it is done.

        The path is planned again if it is broken or `replan_on_map` is set. Without a token, which
        a replan that ran still had, the check begins one.
        """
        check, self._to_check = self._to_check, None
        if check is None:
            return
        planner, token, change = check
        token = token or self.replans.begin('')
        watched = self._watched
        if watched is None or watched.planner is None:
            return
        if not self._goal_handler.is_active or token.reason:
            return
        digest = planner.grid_map.digest
        footprint = self.footprint.current
        problem = reuse_problem(watched.plan, watched.planner.grid_map, planner, footprint)
        if problem is None and not self.settings['replan_on_map']:
            self._watched = replace(watched, planner=planner)
            self.state = f'the path stands on map {digest}'
            self.logger.info(self.state, throttle_duration_sec=QUIET_SECONDS)
            return
        reason = problem or change or 'replan_on_map is set'
        self.state = f'replanned on map {digest}: {reason}'
        self._is_replanning = True
        try:
            response = self._goal_handler.answer(watched.goal, token, replan_reason=self.state)
        finally:
            self._is_replanning = False
        if response.plan.code is ResultCode.NONE:
            self.remember(response)
            self._watched = response
        elif not token.reason:
            self._watched = None
            self.state = response.plan.message

    def remember(self, response: goals.PlanResponse) -> None:
        """Cache the waypoints that led to a path."""
        planner, request = response.planner, response.request
        if self.cache is not None and planner is not None and request is not None:
            self.cache.remember(response.plan, planner.grid_map, response.started)
