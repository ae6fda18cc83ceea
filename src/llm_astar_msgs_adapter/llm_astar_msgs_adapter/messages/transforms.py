"""The latest known transforms between frames, and poses in the plane taken through them.

Nothing here needs tf2: a transform is anything with the fields of geometry_msgs/Transform.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from llm_astar_msgs_adapter.maps.grid_map import GridMapError, Pose2D

# A transform older than this (ns) no longer says where anything is.
MAX_AGE = 10_000_000_000
MAX_DEPTH = 64
# How far a quaternion's norm may be off 1.
QUATERNION_TOLERANCE = 1e-3


class _Link(NamedTuple):
    parent: str
    matrix: NDArray[np.float64]
    time: int
    static: bool


class Transforms:
    """The newest transform of every frame to its parent; memory grows with frames, not time."""

    def __init__(self) -> None:
        """Know nothing yet."""
        self._links: dict[str, _Link] = {}

    def add(self, message: Any, time: int, *, static: bool) -> None:  # noqa: ANN401
        """Take a tf2_msgs/TFMessage that came at `time` (ns); what is no transform is skipped."""
        for stamped in message.transforms:
            try:
                matrix = matrix_of(stamped.transform)
            except GridMapError:
                continue
            child = stamped.child_frame_id.lstrip('/')
            self._links[child] = _Link(stamped.header.frame_id.lstrip('/'), matrix, time, static)

    def forget_moving(self) -> None:
        """Forget every transform that is not static, as when the clock has jumped."""
        self._links = {child: link for child, link in self._links.items() if link.static}

    def lookup(self, target: str, source: str, now: int) -> NDArray[np.float64] | None:
        """Return the transform [4, 4] that takes `source` coordinates to `target`, if known."""
        up, down = self._chain(source, now), self._chain(target, now)
        joint = next((frame for frame in up if frame in down), None)
        if joint is None:
            return None
        return np.asarray(np.linalg.inv(down[joint]) @ up[joint])

    def _chain(self, frame: str, now: int) -> dict[str, NDArray[np.float64]]:
        """Return every frame above one, itself first, with the transforms into them."""
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


def matrix_of(transform: Any) -> NDArray[np.float64]:  # noqa: ANN401 - of either world
    """Return a geometry_msgs/Transform as a matrix [4, 4].

    Raises GridMapError, naming the field, where it is not finite or its rotation is no unit
    quaternion.
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
    """Return a pose of the child frame of a transform [4, 4] in its parent frame.

    The pose's point and heading are turned in space and then projected on the parent's plane, so
    a frame on a slope is served as far as a plane can.
    """
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    planar = np.eye(4)
    planar[:2, [0, 1, 3]] = [[cos, -sin, pose.x], [sin, cos, pose.y]]
    return flat_pose(matrix @ planar)
