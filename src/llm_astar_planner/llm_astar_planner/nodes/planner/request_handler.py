# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Answers goals: from poses to a PlanRequest, its plans, and what is published of them."""

import math
import threading
import time
import traceback
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from llm_astar_msgs_adapter.maps.grid_map import GridMap, GridMapError, Pose2D
from llm_astar_msgs_adapter.maps.places import Places
from llm_astar_msgs_adapter.messages.fields import pose_from_message
from llm_astar_msgs_adapter.messages.writing import path_to_message
from rclpy.node import Node

from llm_astar_planner.instructions.grammar.interpreter import GrammarInterpreter
from llm_astar_planner.nodes.common.parameters import Parameters
from llm_astar_planner.nodes.common.tf import FrameError, Frames, MayWait, never
from llm_astar_planner.nodes.planner import map_manager
from llm_astar_planner.nodes.planner.goals import (
    ACTION_NAMES,
    GOAL_POSE,
    CancellationToken,
    PlanGoal,
    PlanResponse,
    refusal,
)
from llm_astar_planner.nodes.planner.instruction_server import InstructionServer
from llm_astar_planner.nodes.planner.path_monitor import PathMonitor
from llm_astar_planner.nodes.planner.publishers import PathWriter, PlanPublisher
from llm_astar_planner.nodes.planner.robot_footprint import RobotFootprint
from llm_astar_planner.planning.compile import KernelCompiler
from llm_astar_planner.planning.parameters import request_fields
from llm_astar_planner.planning.plan_reuse import PathHistory
from llm_astar_planner.planning.questions import QuestionError, Questions
from llm_astar_planner.planning.types import (
    MAX_VIA,
    MAX_VIAPOINTS,
    PlanningFailure,
    PlanRequest,
    ResultCode,
)
from llm_astar_planner.search.methods import METHODS, SEARCH_METHODS
from llm_astar_planner.waypoints.source import WaypointSource

# The part of the planning time that is kept for checking and writing the path: seconds or a share.
FINISH_SECONDS, FINISH_SHARE = 0.1, 0.1
LEAST_SECONDS = 0.001
# Seconds that a cancelled goal may take to end before it is left behind.
LONGEST_END = 2.0
# How a caller names this planner in `planner_id`; GridBased is what Nav2's behaviour trees say.
OWN_IDS = ('', 'LLMAStar', 'GridBased')
INACTIVE = 'the node is not active: configure and activate it (lifecycle)'
# Times of the clock at which plans began that are remembered.
KEPT_TIMES = 1024


class RequestError(PlanningFailure):
    """A goal that cannot be planned for: why, and Nav2's code for it."""


@dataclass(frozen=True, eq=False)
class AcceptedGoal:
    """A goal that is being answered, since `begin` (monotonic) for at most `limit` seconds."""

    goal: PlanGoal
    token: CancellationToken
    stamp: Time
    begin: float
    limit: float

    def goes_on(self, limit: float = math.inf) -> bool:
        """Return True. Raises RequestError if it was cancelled, or `limit` seconds have passed."""
        if self.token.reason:
            raise RequestError(ResultCode.TIMEOUT, f'canceled: {self.token.reason}')
        seconds = time.monotonic() - self.begin
        if seconds > limit:
            message = f'its turn came after {seconds:.1f} s, and it has {limit:g} s'
            raise RequestError(ResultCode.TIMEOUT, message)
        return True

    def may_wait(self) -> bool:
        """Tell whether there is time left. Raises RequestError if the goal was cancelled."""
        return self.goes_on() and time.monotonic() < self.begin + self.limit

    def search_seconds(self) -> float:
        """Return the seconds that are left, but for those to check and write the path."""
        finish = min(FINISH_SECONDS, FINISH_SHARE * self.limit)
        return max(LEAST_SECONDS, self.begin + self.limit - finish - time.monotonic())


@dataclass(eq=False)
class RequestConverter:
    """Converts goals under the node's parameters; `source` is asked for waypoints."""

    settings: Parameters
    frames: Frames
    source: WaypointSource | None
    footprint: RobotFootprint

    def __post_init__(self) -> None:
        """Know no values of the parameters yet."""
        self._used: Mapping[str, Any] = {}
        self._fields: dict[str, Any] = {}

    def to_request(
        self,
        goal: PlanGoal,
        grid_map: GridMap,
        time_left: Callable[[], float],
        may_wait: MayWait = never,
        *,
        want_expanded: bool,
    ) -> tuple[PlanRequest, Pose2D, list[Pose2D]]:
        """Return the request, and the poses of its start and goals in the map's frame.

        A transform is awaited while `may_wait()`; the request has the seconds that `time_left`
        returns after that. Raises RequestError, and what `may_wait` raises.
        """
        if not goal.goals:
            raise RequestError(ResultCode.UNKNOWN, 'no goal is given')
        last, more = len(goal.goals), len(goal.viapoints)
        limits = ('goals', last, MAX_VIA + 1), ('viapoints', more, MAX_VIAPOINTS)
        for name, count, most in limits:
            if count > most:
                message = f'{name}: {count}, over the {most} allowed'
                raise RequestError(ResultCode.INVALID_PLANNER, message)
        names = ['start', *['goal'] * last, *map('via point {}'.format, range(1, more + 1))]
        places: list[Pose2D] = []
        try:
            for name, pose in zip(names, [goal.start, *goal.goals, *goal.viapoints]):
                if pose is None:
                    place = self.robot_pose(goal, grid_map.frame_id, may_wait)
                elif not pose.header.frame_id and goal.client in ACTION_NAMES:
                    # As in planner_server. Elsewhere no frame means that of the map.
                    raise FrameError(f'the {name} has no frame_id')
                elif pose.header.frame_id in ('', grid_map.frame_id):
                    place = pose_from_message(pose.pose, name)
                else:
                    place = self.frames.locate(pose, grid_map.frame_id, name, may_wait)
                places.append(place)
            cells = tuple(map(tuple, grid_map.world_to_cells(np.array(places)[:, :2]).tolist()))
        except FrameError as error:
            raise RequestError(ResultCode.TF_ERROR, str(error)) from None
        except GridMapError as error:
            # What is not finite lies on no map; a code after which trees do not clear it.
            is_start = not places and goal.start is not None
            code = ResultCode.START_OUTSIDE_MAP if is_start else ResultCode.GOAL_OUTSIDE_MAP
            raise RequestError(code, str(error)) from None
        start, goals = places[0], places[1 : last + 1]
        fields = self.fields(goal) | {'want_expanded': want_expanded, 'time_limit': time_left()}
        if self.footprint.current is not None:
            fields['start_pose'] = start
            if not self._used['use_final_approach_orientation']:
                fields['goal_yaw'] = goals[-1].yaw
        request = PlanRequest(
            cells[0], cells[last], via=cells[1:last], viapoints=cells[last + 1 :], **fields
        )
        return request, start, goals

    def robot_pose(self, goal: PlanGoal, frame_id: str, may_wait: MayWait) -> Pose2D:
        """Return the robot's pose, else the fallback start of a goal."""
        base, fallback = self.settings['robot_base_frame'], goal.fallback_start
        if fallback is None:
            return self.frames.robot(base, frame_id, may_wait)
        try:
            return self.frames.robot(base, frame_id)
        except FrameError:
            return self.frames.locate(fallback, frame_id, 'start', may_wait)

    def fields(self, goal: PlanGoal) -> dict[str, Any]:
        """Return what the parameters and a goal say of a request. Raises RequestError."""
        settings = self.settings.current
        if settings is not self._used:
            self._used, self._fields = settings, request_fields(settings)
            self._fields['source'] = self.source if settings['use_waypoints'] else None
        fields = self._fields | {'footprint': self.footprint.current}
        if goal.planner_id not in OWN_IDS:
            fields['method'] = goal.planner_id
        if fields['method'] not in METHODS and SEARCH_METHODS.problem(fields['method']):
            names = ', '.join([*OWN_IDS[1:], *METHODS, *SEARCH_METHODS.installed])
            message = f'no planner {goal.planner_id!r}; there is {names}'
            raise RequestError(ResultCode.INVALID_PLANNER, message)
        # A NaN is for the planner to refuse.
        if not goal.tolerance <= 0.0:
            fields['tolerance'] = goal.tolerance
        return fields


def path_key(goal: PlanGoal, place: Pose2D, grid_map: GridMap) -> tuple[object, ...]:
    """Return what goals share that keep one way: client, method and place, in cells of the frame.

    They are counted from the frame's origin, wherever the map begins.
    """
    x, y = (round(value / grid_map.resolution) for value in place[:2])
    return goal.client, goal.planner_id, x, y


@dataclass(eq=False, kw_only=True)
class RequestHandler:
    """Answers any number of goals at a time, from any thread, while it `is_active`."""

    node: Node
    settings: Parameters
    maps: map_manager.MapManager
    converter: RequestConverter
    compiler: KernelCompiler
    publisher: PlanPublisher
    instructions: InstructionServer
    monitor: PathMonitor
    is_active: bool = False

    def __post_init__(self) -> None:
        """Have nothing to answer yet."""
        # No goal's time runs before the node is active and what a first plan takes is compiled.
        self._ready_since = 0.0
        self._running: set[CancellationToken] = set()
        self._ended = threading.Condition()
        self._ways = PathHistory()
        # How many plans began at each of the last times of the clock.
        self._plans_at: dict[int, int] = {}
        self._waits = map_manager.CostmapWait(
            self.maps, lambda: self.settings.current['costmap_update_timeout']
        )
        self._last: PlanResponse | None = None

    def activate(self) -> None:
        """Answer goals from now on."""
        self._ready_since = time.monotonic()
        self.is_active = True

    def deactivate(self, reason: str) -> None:
        """Refuse goals from now on, cancel those being answered and wait until they ended."""
        self.is_active = False
        self._ways.clear()
        with self._ended:
            for token in self._running:
                token.cancel(reason)
            self._ended.wait_for(lambda: not self._running, LONGEST_END)

    def answer(
        self,
        goal: PlanGoal,
        token: CancellationToken | None = None,
        replan_reason: str = '',
    ) -> PlanResponse:
        """Plan, publish what came of it, and return it; never raises.

        `token` cancels it from another thread: its code is then TIMEOUT and only the report is
        published. `replan_reason` says why the path monitor plans again, '' if a client requested
        it.
        """
        token = token or CancellationToken()
        stamp = self.next_stamp()
        limit = self.settings.current['max_planning_time']
        job = AcceptedGoal(goal, token, stamp, max(token.arrived, self._ready_since), limit)
        with self._ended:
            self._running.add(token)
        try:
            try:
                if not self.is_active:
                    raise RequestError(ResultCode.UNKNOWN, INACTIVE)
                if not self.compiler.is_ready:
                    self.compiler.wait(job.goes_on)
                    self._ready_since = time.monotonic()
                    job = replace(job, begin=self._ready_since)
                response = self.plan(job, replan_reason)
            except PlanningFailure as failure:
                response = self.failed(job, failure.code, str(failure))
            except Exception as error:  # noqa: BLE001 - a robot waits for its answer
                self.node.get_logger().error(traceback.format_exc())
                message = f'{type(error).__name__} while planning: see the log'
                response = self.failed(job, ResultCode.UNKNOWN, message)
            if replan_reason:
                message = f'{replan_reason}; {response.plan.message}'
                response = replace(response, plan=replace(response.plan, message=message))
            else:
                self.monitor.tasks.put(partial(self.monitor.watch, response))
            self._last = response
            is_routine = bool(replan_reason) or goal.client in ACTION_NAMES
            self.publisher.publish_report(
                response, stamp, is_cancelled=bool(token.reason), is_routine=is_routine
            )
        finally:
            with self._ended:
                self._running.discard(token)
                self._ended.notify_all()
        return replace(response, seconds=time.monotonic() - job.begin)

    def answer_question(self, text: str, places: Places) -> str:
        """Return the answer to a question about the last plan. Raises QuestionError."""
        last = self._last
        if last is None or last.planner is None or last.request is None:
            raise QuestionError('nothing was planned yet that a question could be about')
        asked = Questions(last.planner, last.request, GrammarInterpreter(), places)
        return str(asked.answer(text)['sentence'])

    def next_stamp(self) -> Time:
        """Return the time now, a nanosecond later for each earlier plan at this time.

        Callers tell reports apart by it, and simulated time stands still between its messages and
        comes again when a simulation starts anew.
        """
        now = self.node.get_clock().now().nanoseconds
        with self._ended:
            earlier = self._plans_at.get(now, 0)
            self._plans_at[now] = earlier + 1
            if len(self._plans_at) > KEPT_TIMES:
                del self._plans_at[next(iter(self._plans_at))]
        seconds, nanoseconds = divmod(now + earlier, 10**9)
        return Time(sec=seconds, nanosec=nanoseconds)

    def plan(self, job: AcceptedGoal, replan_reason: str) -> PlanResponse:
        """Plan for a goal and publish its paths. Raises PlanningFailure."""
        job.goes_on(max(job.limit, self.settings.current['first_path_time_limit']))
        # A replan follows a new map, and is no retry.
        newest, waited = self.wait_for_map(job, may_be_retry=not replan_reason)
        if waited is not map_manager.NOT_WAITED:
            job = replace(job, begin=job.begin + waited.extra)
        planner, map_age = newest.planner, time.monotonic() - newest.arrived
        wants, grid_map = self.publisher.count_viewers() > 0, planner.grid_map
        request, start, goals = self.converter.to_request(
            job.goal, grid_map, job.search_seconds, job.may_wait, want_expanded=wants
        )
        keeps_heading = self.settings.current['use_final_approach_orientation']
        writer = PathWriter(planner, job.stamp, start, goals[-1], keeps_heading, request)
        way: Hashable = None
        if request.switch_margin:
            way = path_key(job.goal, goals[-1], grid_map)
            request = self._ways.add_to(request, way)
        if self.instructions.current.instruction is not None:
            request = self.instructions.add_to(request, planner, start, goals)
        # Who calls gets one path, and RViz shows that one; so where a way may be kept.
        shows_better = job.goal.client == GOAL_POSE and request.last_path is None
        plans = planner.plans(request, job.token.stop, anytime=shows_better)
        for plan in plans:
            if not (plan.is_final or job.token.reason):
                path = writer.write_plan(plan)
                self.publisher.publish_path(path, is_replan=bool(replan_reason))
        job.goes_on()
        path = writer.write_plan(plan)
        # Writing a long path takes time; a path that was cancelled meanwhile is not published.
        job.goes_on()
        is_made = plan.code is ResultCode.NONE
        if is_made:
            self.publisher.publish_path(path, is_replan=bool(replan_reason))
        if is_made and request.switch_margin:
            self._ways.remember(plan, request, way, planner.costmap)
        if is_made and request.instruction is not None:
            self.instructions.follow(path)
        self.publisher.publish_views(plan, grid_map, job.stamp, writer.write)
        if not replan_reason and (self._waits.failures or not is_made):
            self._waits.note(job.goal, failed=not is_made)
        if waited is not map_manager.NOT_WAITED:
            warnings = (*plan.warnings, *waited.warnings)
            plan = replace(plan, warnings=warnings, seconds_map=waited.seconds)
        return PlanResponse(job.goal, plan, path, job.begin, 0.0, planner, request, map_age)

    def wait_for_map(
        self, job: AcceptedGoal, *, may_be_retry: bool
    ) -> tuple[map_manager.PlanningMap, map_manager.MapWait]:
        """Return the map to plan on, and how it was waited for; mostly it is there.

        Raises RequestError where none has come for too long.
        """
        maps, waited = self.maps, map_manager.NOT_WAITED
        is_late = time.monotonic() > maps.arrivals.overdue_at
        if is_late or maps.is_preparing or maps.newest is None or self._waits.failures:
            limit = self.settings.current['costmap_timeout']
            if limit > 0.0 and (problems := maps.arrivals.warnings(limit)):
                message = f'{problems[0]} (costmap_timeout is {limit:g} s)'
                raise RequestError(ResultCode.TIMEOUT, message)
            is_retry = may_be_retry and self._waits.is_retry(job.goal)
            waited = self._waits.wait(job.begin, job.limit, job.goes_on, is_retry=is_retry)
        if maps.newest is None:
            raise RequestError(ResultCode.TIMEOUT, waited.warnings[0])
        return maps.newest, waited

    def failed(self, job: AcceptedGoal, code: ResultCode, message: str) -> PlanResponse:
        """Return the response to a goal that never came to planning, with an empty path."""
        newest = self.maps.newest
        frame_id = newest.planner.grid_map.frame_id if newest else ''
        path = path_to_message([], frame_id, job.stamp)
        return PlanResponse(job.goal, refusal(code, message), path, job.begin)
