"""What the fields of messages mean, of rclpy's classes and of those a bag is decoded into alike.

Nothing here needs ROS: a message is anything with the fields of its type.
"""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from llm_astar_msgs_adapter.grid_map import GridMap, GridMapError, Pose2D

# How far a quaternion's norm may be off 1, and how much roll and pitch a flat map may have.
QUATERNION_TOLERANCE = 1e-3


def grid_from_message(message: Any) -> GridMap:  # noqa: ANN401 - of either world
    """Read a nav_msgs/OccupancyGrid. Raises GridMapError naming the field that is no good."""
    info = message.info
    data = np.asarray(message.data, dtype=np.int8)
    if len(data) != info.width * info.height:
        size = f'{info.width} x {info.height}'
        raise GridMapError('data', f'{len(data)} cells do not fill a map of {size}')
    position = info.origin.position
    origin = Pose2D(position.x, position.y, yaw_of(info.origin.orientation, 'info.origin'))
    cells = data.reshape(info.height, info.width)
    return GridMap(cells, float(info.resolution), origin, message.header.frame_id)


def yaw_of(quaternion: Any, field: str) -> float:  # noqa: ANN401 - of either world
    """Return a quaternion's yaw in radians.

    Raises GridMapError naming `field` where it is not finite, not of unit norm or not flat.
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


def path_from_message(message: Any) -> NDArray[np.float64]:  # noqa: ANN401 - of either world
    """Read the points [n, 2] of a nav_msgs/Path in metres, whatever frame it is in."""
    points = [(pose.pose.position.x, pose.pose.position.y) for pose in message.poses]
    return np.array(points, dtype=np.float64).reshape(-1, 2)


def matrix_of(translation: Any, rotation: Any) -> NDArray[np.float64]:  # noqa: ANN401
    """Return the transform [4, 4] of a position and a quaternion, as of a Pose or Transform.

    Raises GridMapError where they hold no transform.
    """
    quaternion = np.array([rotation.x, rotation.y, rotation.z, rotation.w], dtype=float)
    place = np.array([translation.x, translation.y, translation.z], dtype=float)
    norm = float(np.linalg.norm(quaternion))
    if not (np.isfinite(place).all() and math.isfinite(norm) and norm > QUATERNION_TOLERANCE):
        raise GridMapError('pose', 'holds a number that is not finite, or no rotation')
    x, y, z, w = quaternion / norm
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, 3] = place
    return matrix


def stamp_of(message: Any) -> int:  # noqa: ANN401 - of either world
    """Return the stamp in a message's header in nanoseconds."""
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def values_of_report(message: Any) -> dict[str, Any]:  # noqa: ANN401 - of either world
    """Return the values of the one status in a diagnostic_msgs/DiagnosticArray of ours.

    Empty where it is none of ours, whose values are all JSON.
    """
    if len(message.status) != 1:
        return {}
    try:
        return {item.key: json.loads(item.value) for item in message.status[0].values}
    except ValueError:
        return {}
