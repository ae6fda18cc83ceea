# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The newest transforms between frames, and poses in the plane transformed by them.

Nothing here imports tf2: a transform is any object with the fields of geometry_msgs/Transform.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from llm_astar_msgs_adapter.maps.grid_map import GridMapError, Pose2D
from llm_astar_msgs_adapter.messages.fields import QUATERNION_TOLERANCE

# A moving transform older than this (ns) is not used.
MAX_AGE = 10_000_000_000
MAX_DEPTH = 64


class Link(NamedTuple):
    """The transform [4, 4] of a frame into its parent, received at `time` (ns)."""

    parent: str
    matrix: NDArray[np.float64]
    time: int
    static: bool


class Transforms:
    """Keeps the newest transform of every frame into its parent, and no older ones."""

    def __init__(self) -> None:
        """Begin without transforms."""
        self._links: dict[str, Link] = {}

    def add(self, message: Any, time: int, *, static: bool) -> None:  # noqa: ANN401
        """Add a tf2_msgs/TFMessage received at `time` (ns); malformed transforms are skipped."""
        for stamped in message.transforms:
            try:
                matrix = matrix_of(stamped.transform)
            except GridMapError:
                continue
            child = stamped.child_frame_id.lstrip('/')
            self._links[child] = Link(stamped.header.frame_id.lstrip('/'), matrix, time, static)

    def forget_moving(self) -> None:
        """Drop every transform that is not static, for when the clock jumps."""
        self._links = {child: link for child, link in self._links.items() if link.static}

    def lookup(self, target: str, source: str, now: int) -> NDArray[np.float64] | None:
        """Return the transform [4, 4] from `source` to `target` coordinates, None if unknown."""
        up, down = self.ancestors(source, now), self.ancestors(target, now)
        joint = next((frame for frame in up if frame in down), None)
        if joint is None:
            return None
        return np.asarray(np.linalg.inv(down[joint]) @ up[joint])

    def ancestors(self, frame: str, now: int) -> dict[str, NDArray[np.float64]]:
        """Return a frame and all frames above it, each with the transform [4, 4] into it."""
        frame = frame.lstrip('/')
        matrix = np.eye(4)
        found = {frame: matrix}
        while (link := self._links.get(frame)) is not None and len(found) < MAX_DEPTH:
            if not link.static and now - link.time > MAX_AGE:
                break
            matrix = link.matrix @ matrix
            frame = link.parent
            if frame in found:
                break
            found[frame] = matrix
        return found


def matrix_of(transform: Any) -> NDArray[np.float64]:  # noqa: ANN401 - live or decoded
    """Return a geometry_msgs/Transform as a matrix [4, 4].

    Raises GridMapError, naming the field, where a number is not finite or the rotation is not a
    unit quaternion.
    """
    shift, turn = transform.translation, transform.rotation
    place, quaternion = (shift.x, shift.y, shift.z), (turn.x, turn.y, turn.z, turn.w)
    if not all(map(math.isfinite, (*place, *quaternion))):
        raise GridMapError('transform', 'holds a number that is not finite')
    if abs(math.hypot(*quaternion) - 1.0) > QUATERNION_TOLERANCE:
        raise GridMapError('transform.rotation', f'{quaternion} is not a unit quaternion')
    x, y, z, w = quaternion
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, 3] = place
    return matrix


def flat_pose(matrix: NDArray[np.float64]) -> Pose2D:
    """Return a transform [4, 4] as a pose in the plane."""
    return Pose2D(float(matrix[0, 3]), float(matrix[1, 3]), math.atan2(matrix[1, 0], matrix[0, 0]))


def moved(pose: Pose2D, matrix: NDArray[np.float64]) -> Pose2D:
    """Transform a pose by a matrix [4, 4] and project the result on the new frame's x-y plane.

    The pose is turned in space before it is projected, so the frame may be tilted.
    """
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    planar = np.eye(4)
    planar[:2, [0, 1, 3]] = [[cos, -sin, pose.x], [sin, cos, pose.y]]
    return flat_pose(matrix @ planar)
