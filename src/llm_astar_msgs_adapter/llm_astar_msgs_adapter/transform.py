"""geometry_msgs/TransformStamped applied to poses in the plane, without tf2.

The transform need not be a message: anything with its fields will do.
"""

from __future__ import annotations

import math
from typing import Any

from llm_astar_msgs_adapter.grid_map import GridMapError, Pose2D

# How far a quaternion's norm may be off 1.
QUATERNION_TOLERANCE = 1e-3


def transformed(pose: Pose2D, transform: Any) -> Pose2D:  # noqa: ANN401 - a TransformStamped
    """Return a pose of the transform's child frame in its parent frame, as tf2 looks it up.

    The pose's point and heading are turned in space and then projected on the parent's plane, so
    a frame on a slope is served as far as a plane can. Raises GridMapError, naming the field,
    where the transform is not finite or its rotation is no unit quaternion.
    """
    shift, turn = transform.transform.translation, transform.transform.rotation
    x, y, z, w = turn.x, turn.y, turn.z, turn.w
    if not all(map(math.isfinite, (shift.x, shift.y, shift.z, x, y, z, w))):
        raise GridMapError('transform', 'holds a number that is not finite')
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if abs(norm - 1.0) > QUATERNION_TOLERANCE:
        raise GridMapError('transform.rotation', f'({x}, {y}, {z}, {w}) is not a unit quaternion')
    # The first two rows of the rotation, for points and directions with no height.
    xx, xy = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z)
    yx, yy = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z)
    ahead, aside = math.cos(pose.yaw), math.sin(pose.yaw)
    return Pose2D(
        xx * pose.x + xy * pose.y + shift.x,
        yx * pose.x + yy * pose.y + shift.y,
        math.atan2(yx * ahead + yy * aside, xx * ahead + xy * aside),
    )


def pose_of(transform: Any) -> Pose2D:  # noqa: ANN401 - a TransformStamped
    """Return where the transform's child frame is in its parent. Raises as `transformed`."""
    return transformed(Pose2D(0.0, 0.0, 0.0), transform)
