"""nav_msgs/OccupancyGrid to GridMap and back."""

from __future__ import annotations

import array
import math

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion
from nav_msgs.msg import OccupancyGrid

from llm_astar_msgs_adapter.grid_map import GridMap, GridMapError, Pose2D

# How far a quaternion's norm may be off 1, and how much roll and pitch a flat map may have.
QUATERNION_TOLERANCE = 1e-3


def grid_from_message(message: OccupancyGrid) -> GridMap:
    """Read a map message. Raises GridMapError naming the field that makes it unusable."""
    info = message.info
    data = np.asarray(message.data, dtype=np.int8)
    if len(data) != info.width * info.height:
        size = f'{info.width} x {info.height}'
        raise GridMapError('data', f'{len(data)} cells do not fill a map of {size}')
    position = info.origin.position
    origin = Pose2D(position.x, position.y, yaw_of(info.origin.orientation, 'info.origin'))
    cells = data.reshape(info.height, info.width)
    return GridMap(cells, float(info.resolution), origin, message.header.frame_id)


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
    # An array.array is handed over as it is; a list or an ndarray would be copied by element.
    message.data = array.array('b', grid_map.cells.tobytes())
    return message


def yaw_of(quaternion: Quaternion, field: str) -> float:
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


def quaternion_of(yaw: float) -> Quaternion:
    """Return the quaternion of a yaw in radians."""
    return Quaternion(x=0.0, y=0.0, z=math.sin(yaw / 2.0), w=math.cos(yaw / 2.0))
