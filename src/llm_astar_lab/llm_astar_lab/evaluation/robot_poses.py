"""Poses on the map and the pose of the robot, from the messages of a bag read so far."""

from __future__ import annotations

from typing import Any

from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.grid_map import GridMapError, Pose2D
from llm_astar_msgs_adapter.messages.fields import pose_from_message
from llm_astar_msgs_adapter.messages.transforms import Transforms, flat_pose, moved

from llm_astar_lab.bags.reading import BagMessage

# Roles of the topics with the robot's pose, besides tf, and their names; the better one first.
POSE_ROLES = {'odometry': 'odometry', 'start': 'amcl_pose or initialpose'}


class PoseError(LlmAstarError, ValueError):
    """A pose that is not known on the map; the message says which pose, and why."""


class RobotPoseTracker:
    """Keeps the newest transforms, odometry, and pose from amcl_pose or initialpose."""

    def __init__(self, base_frame: str) -> None:
        """Begin without poses; `base_frame` is the robot's frame in tf."""
        self._base_frame = base_frame
        self._transforms = Transforms()
        self._latest: dict[str, BagMessage] = {}

    def take(self, role: str, message: BagMessage) -> None:
        """Take a message of the role `tf`, `static tf`, `odometry` or `start`."""
        if role in ('tf', 'static tf'):
            self._transforms.add(message.value, message.time, static=role == 'static tf')
        else:
            self._latest[role] = message

    def forget(self) -> None:
        """Forget all but static transforms, for when the clock jumps."""
        self._transforms.forget_moving()
        self._latest.clear()

    def to_map(self, pose: Any, frame: str, map_frame: str, now: int, name: str) -> Pose2D:  # noqa: ANN401
        """Return a decoded pose in the map's frame. An empty frame means the map's.

        Raises PoseError, which begins with `name`.
        """
        try:
            own = pose_from_message(pose)
        except GridMapError as error:
            raise PoseError(f'{name} cannot be used ({error})') from None
        if frame in ('', map_frame):
            return own
        transform = self._transforms.lookup(map_frame, frame, now)
        if transform is None:
            message = f'{name} is in frame {frame!r}, the map in {map_frame!r}, and no tf'
            raise PoseError(f'{message} joins them')
        return moved(own, transform)

    def robot(self, map_frame: str, now: int) -> Pose2D:
        """Return the robot's pose by tf, else by odometry, else by amcl_pose or initialpose.

        Raises PoseError, which begins with `start`.
        """
        transform = self._transforms.lookup(map_frame, self._base_frame, now)
        if transform is not None:
            return flat_pose(transform)
        problems = [f'no tf from {map_frame} to {self._base_frame}']
        for role, name in POSE_ROLES.items():
            if role not in self._latest:
                problems.append(f'no {name} yet')
                continue
            value = self._latest[role].value
            try:
                return self.to_map(value.pose.pose, value.header.frame_id, map_frame, now, name)
            except PoseError as error:
                problems.append(str(error))
        raise PoseError(f'start is not known: {"; ".join(problems)}')
