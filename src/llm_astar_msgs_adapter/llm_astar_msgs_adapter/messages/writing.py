# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Plain values as live ROS messages: maps, paths, poses, reports; `fields` reads them back."""

import array
import json
import math
from dataclasses import asdict
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, Quaternion
from nav_msgs.msg import OccupancyGrid, Path
from numpy.typing import ArrayLike

from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.fields import headings_along
from llm_astar_msgs_adapter.messages.report import ExchangeReport, PlanReport


def grid_to_message(grid_map: GridMap, stamp: Time) -> OccupancyGrid:
    """Write a map message, stamped and with its load time set to `stamp`."""
    message = OccupancyGrid()
    message.header.frame_id = grid_map.frame_id
    message.header.stamp = stamp
    message.info.map_load_time = stamp
    message.info.resolution = float(grid_map.resolution)
    message.info.width = grid_map.width
    message.info.height = grid_map.height
    message.info.origin.position.x = float(grid_map.origin.x)
    message.info.origin.position.y = float(grid_map.origin.y)
    message.info.origin.orientation = quaternion_of(grid_map.origin.yaw)
    # rclpy takes an array.array as it is, but copies a list or an ndarray element by element.
    message.data = array.array('b', grid_map.cells.tobytes())
    return message


def path_to_message(
    points: ArrayLike,
    frame_id: str,
    stamp: Time,
    goal_yaw: float | None = None,
    start_yaw: float | None = None,
) -> Path:
    """Write points [n, 2] in metres as a path with frame and stamp on every pose.

    Each pose is oriented towards the next; the last has `goal_yaw` (radians) where given, else
    the orientation of the pose before. The first has `start_yaw` where given, unless it is also
    the last and there is a `goal_yaw`.
    """
    points = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    message = Path()
    message.header.frame_id = frame_id
    message.header.stamp = stamp
    # A path may have 100,000 poses, so they share their header, and equal headings theirs.
    example = PoseStamped(header=message.header)
    orientations: dict[tuple[float, float], Quaternion] = {}
    yaws = headings_along(points, goal_yaw)
    if start_yaw is not None and (len(yaws) > 1 or (yaws and goal_yaw is None)):
        yaws[0] = start_yaw
    half_yaws = np.array(yaws) / 2.0
    values = zip(points.tolist(), np.sin(half_yaws).tolist(), np.cos(half_yaws).tolist())
    poses = []
    for (x, y), z, w in values:
        stamped, pose = copy_of(example), copy_of(example.pose)
        position = copy_of(pose.position)
        position.x, position.y = x, y
        if (z, w) not in orientations:
            orientations[z, w] = Quaternion(x=0.0, y=0.0, z=z, w=w)
        pose.position, pose.orientation = position, orientations[z, w]
        stamped.pose = pose
        poses.append(stamped)
    message.poses = poses
    return message


def copy_of(message: Any) -> Any:  # noqa: ANN401 - a message of any type
    """Return a copy of a message that shares its fields.

    Its constructor, which makes a default value for each field first, takes five times as long.
    """
    copied = object.__new__(type(message))
    for slot in message.__slots__:
        setattr(copied, slot, getattr(message, slot))
    return copied


def pose_to_message(pose: Pose2D, frame_id: str, stamp: Time) -> PoseStamped:
    """Write a stamped pose in the plane."""
    message = PoseStamped()
    message.header.frame_id = frame_id
    message.header.stamp = stamp
    message.pose.position.x = float(pose.x)
    message.pose.position.y = float(pose.y)
    message.pose.orientation = quaternion_of(pose.yaw)
    return message


def quaternion_of(yaw: float) -> Quaternion:
    """Return the quaternion of a yaw in radians."""
    return Quaternion(x=0.0, y=0.0, z=math.sin(yaw / 2.0), w=math.cos(yaw / 2.0))


def report_to_message(
    report: PlanReport | ExchangeReport, name: str, stamp: Time
) -> DiagnosticArray:
    """Write a report as one status with a key per field; `name` is the node's."""
    return status_to_message(name, report.level, report.summary, asdict(report), stamp)


def status_to_message(
    name: str, level: bytes, message: str, values: dict[str, Any], stamp: Time
) -> DiagnosticArray:
    """Write one diagnostic status with JSON values, which preserve numbers and lists."""
    pairs = [KeyValue(key=key, value=json.dumps(value)) for key, value in values.items()]
    status = DiagnosticStatus(name=name, level=level, message=message, values=pairs)
    diagnostics = DiagnosticArray(status=[status])
    diagnostics.header.stamp = stamp
    return diagnostics
