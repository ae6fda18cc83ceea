# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Goals, and what takes them: `~/get_plan`, and Nav2's two path actions if nav2_msgs is installed.

The conversions work on any object with the messages' fields, so they are tested without nav2_msgs.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.service_introspection import ServiceIntrospectionState

from llm_astar_planner.nodes.common.entities import CALLS, RELIABLE, Entities, QueuedService
from llm_astar_planner.planning.types import Plan, PlanRequest, ResultCode

# The services are there before what plans is imported: see planner_node.
if TYPE_CHECKING:
    from llm_astar_planner.planning.planner import Planner

# The services, actions and topics that goals come by.
ACTION_NAMES = ('compute_path_to_pose', 'compute_path_through_poses')
GET_PLAN, GOAL_POSE = '~/get_plan', 'goal_pose'
# Callers served at a time; more wait their turn. Waiting for waypoints takes a thread, no core.
# An action takes as many goals, which preempt each other, and rejects more.
CALLERS = 16
INTROSPECTION_STATES = {
    'disabled': ServiceIntrospectionState.OFF,
    'metadata': ServiceIntrospectionState.METADATA,
    'contents': ServiceIntrospectionState.CONTENTS,
}

try:
    from nav2_msgs.action import ComputePathThroughPoses, ComputePathToPose
except ImportError:
    ACTIONS: dict[str, Any] = {}
else:
    ACTIONS = dict(zip(ACTION_NAMES, (ComputePathToPose, ComputePathThroughPoses)))

# Seconds that a result is kept, as long as Nav2's planner_server keeps it: it may be large.
RESULT_SECONDS = 10
CANCELED = 'the caller canceled'
# The code after which Nav2's behaviour trees clear the costmaps and ask again.
REACHABLE_LATER = ResultCode.NO_VALID_PATH.name
# Seconds to wait until rclpy's goal handle knows of a cancel that was announced.
CANCEL_SECONDS = 1.0
QUIET_SECONDS = 1.0


@dataclass(frozen=True, eq=False)
class PlanGoal:
    """What a caller wants: a path from `start`, or from the robot's pose, through `goals`.

    `tolerance` in metres replaces the parameter if it is above 0. `planner_id` may name a method.
    `fallback_start` is used if the robot's pose is not known. `viapoints` guide the search; the
    path need not pass them. `client` names the service, action or topic that it came by.
    """

    goals: tuple[PoseStamped, ...]
    start: PoseStamped | None = None
    tolerance: float = 0.0
    planner_id: str = ''
    fallback_start: PoseStamped | None = None
    viapoints: tuple[PoseStamped, ...] = ()
    client: str = ''


class CancellationToken:
    """Cancellation of one plan: the search polls `stop`; `reason` says why, '' while it runs.

    `arrived` is when its goal came, in monotonic seconds: its time runs from there.
    """

    def __init__(self, arrived: float | None = None, reason: str = '') -> None:
        """Make the token of a goal that came now by default; with a reason it is cancelled."""
        self.stop = np.zeros(1, dtype=np.uint8)
        self.reason = reason
        self.arrived = time.monotonic() if arrived is None else arrived

    def cancel(self, reason: str) -> None:
        """Cancel, once and for all; the first reason counts."""
        self.reason = self.reason or reason
        self.stop[0] = 1


class PreemptingGoalSlot:
    """A new goal preempts the previous one."""

    def __init__(self) -> None:
        """Make an empty slot."""
        self._lock = threading.Lock()
        self._current = CancellationToken()

    def begin(self, reason: str, token: CancellationToken | None = None) -> CancellationToken:
        """Cancel the previous goal for this reason; return the token of the new one."""
        with self._lock:
            previous, self._current = self._current, token or CancellationToken()
            previous.cancel(reason)
            return self._current

    def cancel(self, reason: str) -> None:
        """Cancel the current goal, if there is one."""
        with self._lock:
            self._current.cancel(reason)


@dataclass(frozen=True, eq=False)
class PlanResponse:
    """What a caller gets: the goal, the plan, its path as a message (empty on failure).

    `planner` is the one that planned and `request` what it was asked, None if it never came to
    planning; its map had arrived `map_age` seconds before. `started` is in monotonic seconds,
    `seconds` wall time.
    """

    goal: PlanGoal
    plan: Plan
    path: Path
    started: float = 0.0
    seconds: float = 0.0
    planner: Planner | None = None
    request: PlanRequest | None = None
    map_age: float | None = None


# Plans for a goal: RequestHandler.answer.
Answer = Callable[..., PlanResponse]


class GoalHandler(Protocol):
    """What takes goals while it is active, and answers each; it never raises."""

    @property
    def answer(self) -> Answer:
        """Plans for a goal."""

    @property
    def is_active(self) -> bool:
        """Whether goals are taken."""


def refusal(code: ResultCode, message: str) -> Plan:
    """Return the plan of a goal that never came to planning."""
    return Plan(code, message, '', (0, 0), (0, 0), np.zeros((0, 0), dtype=np.bool_))


def serve_goals(entities: Entities, goal_handler: GoalHandler, introspection: str) -> None:
    """Serve `~/get_plan` and Nav2's path actions.

    `introspection` is one of INTROSPECTION_STATES, for `~/get_plan`. Nothing that takes long to
    import is needed.
    """

    def on_get_plan(
        request: GetPlan.Request, response: GetPlan.Response, arrived: float, busy: str
    ) -> GetPlan.Response:
        tolerance = float(request.tolerance)
        goal = PlanGoal((request.goal,), request.start, tolerance, client=GET_PLAN)
        response.plan = goal_handler.answer(goal, CancellationToken(arrived, busy)).path
        return response

    calls = QueuedService(entities, GetPlan, GET_PLAN, on_get_plan, threads=CALLERS)
    state = INTROSPECTION_STATES[introspection]
    calls.service.configure_introspection(entities.node.get_clock(), RELIABLE, state)
    for name, kind in ACTIONS.items():
        PathAction(entities, kind, name, goal_handler)
    served = 'with' if ACTIONS else 'without nav2_msgs, so without'
    entities.node.get_logger().info(f"{served} Nav2's planner actions")


def plan_goal(goal: Any, client: str = '') -> PlanGoal:  # noqa: ANN401 - a goal of either action
    """Convert the goal of the action `client`.

    That is `goal`, or `goals`, which since Kilted is a nav_msgs/Goals. `viapoints` came to
    ComputePathToPose after Kilted.
    """
    goals = getattr(goal, 'goals', None)
    poses = [goal.goal] if goals is None else getattr(goals, 'goals', goals)
    start = goal.start if goal.use_start else None
    viapoints = tuple(getattr(goal, 'viapoints', ()))
    return PlanGoal(
        tuple(poses), start, planner_id=goal.planner_id, viapoints=viapoints, client=client
    )


def fill_result(result: Any, response: PlanResponse, reason: str = '') -> Any:  # noqa: ANN401 - of either action
    """Write a response into an action's result, in the action's own numbers.

    `reason` says why it was cancelled, '' if it was not. The two actions count from 200 and from
    300. `error_msg` was added in the course of Jazzy; it names the plan's own code where that is
    a finer one. After Kilted came `last_reached_index`: a path goes through all poses, and without
    one the index is unset, which is the same number.
    """
    plan, name = response.plan, error_name(response, reason)
    whole = int(response.seconds)
    result.path = response.path
    result.planning_time = Duration(sec=whole, nanosec=int((response.seconds - whole) * 1e9))
    result.error_code = int(getattr(type(result), name))
    if hasattr(result, 'error_msg'):
        is_finer = name == REACHABLE_LATER != plan.code.name
        message = f'{plan.message} [{plan.code.name}]' if is_finer else plan.message
        result.error_msg = '' if plan.code is ResultCode.NONE else message
    if hasattr(result, 'last_reached_index'):
        result.last_reached_index = int(type(result).ALL_GOALS)
    return result


def error_name(response: PlanResponse, reason: str) -> str:
    """Return the name of the action's code, by which a behaviour tree decides what to do next.

    It is that of planner_server with NavFn, which frees the start's cell, and looks for a cell
    within `tolerance` wherever the goal cannot be reached: what may be cleared away is
    NO_VALID_PATH. A cancelled or preempted goal has no code at all.
    """
    code, request = response.plan.code, response.request
    if not response.goal.goals:
        return 'NO_VIAPOINTS_GIVEN'
    if reason and code is ResultCode.TIMEOUT:
        return ResultCode.NONE.name
    has_tolerance = request is not None and request.tolerance > 0.0
    if code is ResultCode.START_OCCUPIED or (code is ResultCode.GOAL_OCCUPIED and has_tolerance):
        return REACHABLE_LATER
    return code.name


class PathAction:
    """One action server; a new goal preempts the previous one."""

    def __init__(
        self,
        entities: Entities,
        kind: Any,  # noqa: ANN401 - an action type
        name: str,
        goal_handler: GoalHandler,
    ) -> None:
        """Serve the action."""
        self._kind, self._name = kind, name
        self._logger = entities.node.get_logger()
        self._goal_handler = goal_handler
        self._slot = PreemptingGoalSlot()
        self._tokens: dict[bytes, CancellationToken] = {}
        server = ActionServer(
            entities.node, kind, name, self.execute,
            # One at a time: in a reentrant group, goals sent one right after the other may be
            # accepted in another order, and the newest be preempted. Plans run outside of it.
            callback_group=MutuallyExclusiveCallbackGroup(), goal_callback=self.on_goal,
            handle_accepted_callback=self.on_accepted, cancel_callback=self.on_cancel,
            result_timeout=RESULT_SECONDS, goal_service_qos_profile=CALLS,
            result_service_qos_profile=CALLS, cancel_service_qos_profile=CALLS,
        )  # fmt: skip
        entities.on_close(server.destroy)
        entities.on_close(lambda: self._slot.cancel('the node ends'))

    def on_goal(self, _: Any) -> GoalResponse:  # noqa: ANN401 - any goal
        """Accept a goal if the node is active and few others wait for their end."""
        is_busy = len(self._tokens) >= CALLERS
        if is_busy:
            busy = f'{self._name}: busy: {len(self._tokens)} goals are waiting'
            self._logger.warning(busy, throttle_duration_sec=QUIET_SECONDS)
        is_taken = self._goal_handler.is_active and not is_busy
        return GoalResponse.ACCEPT if is_taken else GoalResponse.REJECT

    def on_accepted(self, handle: Any) -> None:  # noqa: ANN401 - rclpy's own
        """Cancel the previous goal and execute this one."""
        self._slot.begin('a newer goal came', self.token_of(handle))
        handle.execute()

    def on_cancel(self, handle: Any) -> CancelResponse:  # noqa: ANN401 - rclpy's own
        """Cancel a goal."""
        self.token_of(handle).cancel(CANCELED)
        return CancelResponse.ACCEPT

    def token_of(self, handle: Any) -> CancellationToken:  # noqa: ANN401 - rclpy's own
        """Return a goal's token; a cancel may ask for it before the goal is executed."""
        return self._tokens.setdefault(bytes(handle.goal_id.uuid), CancellationToken())

    def execute(self, handle: Any) -> Any:  # noqa: ANN401 - rclpy's own
        """Plan for a goal and finish it."""
        goal, token = plan_goal(handle.request, self._name), self.token_of(handle)
        response = self._goal_handler.answer(goal, token)
        if token.reason == CANCELED:
            wait_for_cancel(handle)
        if handle.is_cancel_requested:
            # The path may have been found just before, but the caller does not take it any more.
            message = f'canceled: {token.reason or CANCELED}'
            plan = replace(response.plan, code=ResultCode.TIMEOUT, message=message)
            response = replace(response, plan=plan, path=Path())
            handle.canceled()
        elif response.plan.code is ResultCode.NONE:
            handle.succeed()
        else:
            handle.abort()
        # Not before the end, after which no cancel can come.
        del self._tokens[bytes(handle.goal_id.uuid)]
        return fill_result(self._kind.Result(), response, token.reason)


def wait_for_cancel(handle: Any) -> None:  # noqa: ANN401 - rclpy's own
    """Wait until a goal handle knows that it was cancelled, a moment after the callback."""
    deadline = time.monotonic() + CANCEL_SECONDS
    while not handle.is_cancel_requested and time.monotonic() < deadline:
        time.sleep(0.001)
