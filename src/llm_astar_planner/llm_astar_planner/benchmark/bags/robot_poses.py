"""Where the robot was, and where poses lie on the map, by what a bag has told so far."""

from __future__ import annotations

from typing import Any

from llm_astar_msgs_adapter.bags.reading import BagMessage
from llm_astar_msgs_adapter.maps.grid_map import GridMapError, Pose2D
from llm_astar_msgs_adapter.messages.fields import pose_from_message
from llm_astar_msgs_adapter.messages.transforms import Transforms, flat_pose, moved

# What tells where the robot is, besides tf, the better first.
TOLD = {'odometry': 'odometry', 'start': 'amcl_pose or initialpose'}


class Places:
    """The latest transforms, odometry, and pose by amcl or as it was told."""

    def __init__(self, base_frame: str) -> None:
        """Know no place yet; `base_frame` is the robot's in tf."""
        self._base_frame = base_frame
        self._transforms = Transforms()
        self._told: dict[str, BagMessage] = {}

    def take(self, part: str, message: BagMessage) -> None:
        """Take a message of the part `tf`, `static tf`, `odometry` or `start`."""
        if part in ('tf', 'static tf'):
            static = part == 'static tf'
            self._transforms.add(message.value, message.time, static=static)
        else:
            self._told[part] = message

    def forget(self) -> None:
        """Forget all but what never moves, as when the clock has jumped."""
        self._transforms.forget_moving()
        self._told.clear()

    def on_map(self, pose: Any, frame: str, target: str, now: int) -> Pose2D | str:  # noqa: ANN401
        """Return a decoded pose in the frame `target`, or say why that cannot be."""
        try:
            place = pose_from_message(pose)
        except GridMapError as error:
            return f'cannot be used ({error})'
        # Callers that leave the frame empty mean the map's.
        if frame in ('', target):
            return place
        known = self._transforms.lookup(target, frame, now)
        if known is None:
            return f'is in frame {frame!r}, the map in {target!r}, and no tf joins them'
        return moved(place, known)

    def robot(self, target: str, now: int) -> Pose2D | str:
        """Return the robot's place by tf, else by odometry, else as it was last told."""
        known = self._transforms.lookup(target, self._base_frame, now)
        if known is not None:
            return flat_pose(known)
        why = [f'no tf from {target} to {self._base_frame}']
        for part, name in TOLD.items():
            if part not in self._told:
                why.append(f'no {name} yet')
                continue
            value = self._told[part].value
            place = self.on_map(value.pose.pose, value.header.frame_id, target, now)
            if isinstance(place, Pose2D):
                return place
            why.append(f'{name} {place}')
        return f'is not known: {"; ".join(why)}'
