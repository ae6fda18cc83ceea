"""Answers goals: converts them, has them planned, and publishes what came of it."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

from builtin_interfaces.msg import Time
from cachetools import LRUCache
from llm_astar_msgs_adapter.messages.writing import path_to_message
from nav_msgs.msg import Path
from rclpy.node import Node

from llm_astar_planner.nodes.common.parameters import Parameters
from llm_astar_planner.nodes.planner.costmap_wait import NOT_WAITED, CostmapWait
from llm_astar_planner.nodes.planner.goals import (
    CancellationToken,
    PlanGoal,
    PlanResponse,
    PreemptingGoalSlot,
    refusal,
)
from llm_astar_planner.nodes.planner.instruction_server import InstructionServer
from llm_astar_planner.nodes.planner.map_manager import MapManager
from llm_astar_planner.nodes.planner.publishers import PathWriter, PlanPublisher
from llm_astar_planner.nodes.planner.request_conversion import (
    RequestConverter,
    RequestError,
)
from llm_astar_planner.planning.compile import KernelCompiler
from llm_astar_planner.planning.types import PlanningFailure, ResultCode

# The part of the planning time that is kept for checking and writing the path: seconds or a share.
FINISH_SECONDS, FINISH_SHARE = 0.1, 0.1
LEAST_SECONDS = 0.001
# Seconds that a cancelled goal may take to end before it is left behind.
LONGEST_END = 2.0
INACTIVE = 'the node is not active: configure and activate it (lifecycle)'
NEWER_PATH = 'a newer path was published'
# Times of the clock at which plans began that are remembered.
KEPT_TIMES = 1024


@dataclass(frozen=True, eq=False)
class Job:
    """A goal that is being answered, since `begin` (monotonic) for at most `limit` seconds."""

    goal: PlanGoal
    token: CancellationToken
    stamp: Time
    begin: float
    limit: float

    def goes_on(self) -> bool:
        """Return True. Raises RequestError if the goal was cancelled."""
        if self.token.reason:
            raise RequestError(ResultCode.TIMEOUT, f'canceled: {self.token.reason}')
        return True

    def may_wait(self) -> bool:
        """Tell whether there is time left. Raises RequestError if the goal was cancelled."""
        return self.goes_on() and time.monotonic() < self.begin + self.limit

    def search_seconds(self) -> float:
        """Return the seconds that are left, but for those to check and write the path."""
        finish = min(FINISH_SECONDS, FINISH_SHARE * self.limit)
        return max(LEAST_SECONDS, self.begin + self.limit - finish - time.monotonic())


class RequestHandler:
    """Answers any number of goals at a time, from any thread, while it `is_active`."""

    def __init__(
        self,
        node: Node,
        settings: Parameters,
        maps: MapManager,
        converter: RequestConverter,
        *,
        compiler: KernelCompiler,
        publisher: PlanPublisher,
        replans: PreemptingGoalSlot,
        instructions: InstructionServer,
    ) -> None:
        """Take the parts it works with.

        `replans` is the slot of replans: publishing a path that a client has just requested
        preempts them.
        """
        self.is_active = False
        self._running: set[CancellationToken] = set()
        self._ended = threading.Condition()
        # How many plans began at each of the last times of the clock.
        self._plans_at: LRUCache[int, int] = LRUCache(KEPT_TIMES)
        self._node = node
        self._settings = settings
        self._maps = maps
        self._waits = CostmapWait(maps, lambda: settings.current['costmap_update_timeout'])
        self._compiler = compiler
        self._converter = converter
        self._publisher = publisher
        self._replans = replans
        self._instructions = instructions

    def activate(self) -> None:
        """Answer goals from now on."""
        self.is_active = True

    def deactivate(self, reason: str) -> None:
        """Refuse goals from now on, cancel those being answered and wait until they ended."""
        self.is_active = False
        with self._ended:
            for token in self._running:
                token.cancel(reason)
            self._ended.wait_for(lambda: not self._running, LONGEST_END)

    def answer(
        self,
        goal: PlanGoal,
        token: CancellationToken | None = None,
        on_better: Callable[[], None] | None = None,
        replan_reason: str = '',
    ) -> PlanResponse:
        """Plan, publish what came of it, and return it; never raises.

        `token` cancels it from another thread: its code is then TIMEOUT and only the report is
        published. `on_better` is called after each better path published on the way.
        `replan_reason` says why the path monitor plans again, '' if a client requested it.
        """
        stamp = self.next_stamp()
        limit = self._settings.current['max_planning_time']
        job = Job(goal, token or CancellationToken(), stamp, time.monotonic(), limit)
        with self.running(job.token):
            try:
                if self.is_active and not self._compiler.is_ready:
                    self._compiler.wait(job.goes_on)
                    job = replace(job, begin=time.monotonic())
                response = self.plan(job, on_better, replan_reason)
            except PlanningFailure as failure:
                response = self.failed(job, failure.code, str(failure))
            except Exception as error:  # noqa: BLE001 - a robot waits for its answer
                self._node.get_logger().error(traceback.format_exc())
                message = f'{type(error).__name__} while planning: see the log'
                response = self.failed(job, ResultCode.UNKNOWN, message)
            if replan_reason:
                message = f'{replan_reason}; {response.plan.message}'
                response = replace(response, plan=replace(response.plan, message=message))
            self._publisher.publish_report(response, stamp, is_cancelled=bool(job.token.reason))
        return replace(response, seconds=time.monotonic() - job.begin)

    def next_stamp(self) -> Time:
        """Return the time now, a nanosecond later for each earlier plan at this time.

        Callers tell reports apart by it, and simulated time stands still between its messages and
        comes again when a simulation starts anew.
        """
        now = self._node.get_clock().now().nanoseconds
        with self._ended:
            earlier = self._plans_at.get(now, 0)
            self._plans_at[now] = earlier + 1
        seconds, nanoseconds = divmod(now + earlier, 10**9)
        return Time(sec=seconds, nanosec=nanoseconds)

    def plan(
        self, job: Job, on_better: Callable[[], None] | None, replan_reason: str
    ) -> PlanResponse:
        """Plan for a goal and publish its paths. Raises PlanningFailure."""
        if not self.is_active:
            raise RequestError(ResultCode.UNKNOWN, INACTIVE)
        waited, maps = NOT_WAITED, self._maps
        is_late = time.monotonic() > maps.arrivals.overdue_at
        if is_late or maps.is_preparing or maps.newest is None or self._waits.failures:
            # A replan follows a new map, and is no retry.
            is_retry = not replan_reason and self._waits.is_retry(job.goal)
            waited = self._waits.wait(job.begin, job.limit, job.goes_on, is_retry=is_retry)
            job = replace(job, begin=job.begin + waited.extra)
        newest = maps.newest
        if newest is None:
            raise RequestError(ResultCode.TIMEOUT, waited.warnings[0])
        planner, map_age = newest.planner, time.monotonic() - newest.arrived
        request, start, goals = self._converter.to_request(
            job.goal,
            planner.grid_map,
            job.search_seconds,
            job.may_wait,
            want_expanded=self._publisher.wants_expanded,
        )
        keeps_heading = self._settings.current['use_final_approach_orientation']
        writer = PathWriter(
            planner, job.stamp, start, goals[-1], keeps_heading=keeps_heading, request=request
        )
        if self._instructions.current.instruction is not None:
            request = self._instructions.add_to(request, planner, start, goals)
        began = time.monotonic()
        plans = planner.plans(request, job.token.stop)
        # Its time does not run while its searches are compiled.
        job = replace(job, begin=job.begin + time.monotonic() - began)
        deadline = job.begin + job.limit
        for plan in plans:
            if not plan.is_final:
                # Half of the time left is for the search and the final path.
                path, _ = writer.write_plan(plan, (time.monotonic() + deadline) / 2.0)
                if not job.token.reason:
                    self.publish(path, replan_reason)
                    if on_better is not None:
                        on_better()
        job.goes_on()
        path, left_out = writer.write_plan(plan, deadline)
        # Writing a long path takes time; a path that was cancelled meanwhile is not published.
        job.goes_on()
        if plan.code is ResultCode.NONE:
            self.publish(path, replan_reason)
            if request.instruction is not None:
                self._instructions.follow(path)
        self._publisher.publish_views(plan, planner.grid_map, job.stamp, writer.write)
        is_made = plan.code is ResultCode.NONE
        if not replan_reason and (self._waits.failures or not is_made):
            self._waits.note(job.goal, failed=not is_made)
        if waited is not NOT_WAITED or left_out:
            warnings = (*plan.warnings, *waited.warnings, *left_out)
            plan = replace(plan, warnings=warnings, seconds_map=waited.seconds)
        return PlanResponse(job.goal, plan, path, job.begin, 0.0, planner, request, map_age)

    def publish(self, path: Path, replan_reason: str) -> None:
        """Publish a path; one that a client has just requested preempts a replan."""
        if not replan_reason:
            self._replans.cancel(NEWER_PATH)
        self._publisher.publish_path(path)

    def failed(self, job: Job, code: ResultCode, message: str) -> PlanResponse:
        """Return the response to a goal that never came to planning, with an empty path."""
        newest = self._maps.newest
        frame_id = newest.planner.grid_map.frame_id if newest else ''
        path = path_to_message([], frame_id, job.stamp)
        return PlanResponse(job.goal, refusal(code, message), path, job.begin)

    @contextmanager
    def running(self, token: CancellationToken) -> Iterator[None]:
        """Let `deactivate` cancel the goal of a token and wait for its end."""
        with self._ended:
            self._running.add(token)
        try:
            yield
        finally:
            with self._ended:
                self._running.discard(token)
                self._ended.notify_all()
