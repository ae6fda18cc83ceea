# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Nav2's `is_path_valid`: whether a path can still be followed, on the newest map."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.grid_map import GridMapError
from llm_astar_msgs_adapter.messages.fields import yaws_of
from nav_msgs.msg import Path
from numpy.typing import NDArray
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.common.parameters import Parameters
from llm_astar_planner.nodes.common.tf import FrameError, Frames
from llm_astar_planner.nodes.planner.robot_footprint import RobotFootprint
from llm_astar_planner.planning import path_validator as validator
from llm_astar_planner.planning.footprint_search import FootprintChecker

try:
    from nav2_msgs.srv import IsPathValid
except ImportError:
    IsPathValid = None

# Nav2's costs of cells: those up to 252 are published as an occupancy of 1 to 98, then come
# inscribed cells, which are 99, and lethal ones.
MOST_COST, INSCRIBED, LETHAL = 252, 253, 254
QUIET_SECONDS = 10.0


class ValidityError(LlmAstarError, ValueError):
    """A path that cannot be checked; the message says why."""


@dataclass(eq=False)
class PathValidityService:
    """Tells whether a path, of any planner, can still be followed on the newest map.

    That is what `newest` returns: the newest map that has arrived, although it may not be ready to
    be planned on: a behaviour tree waits 20 ms for the answer. Nothing is waited for. Where there
    is no polygon, the robot is a disc of the costmap's radius.
    """

    entities: Entities
    settings: Parameters
    frames: Frames
    newest: Callable[[], tuple[Costmap, validator.CollisionChecker] | None]
    footprint: RobotFootprint

    def __post_init__(self) -> None:
        """Serve `is_path_valid` if nav2_msgs is installed."""
        self._logger = self.entities.node.get_logger()
        if IsPathValid is not None:
            checks = MutuallyExclusiveCallbackGroup()
            self.entities.service(IsPathValid, 'is_path_valid', self.fill, checks)

    def fill(self, request: Any, response: Any) -> Any:  # noqa: ANN401 - IsPathValid's
        """Fill the response, checking from the pose nearest to the robot on, if that is known.

        A path that cannot be checked is not valid, and the log says why: one that is empty, that
        cannot be transformed to the map, or any without a map. Fields that newer messages have
        are used where they are there.
        """
        invalid: list[int] = []
        problem = None
        try:
            invalid = self.invalid(request).tolist()
        except LlmAstarError as error:
            problem = f'is_path_valid: {error}'
            self._logger.warning(problem, throttle_duration_sec=QUIET_SECONDS)
        response.is_valid = problem is None and not invalid
        response.invalid_pose_indices = invalid
        if hasattr(response, 'success'):
            response.success = problem is None
        return response

    def invalid(self, request: Any) -> NDArray[np.int64]:  # noqa: ANN401 - IsPathValid's
        """Return the indices of the poses that cannot be reached, in order.

        Raises ValidityError, FrameError, GridMapError.
        """
        newest = self.newest()
        if newest is None:
            raise ValidityError('no map has arrived yet')
        if not request.path.poses:
            raise ValidityError('the path is empty')
        for name in ('layer_name', 'footprint'):
            if getattr(request, name, ''):
                raise ValidityError(f'{name} must be empty: what is known of the robot counts')
        costmap, checker = newest
        poses = self.poses(request.path, costmap.grid_map.frame_id)
        first = self.first_index(poses, costmap.grid_map.frame_id)
        ahead = poses[first:]
        limit = occupancy_limit(getattr(request, 'max_cost', LETHAL))
        allow_unknown = not getattr(request, 'consider_unknown_as_obstacle', False)
        cells = costmap.grid_map.world_to_cells(ahead[:, :2])
        invalid = validator.invalid_poses(
            cells, checker, allow_unknown=allow_unknown, cost_limit=limit
        )
        footprint = self.footprint.current
        if footprint is not None:
            allowed = allow_unknown and costmap.config.allow_unknown
            body = FootprintChecker(costmap, footprint, allow_unknown=allowed)
            invalid |= body.collisions(ahead)
        return np.flatnonzero(invalid) + first

    def poses(self, path: Path, frame_id: str) -> NDArray[np.float64]:
        """Return a path's poses (x, y, yaw) [n, 3] in metres and radians, in the map's frame.

        The frame that they are in is transformed by its newest transform. Raises ValidityError,
        FrameError, GridMapError.
        """
        names = [pose.header.frame_id or path.header.frame_id for pose in path.poses]
        values = [
            (at.x, at.y, turn.x, turn.y, turn.z, turn.w)
            for at, turn in ((one.pose.position, one.pose.orientation) for one in path.poses)
        ]
        array = np.array(values, dtype=np.float64)
        poses = np.column_stack([array[:, :2], yaws_of(array[:, 2:])])
        if len({name or frame_id for name in names}) > 1:
            raise ValidityError('the poses are in several frames')
        if names[0] not in ('', frame_id):
            return moved_poses(poses, self.frames.matrix(names[0], frame_id, 'path'))
        return poses

    def first_index(self, poses: NDArray[np.float64], frame_id: str) -> int:
        """Return the index of the pose [n, 3] nearest to the robot, 0 if that is not known."""
        try:
            robot = self.frames.robot(self.settings['robot_base_frame'], frame_id)
        except (FrameError, GridMapError):
            return 0
        return validator.nearest_pose(poses[:, :2], robot.x, robot.y)


def moved_poses(poses: NDArray[np.float64], matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Transform poses (x, y, yaw) [n, 3] by a matrix [4, 4], in the plane."""
    headings = np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])]) @ matrix[:2, :2].T
    places = poses[:, :2] @ matrix[:2, :2].T + matrix[:2, 3]
    return np.column_stack([places, np.arctan2(headings[:, 1], headings[:, 0])])


def occupancy_limit(max_cost: int) -> int:
    """Return the occupancy from which on a cell costs `max_cost` or more in Nav2's costs.

    Where cells of different costs are published as the same occupancy, the cheapest of them
    counts. Beyond 254 no cell does.
    """
    if max_cost <= 0:
        return -1
    if max_cost <= MOST_COST:
        return 1 + 97 * (max_cost - 1) // 251
    return max_cost - INSCRIBED + 99 if max_cost <= LETHAL else validator.NO_LIMIT
