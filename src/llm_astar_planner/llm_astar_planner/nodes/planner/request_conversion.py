"""From a caller's poses to a PlanRequest, or the code and the sentence why there is none."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap, GridMapError, Pose2D
from llm_astar_msgs_adapter.messages.fields import pose_from_message

from llm_astar_planner.nodes.common.parameters import Parameters
from llm_astar_planner.nodes.common.tf import FrameError, Frames, MayWait, never
from llm_astar_planner.nodes.planner.goals import PlanGoal
from llm_astar_planner.nodes.planner.robot_footprint import RobotFootprint
from llm_astar_planner.planning.parameters import request_fields
from llm_astar_planner.planning.types import (
    MAX_VIA,
    MAX_VIAPOINTS,
    PlanningFailure,
    PlanRequest,
    ResultCode,
)
from llm_astar_planner.search.methods import METHODS, SEARCH_METHODS
from llm_astar_planner.waypoints.source import WaypointSource

# How a caller names this planner in `planner_id`; GridBased is what Nav2's behaviour trees say.
OWN_IDS = ('', 'LLMAStar', 'GridBased')


class RequestError(PlanningFailure):
    """A goal that cannot be planned for: why, and Nav2's code for it."""


class Converted(NamedTuple):
    """A request to the planner, and the poses of its start and goals in the map's frame."""

    request: PlanRequest
    start: Pose2D
    goals: tuple[Pose2D, ...]


class RequestConverter:
    """Converts goals under the node's parameters."""

    def __init__(
        self,
        settings: Parameters,
        frames: Frames,
        source: WaypointSource | None,
        footprint: RobotFootprint,
    ) -> None:
        """Take the parameters, the transforms, the waypoint source, and the robot's polygon."""
        self._settings = settings
        self._frames = frames
        self._source = source
        self._footprint = footprint
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
    ) -> Converted:
        """Return the request to the planner; a transform is awaited while `may_wait()`.

        It has the seconds that `time_left` returns after that. Raises RequestError, and what
        `may_wait` raises.
        """
        check_counts(goal)
        frame_id, locate = grid_map.frame_id, self._frames.locate
        try:
            start = self.start_pose(goal, frame_id, may_wait)
            goals = [
                pose_from_message(pose.pose, 'goal')
                if pose.header.frame_id in ('', frame_id)
                else locate(pose, frame_id, 'goal', may_wait)
                for pose in goal.goals
            ]
            viapoints = [
                locate(pose, frame_id, f'via point {number}', may_wait)
                for number, pose in enumerate(goal.viapoints, start=1)
            ]
            places = [start, *goals, *viapoints]
            cells = tuple(map(tuple, grid_map.world_to_cells(np.array(places)[:, :2]).tolist()))
        except FrameError as error:
            raise RequestError(ResultCode.TF_ERROR, str(error)) from None
        except GridMapError as error:
            raise RequestError(ResultCode.UNKNOWN, str(error)) from None
        fields = self.fields(goal) | {'want_expanded': want_expanded, 'time_limit': time_left()}
        if self._footprint.current is not None:
            fields['start_pose'] = start
            if not self._used['use_final_approach_orientation']:
                fields['goal_yaw'] = goals[-1].yaw
        last = len(goals)
        request = PlanRequest(
            cells[0], cells[last], via=cells[1:last], viapoints=cells[last + 1 :], **fields
        )
        return Converted(request, start, tuple(goals))

    def start_pose(self, goal: PlanGoal, frame_id: str, may_wait: MayWait) -> Pose2D:
        """Return the goal's start, else the robot's pose, else its fallback start."""
        if goal.start is not None and goal.start.header.frame_id in ('', frame_id):
            return pose_from_message(goal.start.pose, 'start')
        if goal.start is not None:
            return self._frames.locate(goal.start, frame_id, 'start', may_wait)
        base, fallback = self._settings['robot_base_frame'], goal.fallback_start
        if fallback is None:
            return self._frames.robot(base, frame_id, may_wait)
        try:
            return self._frames.robot(base, frame_id)
        except FrameError:
            return self._frames.locate(fallback, frame_id, 'start', may_wait)

    def fields(self, goal: PlanGoal) -> dict[str, Any]:
        """Return what the parameters and a goal say of a request. Raises RequestError."""
        settings = self._settings.current
        if settings is not self._used:
            self._used, self._fields = settings, request_fields(settings)
            self._fields['source'] = self._source if settings['use_waypoints'] else None
        fields = self._fields | {'footprint': self._footprint.current}
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


def check_counts(goal: PlanGoal) -> None:
    """Raise RequestError for a goal with no pose, or with too many."""
    if not goal.goals:
        raise RequestError(ResultCode.UNKNOWN, 'no goal is given')
    for name, poses, most in (
        ('goals', goal.goals, MAX_VIA + 1),
        ('viapoints', goal.viapoints, MAX_VIAPOINTS),
    ):
        if len(poses) > most:
            message = f'{name}: {len(poses)}, over the {most} allowed'
            raise RequestError(ResultCode.INVALID_PLANNER, message)
