"""Nav2's `is_path_valid`: whether a path is free on the newest map.

The check works on any object with the messages' fields, so it is tested without nav2_msgs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import FREE, GridMapError
from numpy.typing import NDArray
from rclpy.callback_groups import ReentrantCallbackGroup

from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.common.tf import FrameError, Frames
from llm_astar_planner.planning.path_validator import invalid_poses, nearest_pose
from llm_astar_planner.planning.planner import Planner

try:
    from nav2_msgs.srv import IsPathValid
except ImportError:
    IsPathValid = None


class PathValidityService:
    """Tells whether a path, of any planner, can still be followed on the newest map."""

    def __init__(self, frames: Frames, base_frame: Callable[[], str]) -> None:
        """Take the transforms; `base_frame` returns the name of the robot's frame."""
        self._frames = frames
        self._base_frame = base_frame

    def fill(self, request: Any, response: Any, planner: Planner | None) -> Any:  # noqa: ANN401 - IsPathValid's
        """Fill the response, checking from the pose nearest to the robot on, if that is known.

        A path that is empty, or cannot be transformed to the map, is not valid; nor is any
        without a map. Kilted's `consider_unknown_as_obstacle` is used if it is there.
        """
        checked = planner is not None and bool(request.path.poses)
        invalid: list[int] = []
        try:
            if planner is not None and checked:
                invalid = self.invalid(request, planner)
        except (FrameError, GridMapError):
            checked = False
        response.is_valid = checked and not invalid
        response.invalid_pose_indices = invalid
        if hasattr(response, 'success'):
            response.success = checked
        return response

    def invalid(self, request: Any, planner: Planner) -> list[int]:  # noqa: ANN401 - IsPathValid's
        """Return the indices of the poses that cannot be reached."""
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
        return invalid_poses(cells, blocked, self.first_index(points, frame_id))

    def first_index(self, points: NDArray[np.float64], frame_id: str) -> int:
        """Return the index of the pose [n, 2] nearest to the robot, 0 if that is not known."""
        try:
            robot = self._frames.robot(self._base_frame(), frame_id)
        except (FrameError, GridMapError):
            return 0
        return nearest_pose(points, robot.x, robot.y)


def serve_path_validity(
    entities: Entities, validity: PathValidityService, planner: Callable[[], Planner | None]
) -> None:
    """Serve `is_path_valid` if nav2_msgs is installed; `planner` returns the newest map's."""
    if IsPathValid is not None:
        entities.service(
            IsPathValid,
            'is_path_valid',
            lambda request, response: validity.fill(request, response, planner()),
            ReentrantCallbackGroup(),
        )
