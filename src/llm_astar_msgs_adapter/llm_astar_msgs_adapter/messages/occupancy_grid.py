"""nav_msgs/OccupancyGrid to GridMap and back."""

from __future__ import annotations

import array
import math

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion
from nav_msgs.msg import OccupancyGrid

from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.messages.fields import grid_from_message, yaw_of

__all__ = ['grid_from_message', 'grid_to_message', 'quaternion_of', 'yaw_of']


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


def quaternion_of(yaw: float) -> Quaternion:
    """Return the quaternion of a yaw in radians."""
    return Quaternion(x=0.0, y=0.0, z=math.sin(yaw / 2.0), w=math.cos(yaw / 2.0))
