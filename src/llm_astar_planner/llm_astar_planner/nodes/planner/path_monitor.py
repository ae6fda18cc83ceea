# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Owns the last published path; checks it when the map changes and replans a broken one."""

from __future__ import annotations

import threading
import traceback
from dataclasses import replace

from rclpy.node import Node

from llm_astar_planner.nodes.common.parameters import Parameters
from llm_astar_planner.nodes.planner.goals import (
    CancellationToken,
    PlanResponse,
    PreemptingGoalSlot,
)
from llm_astar_planner.nodes.planner.map_manager import MapManager
from llm_astar_planner.nodes.planner.request_handler import RequestHandler
from llm_astar_planner.nodes.planner.robot_footprint import RobotFootprint
from llm_astar_planner.planning.plan_reuse import CachedWaypointSource, reuse_problem
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import ResultCode

# A costmap changes every second: that all is well is logged once in so many seconds.
QUIET_SECONDS = 10.0
NO_PATH = 'no path yet'


class PathMonitor:
    """Keeps the last published path valid on the newest map, on a thread of its own.

    What comes faster than the thread can follow replaces what waits for it.
    """

    def __init__(
        self,
        node: Node,
        settings: Parameters,
        maps: MapManager,
        handler: RequestHandler,
        *,
        replans: PreemptingGoalSlot,
        cache: CachedWaypointSource | None,
        footprint: RobotFootprint,
    ) -> None:
        """Take the parts it works with; a replan runs in the slot `replans`.

        `cache` is given the waypoints of the paths watched, which are held against `footprint`.
        """
        self.state = NO_PATH
        self._logger = node.get_logger()
        self._settings = settings
        self._maps = maps
        self._handler = handler
        self._replans = replans
        self._cache = cache
        self._footprint = footprint
        self._watched: PlanResponse | None = None
        self._changed = threading.Condition()
        self._closing = False
        self._to_remember: PlanResponse | None = None
        self._to_check: tuple[Planner, CancellationToken | None, str] | None = None
        self._is_replanning = False
        self._thread = threading.Thread(target=self.work, name='path_monitor', daemon=True)
        self._thread.start()

    def watch(self, response: PlanResponse) -> None:
        """Watch the path of a response instead of the last one; a failure changes nothing."""
        planner = response.planner
        if response.plan.code is not ResultCode.NONE or planner is None:
            return
        self._watched = response
        self.state = f'planned on map {planner.grid_map.digest}: {response.plan.message}'
        with self._changed:
            self._to_remember = response
            self._changed.notify()
        newest = self._maps.newest
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
        with self._changed:
            token = None
            if change or not self._is_replanning:
                token = self._replans.begin(change or 'the map has changed again')
            self._to_check = (planner, token, change)
            self._changed.notify()

    def check_again(self, change: str) -> None:
        """Check the path on the newest map, if there is one, since something else has changed."""
        newest = self._maps.newest
        if newest is not None:
            self.check(newest.planner, change)

    def close(self) -> None:
        """Stop."""
        self._replans.cancel('the node ends')
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._thread.join()

    def work(self) -> None:
        """Remember and check what is newest, until closed."""
        while True:
            with self._changed:
                self._changed.wait_for(
                    lambda: self._closing or self._to_remember or self._to_check
                )
                if self._closing:
                    return
                response, self._to_remember = self._to_remember, None
                check, self._to_check = self._to_check, None
            try:
                if response is not None:
                    self.remember(response)
                if check is not None:
                    self.check_now(*check)
            except Exception:  # noqa: BLE001 - a failure must not end the thread unnoticed
                self._logger.error(traceback.format_exc())
            # A thread that waits must not keep a map alive.
            del response, check

    def check_now(self, planner: Planner, token: CancellationToken | None, change: str) -> None:
        """Check the path, and replan if it is broken or `replan_on_map` is set.

        Without a token, which a replan that ran still had, it begins one.
        """
        token = token or self._replans.begin('')
        watched = self._watched
        if watched is None or watched.planner is None:
            return
        if not self._handler.is_active or token.reason:
            return
        digest = planner.grid_map.digest
        footprint = self._footprint.current
        problem = reuse_problem(watched.plan, watched.planner.grid_map, planner, footprint)
        if problem is None and not self._settings['replan_on_map']:
            self.update(watched, replace(watched, planner=planner))
            self.state = f'the path stands on map {digest}'
            self._logger.info(self.state, throttle_duration_sec=QUIET_SECONDS)
            return
        reason = problem or change or 'replan_on_map is set'
        self.state = f'replanned on map {digest}: {reason}'
        self._is_replanning = True
        try:
            response = self._handler.answer(watched.goal, token, replan_reason=self.state)
        finally:
            self._is_replanning = False
        if response.plan.code is ResultCode.NONE:
            self.remember(response)
            self.update(watched, response)
        elif not token.reason:
            self.update(watched, None)
            self.state = response.plan.message

    def remember(self, response: PlanResponse) -> None:
        """Cache the waypoints that led to a path."""
        planner, request = response.planner, response.request
        if self._cache is not None and planner is not None and request is not None:
            self._cache.remember(response.plan, planner.grid_map, response.started)

    def update(self, before: PlanResponse, after: PlanResponse | None) -> None:
        """Replace the watched path, unless a newer one was published meanwhile."""
        if self._watched is before:
            self._watched = after
