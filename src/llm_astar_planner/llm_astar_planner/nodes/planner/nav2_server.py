"""Nav2's planner interface: its two path actions and `is_path_valid`, where nav2_msgs is there.

The translation takes and gives anything with the messages' fields, so that it can be tested
without them.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration
from llm_astar_msgs_adapter.maps.grid_map import FREE, GridMapError
from nav_msgs.msg import Path
from numpy.typing import NDArray
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup

from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.common.tf import FrameError, Frames
from llm_astar_planner.nodes.planner.preemption import CancellationToken, PreemptingGoalSlot
from llm_astar_planner.nodes.planner.request_conversion import PlanGoal
from llm_astar_planner.nodes.planner.request_handler import Answer, RequestHandler
from llm_astar_planner.planning.path_check import invalid_poses, nearest_pose
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.planning.types import ResultCode

try:
    from nav2_msgs.action import ComputePathThroughPoses, ComputePathToPose
    from nav2_msgs.srv import IsPathValid
except ImportError:
    HAS_NAV2 = False
else:
    HAS_NAV2 = True

# A result of a thousand poses is no small thing: kept as long as Nav2's own planner keeps it.
RESULT_SECONDS = 10
CANCELED = 'the caller canceled'
# Seconds to wait for rclpy to note a cancel of which it has told.
NOTING_SECONDS = 1.0


def question_of(goal: Any) -> PlanGoal:  # noqa: ANN401 - a goal of either action
    """Return the question of a goal: `goal`, or `goals`, since Kilted within a nav_msgs/Goals."""
    goals = getattr(goal, 'goals', None)
    poses = [goal.goal] if goals is None else getattr(goals, 'goals', goals)
    start = goal.start if goal.use_start else None
    return PlanGoal(tuple(poses), start, planner_id=goal.planner_id)


def fill_result(result: Any, question: PlanGoal, answer: Answer) -> Any:  # noqa: ANN401 - of either action
    """Write an answer into a result, in the action's own numbers.

    The two actions count from 200 and from 300, and the second has a code for no poses at all.
    `error_msg` came in the course of Jazzy.
    """
    name = answer.code.name if question.goals else 'NO_VIAPOINTS_GIVEN'
    whole = int(answer.seconds)
    result.path = answer.path
    result.planning_time = Duration(sec=whole, nanosec=int((answer.seconds - whole) * 1e9))
    result.error_code = int(getattr(type(result), name))
    if hasattr(result, 'error_msg'):
        result.error_msg = '' if answer.code is ResultCode.NONE else answer.message
    return result


class PathAction:
    """One action server: plans for its newest goal, and gives up the one before."""

    def __init__(
        self,
        entities: Entities,
        kind: Any,  # noqa: ANN401 - an action type
        name: str,
        answering: RequestHandler,
    ) -> None:
        """Serve the action."""
        self._kind = kind
        self._answering = answering
        self._newest = PreemptingGoalSlot()
        self._cancels: dict[bytes, CancellationToken] = {}
        server = ActionServer(
            entities.node,
            kind,
            name,
            self._execute,
            callback_group=ReentrantCallbackGroup(),
            goal_callback=self._on_request,
            handle_accepted_callback=self._on_accepted,
            cancel_callback=self._on_cancel,
            result_timeout=RESULT_SECONDS,
        )
        entities.on_close(server.destroy)
        entities.on_close(lambda: self._newest.cancel('the node ends'))

    def _on_request(self, _: Any) -> GoalResponse:  # noqa: ANN401 - any goal
        return GoalResponse.ACCEPT if self._answering.is_active else GoalResponse.REJECT

    def _on_accepted(self, handle: Any) -> None:  # noqa: ANN401 - rclpy's own
        self._newest.begin('a newer goal came', self._cancel_of(handle))
        handle.execute()

    def _on_cancel(self, handle: Any) -> CancelResponse:  # noqa: ANN401 - rclpy's own
        self._cancel_of(handle)(CANCELED)
        return CancelResponse.ACCEPT

    def _cancel_of(self, handle: Any) -> CancellationToken:  # noqa: ANN401 - rclpy's own
        """Return a goal's way out, which may be asked for before the goal is taken up."""
        return self._cancels.setdefault(_id(handle), CancellationToken())

    def _execute(self, handle: Any) -> Any:  # noqa: ANN401 - rclpy's own
        question, cancel = question_of(handle.request), self._cancel_of(handle)
        answer = self._answering.answer(
            question,
            cancel,
            lambda: handle.publish_feedback(self._kind.Feedback()),
        )
        if cancel.reason == CANCELED:
            _wait_for_cancel(handle)
        if handle.is_cancel_requested:
            # The path may have been there just before: it is not taken any more.
            message = f'canceled: {cancel.reason or CANCELED}'
            answer = replace(answer, path=Path(), code=ResultCode.TIMEOUT, message=message)
            handle.canceled()
        elif answer.code is ResultCode.NONE:
            handle.succeed()
        else:
            handle.abort()
        # Not before the end, which is when no cancel can come any more.
        del self._cancels[_id(handle)]
        return fill_result(self._kind.Result(), question, answer)


class PathCheck:
    """Tells whether a path, from whichever planner, can still be followed on the latest map."""

    def __init__(self, frames: Frames, base_frame: Callable[[], str]) -> None:
        """Take what knows the robot; `base_frame` returns its frame's name."""
        self._frames = frames
        self._base_frame = base_frame

    def fill(self, request: Any, response: Any, planner: Planner | None) -> Any:  # noqa: ANN401 - IsPathValid's
        """Write the verdict: from the pose nearest to the robot on, if it is known where it is.

        A path that is empty, or cannot be placed on the map, is not valid; nor is any without a
        map. Kilted's `consider_unknown_as_obstacle` is heeded where it is there.
        """
        checked = planner is not None and bool(request.path.poses)
        invalid: list[int] = []
        try:
            if planner is not None and checked:
                invalid = self._invalid(request, planner)
        except (FrameError, GridMapError):
            checked = False
        response.is_valid = checked and not invalid
        response.invalid_pose_indices = invalid
        if hasattr(response, 'success'):
            response.success = checked
        return response

    def _invalid(self, request: Any, planner: Planner) -> list[int]:  # noqa: ANN401 - IsPathValid's
        grid_map, path = planner.grid_map, request.path
        frame_id, path_frame = grid_map.frame_id, path.header.frame_id
        for pose in path.poses:
            pose.header.frame_id = pose.header.frame_id or path_frame
        places = [self._frames.locate(pose, frame_id, 'path', lambda: True) for pose in path.poses]
        points = np.array([place[:2] for place in places])
        cells = np.array([grid_map.world_to_cell(x, y) for x, y in points.tolist()])
        blocked = planner.costmap.blocked
        if getattr(request, 'consider_unknown_as_obstacle', False):
            blocked = blocked | (grid_map.cells < FREE)
        return invalid_poses(cells, blocked, self._first(points, frame_id))

    def _first(self, points: NDArray[np.float64], frame_id: str) -> int:
        try:
            robot = self._frames.robot(self._base_frame(), frame_id)
        except (FrameError, GridMapError):
            return 0
        return nearest_pose(points, robot.x, robot.y)


def serve_nav2(
    entities: Entities,
    answering: RequestHandler,
    check: PathCheck,
    planner: Callable[[], Planner | None],
) -> bool:
    """Serve what Nav2 calls a planner by; tell whether nav2_msgs is there to do so.

    `planner` returns the planner of the latest map.
    """
    if not HAS_NAV2:
        return False
    PathAction(entities, ComputePathToPose, 'compute_path_to_pose', answering)
    PathAction(entities, ComputePathThroughPoses, 'compute_path_through_poses', answering)
    entities.service(
        IsPathValid,
        'is_path_valid',
        lambda request, response: check.fill(request, response, planner()),
        ReentrantCallbackGroup(),
    )
    return True


def _wait_for_cancel(handle: Any) -> None:  # noqa: ANN401 - rclpy's own
    """Wait until a goal counts as canceled, which may be a moment after the cancel was told of."""
    deadline = time.monotonic() + NOTING_SECONDS
    while not handle.is_cancel_requested and time.monotonic() < deadline:
        time.sleep(0.001)


def _id(handle: Any) -> bytes:  # noqa: ANN401 - rclpy's own
    return bytes(handle.goal_id.uuid)
