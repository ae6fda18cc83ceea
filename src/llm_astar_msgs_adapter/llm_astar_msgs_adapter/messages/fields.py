"""Plain values of ROS messages by their fields, for live messages and those decoded from bags.

Nothing here imports ROS: a message is any object with the fields of its type.
"""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from llm_astar_msgs_adapter.maps.grid_map import GridMap, GridMapError, Pose2D

# How far a quaternion's norm may be from 1, and the roll and pitch a flat map may have (rad).
QUATERNION_TOLERANCE = 1e-3


def grid_from_message(message: Any) -> GridMap:  # noqa: ANN401 - live or decoded
    """Read a nav_msgs/OccupancyGrid. Raises GridMapError naming the field that is wrong."""
    info = message.info
    data = np.asarray(message.data, dtype=np.int8)
    if len(data) != info.width * info.height:
        size = f'{info.width} x {info.height}'
        raise GridMapError('data', f'{len(data)} cells do not fill a map of {size}')
    position = info.origin.position
    origin = Pose2D(position.x, position.y, yaw_of(info.origin.orientation, 'info.origin'))
    cells = data.reshape(info.height, info.width)
    return GridMap(cells, float(info.resolution), origin, message.header.frame_id)


def yaw_of(quaternion: Any, field: str) -> float:  # noqa: ANN401 - live or decoded
    """Return a quaternion's yaw in radians.

    Raises GridMapError naming `field` where it is not finite, has no unit norm, or has roll or
    pitch.
    """
    x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if not abs(norm - 1.0) <= QUATERNION_TOLERANCE:
        raise GridMapError(
            f'{field}.orientation', f'({x}, {y}, {z}, {w}) is not a unit quaternion'
        )
    if math.hypot(x, y) > QUATERNION_TOLERANCE:
        raise GridMapError(f'{field}.orientation', 'has roll or pitch; the map must be flat')
    return 2.0 * math.atan2(z, w)


def path_from_message(message: Any) -> NDArray[np.float64]:  # noqa: ANN401 - live or decoded
    """Read the points [n, 2] of a nav_msgs/Path, in metres in the path's own frame."""
    points = [(pose.pose.position.x, pose.pose.position.y) for pose in message.poses]
    return np.array(points, dtype=np.float64).reshape(-1, 2)


def headings_along(points: NDArray[np.float64], goal_yaw: float | None = None) -> list[float]:
    """Return a yaw (rad) for each of the points [n, 2] of a path, towards the next point.

    The last yaw is `goal_yaw` where given, else that of the point before.
    """
    if len(points) == 0:
        return []
    steps = np.diff(points, axis=0)
    yaws: list[float] = np.arctan2(steps[:, 1], steps[:, 0]).tolist()
    last = yaws[-1] if yaws else 0.0
    return [*yaws, last if goal_yaw is None else goal_yaw]


def pose_from_message(pose: Any, field: str = 'pose') -> Pose2D:  # noqa: ANN401
    """Read a geometry_msgs/Pose as a pose in the plane: x, y, and the heading projected on it.

    A quaternion need not have unit norm; one of zeros means yaw 0. Raises GridMapError naming
    `field` where a number is not finite.
    """
    position, quaternion = pose.position, pose.orientation
    x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    if not np.isfinite((position.x, position.y, x, y, z, w)).all():
        raise GridMapError(field, 'holds a number that is not finite')
    norm = math.hypot(x, y, z, w) or 1.0
    x, y, z, w = x / norm, y / norm, z / norm, w / norm
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return Pose2D(position.x, position.y, yaw)


def stamp_of(message: Any) -> int:  # noqa: ANN401 - live or decoded
    """Return the stamp in a message's header in nanoseconds."""
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def values_of_report(message: Any) -> dict[str, Any]:  # noqa: ANN401 - live or decoded
    """Return the values in a diagnostic_msgs/DiagnosticArray that holds one of our reports.

    Empty for any other message: our reports have one status, whose values are all JSON.
    """
    if len(message.status) != 1:
        return {}
    try:
        return {item.key: json.loads(item.value) for item in message.status[0].values}
    except (ValueError, RecursionError):
        return {}
