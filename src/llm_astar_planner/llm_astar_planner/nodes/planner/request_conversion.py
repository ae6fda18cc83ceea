"""From a caller's poses to a PlanRequest, or the code and the sentence why there is none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from geometry_msgs.msg import PoseStamped
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
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.source import WaypointSource

# How a caller names this planner in `planner_id`; GridBased is what Nav2's behaviour trees say.
OWN_IDS = ('', 'LLMAStar', 'GridBased')


class RequestError(PlanningFailure):
    """A goal that cannot be planned for: why, and Nav2's code for it."""


class GoalPoses(NamedTuple):
    """The poses of a goal in the map's frame, and the cells of its goals and of its viapoints."""

    start: Pose2D
    goals: tuple[Pose2D, ...]
    goal_cells: tuple[Cell, ...]
    viapoints: tuple[Cell, ...] = ()


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

    def refresh(self) -> None:
        """Follow changed parameters."""
        self._used = settings = self._settings.current
        self._fields = request_fields(settings)
        self._fields['source'] = self._source if settings['use_waypoints'] else None

    def poses(self, goal: PlanGoal, grid_map: GridMap, may_wait: MayWait = never) -> GoalPoses:
        """Return a goal's poses in the map's frame; a transform is awaited while `may_wait()`.

        Raises RequestError, and what `may_wait` raises.
        """
        frame_id = grid_map.frame_id
        if not goal.goals:
            raise RequestError(ResultCode.UNKNOWN, 'no goal is given')
        if len(goal.goals) > MAX_VIA + 1:
            message = f'goals: {len(goal.goals)}, over the {MAX_VIA + 1} allowed'
            raise RequestError(ResultCode.INVALID_PLANNER, message)
        goals, cells = [], []
        viapoints: tuple[Cell, ...] = ()
        try:
            start = self.start_pose(goal, frame_id, may_wait)
            for pose in goal.goals:
                if pose.header.frame_id in ('', frame_id):
                    goals.append(pose_from_message(pose.pose, 'goal'))
                else:
                    goals.append(self._frames.locate(pose, frame_id, 'goal', may_wait))
                cells.append(grid_map.world_to_cell(goals[-1].x, goals[-1].y))
            if goal.viapoints:
                viapoints = self.viapoint_cells(goal.viapoints, grid_map, may_wait)
        except FrameError as error:
            raise RequestError(ResultCode.TF_ERROR, str(error)) from None
        except GridMapError as error:
            raise RequestError(ResultCode.UNKNOWN, str(error)) from None
        return GoalPoses(start, tuple(goals), tuple(cells), viapoints)

    def viapoint_cells(
        self, poses: Sequence[PoseStamped], grid_map: GridMap, may_wait: MayWait
    ) -> tuple[Cell, ...]:
        """Return the cells of via points that guide the search.

        Raises RequestError for too many of them, FrameError and GridMapError as `Frames.locate`.
        """
        if len(poses) > MAX_VIAPOINTS:
            message = f'viapoints: {len(poses)}, over the {MAX_VIAPOINTS} allowed'
            raise RequestError(ResultCode.INVALID_PLANNER, message)
        places = [
            self._frames.locate(pose, grid_map.frame_id, f'via point {number}', may_wait)
            for number, pose in enumerate(poses, start=1)
        ]
        return tuple(grid_map.world_to_cell(place.x, place.y) for place in places)

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

    def to_request(
        self,
        goal: PlanGoal,
        poses: GoalPoses,
        grid_map: GridMap,
        time_limit: float,
        *,
        want_expanded: bool,
    ) -> PlanRequest:
        """Return the request to the planner; `time_limit` in seconds. Raises RequestError."""
        if self._settings.current is not self._used:
            self.refresh()
        cells = poses.goal_cells
        fields = self._fields | {'time_limit': time_limit, 'want_expanded': want_expanded}
        if goal.planner_id not in OWN_IDS:
            fields['method'] = goal.planner_id
        if fields['method'] not in METHODS and SEARCH_METHODS.problem(fields['method']):
            names = ', '.join([*OWN_IDS[1:], *METHODS, *SEARCH_METHODS.installed])
            message = f'no planner {goal.planner_id!r}; there is {names}'
            raise RequestError(ResultCode.INVALID_PLANNER, message)
        # A NaN is for the planner to refuse.
        if not goal.tolerance <= 0.0:
            fields['tolerance'] = goal.tolerance
        if poses.viapoints:
            fields['viapoints'] = poses.viapoints
        fields['footprint'] = self._footprint.current
        if self._footprint.current is not None:
            fields['start_pose'] = poses.start
            if not self._used['use_final_approach_orientation']:
                fields['goal_yaw'] = poses.goals[-1].yaw
        start = grid_map.world_to_cell(poses.start.x, poses.start.y)
        return PlanRequest(start, cells[-1], via=cells[:-1], **fields)
