"""nav_msgs/Path and poses to plain values and back."""

from __future__ import annotations

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from numpy.typing import ArrayLike

from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_msgs_adapter.messages import fields
from llm_astar_msgs_adapter.messages.fields import headings_along, path_from_message
from llm_astar_msgs_adapter.messages.occupancy_grid import quaternion_of

__all__ = ['path_from_message', 'path_to_message', 'pose_from_message', 'pose_to_message']


def path_to_message(
    points: ArrayLike, frame_id: str, stamp: Time, goal_yaw: float | None = None
) -> Path:
    """Write points [n, 2] in metres as a path with frame and stamp on every pose.

    Each pose is oriented towards the next; the last has `goal_yaw` (radians) where given, else
    the orientation of the pose before.
    """
    points = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    message = Path()
    message.header.frame_id = frame_id
    message.header.stamp = stamp
    # A path may have thousands of poses, so they share their header and nothing is called here.
    half_yaws = np.array(headings_along(points, goal_yaw)) / 2.0
    values = zip(points.tolist(), np.sin(half_yaws).tolist(), np.cos(half_yaws).tolist())
    poses = []
    for (x, y), z, w in values:
        pose = PoseStamped(header=message.header)
        pose.pose.position.x, pose.pose.position.y = x, y
        pose.pose.orientation.z, pose.pose.orientation.w = z, w
        poses.append(pose)
    message.poses = poses
    return message


def pose_to_message(pose: Pose2D, frame_id: str, stamp: Time) -> PoseStamped:
    """Write a stamped pose in the plane."""
    message = PoseStamped()
    message.header.frame_id = frame_id
    message.header.stamp = stamp
    message.pose.position.x = float(pose.x)
    message.pose.position.y = float(pose.y)
    message.pose.orientation = quaternion_of(pose.yaw)
    return message


def pose_from_message(message: PoseStamped, field: str = 'pose') -> Pose2D:
    """Read a pose in the plane: x, y, and the heading projected on it.

    Raises GridMapError naming `field` where a number is not finite.
    """
    return fields.pose_from_message(message.pose, field)
