# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Plain values of ROS messages by their fields, for live messages and those decoded from bags.

Nothing here imports ROS: a message is any object with the fields of its type.
"""

import contextlib
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from llm_astar_msgs_adapter.files import parse_json
from llm_astar_msgs_adapter.maps.grid_map import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    GridMap,
    GridMapError,
    Pose2D,
)

# How far a quaternion's norm may be from 1, and the roll and pitch a flat map may have (rad).
QUATERNION_TOLERANCE = 1e-3
# No map update arrives so much later (ns) than the whole map that contains it.
LONGEST_DELAY_NS = 10_000_000_000


def grid_from_message(message: Any) -> GridMap:  # noqa: ANN401 - live or decoded
    """Read a nav_msgs/OccupancyGrid, whose cells must not be changed afterwards.

    Raises GridMapError naming the field that is wrong.
    """
    info = message.info
    data = np.asarray(message.data, dtype=np.int8).view()
    data.flags.writeable = False  # a map takes such cells as they are
    if len(data) != info.width * info.height:
        size = f'{info.width} x {info.height}'
        raise GridMapError('data', f'{len(data)} cells do not fill a map of {size}')
    position = info.origin.position
    origin = Pose2D(position.x, position.y, yaw_of(info.origin.orientation, 'info.origin'))
    cells = data.reshape(info.height, info.width)
    return GridMap(cells, float(info.resolution), origin, message.header.frame_id)


def is_outdated(update: Any, map_time: int) -> bool:  # noqa: ANN401 - live or decoded
    """Tell whether a map update is older than a whole map stamped `map_time` (ns).

    Such a map contains the update already; they arrive in any order, on two topics. An update
    with stamp 0 is never outdated, nor is one that is far older: the clock has jumped back.
    """
    stamp = stamp_of(update)
    return 0 < stamp < map_time < stamp + LONGEST_DELAY_NS


def updated(grid_map: GridMap, update: Any) -> GridMap:  # noqa: ANN401 - live or decoded
    """Return the map with the rectangle of a map_msgs/OccupancyGridUpdate in it.

    An empty frame means the map's. Raises GridMapError, naming the field, for an update in another
    frame, one that does not lie on the map, one with too few cells, and for values that are no
    occupancy.
    """
    frame_id = update.header.frame_id
    if frame_id not in ('', grid_map.frame_id):
        problem = f'{frame_id!r} is not the frame of the map, {grid_map.frame_id!r}'
        raise GridMapError('header.frame_id', problem)
    x, y, width, height = update.x, update.y, update.width, update.height
    corner_ok = x >= 0 and y >= 0 and width > 0 and height > 0
    if not corner_ok or x + width > grid_map.width or y + height > grid_map.height:
        size = f'{grid_map.width} x {grid_map.height}'
        problem = f'{width} x {height} cells from ({x}, {y}) do not lie on a map of {size}'
        raise GridMapError('x, y, width, height', problem)
    patch = np.asarray(update.data, dtype=np.int8)
    if len(patch) != width * height:
        raise GridMapError('data', f'{len(patch)} cells do not fill {width} x {height}')
    if patch.min() < UNKNOWN or patch.max() > OCCUPIED:
        raise GridMapError('data', f'values must lie in {UNKNOWN}, {FREE} to {OCCUPIED}')
    cells: NDArray[np.int8] = grid_map.cells.copy()
    cells[y : y + height, x : x + width] = patch.reshape(height, width)
    # GridMap copies only arrays that can still be written to.
    cells.flags.writeable = False
    return GridMap(cells, grid_map.resolution, grid_map.origin, grid_map.frame_id)


def yaw_of(quaternion: Any, field: str) -> float:  # noqa: ANN401 - live or decoded
    """Return a quaternion's yaw in radians.

    Raises GridMapError naming `field` where it is not finite, has no unit norm, or has roll or
    pitch.
    """
    x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if not abs(norm - 1.0) <= QUATERNION_TOLERANCE:
        problem = f'({x}, {y}, {z}, {w}) is not a unit quaternion'
        raise GridMapError(f'{field}.orientation', problem)
    if math.hypot(x, y) > QUATERNION_TOLERANCE:
        raise GridMapError(f'{field}.orientation', 'has roll or pitch; the map must be flat')
    return 2.0 * math.atan2(z, w)


def yaws_of(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the yaw (rad) of each quaternion (x, y, z, w) [n, 4]: [n], projected on the plane.

    They need not have unit norm; one of zeros, or with a number that is not finite, means 0.
    """
    x, y, z, w = quaternions.T
    with np.errstate(invalid='ignore', over='ignore'):
        yaws = np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)
    found: NDArray[np.float64] = np.nan_to_num(yaws)
    return found


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
        return {item.key: parse_json(item.value) for item in message.status[0].values}
    except ValueError:
        return {}


def status_values(status: Any) -> dict[str, Any]:  # noqa: ANN401 - live or decoded
    """Return the values of a diagnostic status by key; a value that is not JSON stays text."""
    values = {item.key: item.value for item in status.values}
    for key, text in values.items():
        with contextlib.suppress(ValueError):
            values[key] = parse_json(text)
    return values
