"""What the fields of messages mean, of rclpy's classes and of those a bag is decoded into alike.

Nothing here needs ROS: a message is anything with the fields of its type.
"""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from llm_astar_msgs_adapter.maps.grid_map import GridMap, GridMapError, Pose2D

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


def pose_from_message(pose: Any, field: str = 'pose') -> Pose2D:  # noqa: ANN401
    """Read a geometry_msgs/Pose in the plane, its heading projected on it; of either world.

    A quaternion of any length will do, one of zeros looks along x. Raises GridMapError naming
    `field` where a number is not finite.
    """
    position, quaternion = pose.position, pose.orientation
    x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    if not all(map(math.isfinite, (position.x, position.y, x, y, z, w))):
        raise GridMapError(field, 'holds a number that is not finite')
    norm = math.hypot(x, y, z, w) or 1.0
    x, y, z, w = (part / norm for part in (x, y, z, w))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return Pose2D(position.x, position.y, yaw)


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
    except (ValueError, RecursionError):
        return {}
