# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The robot's polygon as the node knows it: its parameter, or the topic that Nav2 publishes."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from geometry_msgs.msg import PolygonStamped, PoseStamped
from llm_astar_msgs_adapter.errors import LlmAstarError
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node

from llm_astar_planner.costmap.config import COSTMAP_THRESHOLD
from llm_astar_planner.nodes.common.entities import RELIABLE, Entities
from llm_astar_planner.nodes.common.parameters import Parameters
from llm_astar_planner.nodes.common.tf import FrameError, Frames
from llm_astar_planner.planning.footprint import MAX_POINTS, Footprint, FootprintError
from llm_astar_planner.search.arrays import Float64s

TOPIC = 'published_footprint'
# Metres that the points of one footprint may differ by from message to message: rounding in the
# global frame, and tf's interpolation.
SAME_METRES = 0.005
QUIET_SECONDS = 10.0
# Seconds to wait for the transform of a footprint: maps wait meanwhile, and another one comes.
LONGEST_WAIT = 0.05


@dataclass(eq=False)
class RobotFootprint:
    """Holds the `current` footprint, None without one.

    The parameter `footprint` counts if it is set, else the last good message. Nav2's costmaps
    publish their padded footprint where the robot is, in their global frame: the transform at its
    stamp leads back to the robot's frame. A message that is refused changes nothing. What they
    make of a robot's radius is no footprint where the costmap plans for the circle anyway.
    """

    entities: Entities
    settings: Parameters
    frames: Frames
    on_change: Callable[[], None]

    def __post_init__(self) -> None:
        """Take the parameter; `subscribe` takes the topic. `on_change` is called after changes."""
        self.current: Footprint | None = Footprint.parse(self.settings['footprint'])
        self._node = self.entities.node
        self._logger = self._node.get_logger()
        self._received: Footprint | None = None
        self._loud_from = time.monotonic() + QUIET_SECONDS
        self.report()

    def subscribe(self, side: Node) -> None:
        """Take footprints from the topic, on the thread of the node `side`."""
        group, name = MutuallyExclusiveCallbackGroup(), self._node.resolve_topic_name(TOPIC)
        Entities(side).subscription(PolygonStamped, name, self.on_message, RELIABLE, group)

    def refresh(self) -> None:
        """Follow a changed parameter."""
        received = self._received
        if received is not None and self.is_planned_for(received):
            received = None
        self.use(Footprint.parse(self.settings['footprint']) or received)

    def on_message(self, message: PolygonStamped) -> None:
        """Take the footprint of a message, or say in the log why not."""
        if self.settings.current['footprint']:
            return
        before = self._received
        try:
            points = self.in_base_frame(message)
            if before is not None and before.is_close_to(points, SAME_METRES):
                return
            received = Footprint.of(points)
        except LlmAstarError as error:
            # At the start, the robot's frame may come later than its footprint.
            is_early = isinstance(error, FrameError) and time.monotonic() < self._loud_from
            text = f'{TOPIC}: {error}; the last one stays ({self.current})'
            # A call each: rclpy refuses another severity from the same line.
            if is_early:
                self._logger.debug(text, throttle_duration_sec=QUIET_SECONDS)
            else:
                self._logger.error(text, throttle_duration_sec=QUIET_SECONDS)
            return
        self._received, self._loud_from = received, 0.0
        self.refresh()

    def is_planned_for(self, footprint: Footprint) -> bool:
        """Tell whether a footprint is a circle that the costmap keeps off obstacles already."""
        is_costmap = self.settings['occupied_threshold'] == COSTMAP_THRESHOLD
        radius = self.settings['robot_radius']
        return footprint.is_round and (is_costmap or radius >= footprint.inscribed_radius)

    def in_base_frame(self, message: PolygonStamped) -> Float64s:
        """Return the points [n, 2] of a message in the robot's frame.

        Raises FootprintError, GridMapError, and FrameError without a transform.
        """
        points = message.polygon.points
        if len(points) > MAX_POINTS:
            raise FootprintError(f'footprint: {len(points)} points, over {MAX_POINTS}')
        corners = np.array([(point.x, point.y) for point in points]).reshape(-1, 2)
        if not np.isfinite(corners).all():
            raise FootprintError('footprint: a point is not finite')
        base = self.settings['robot_base_frame']
        # Where the origin of the message's frame is in the robot's.
        pose, deadline = PoseStamped(header=message.header), time.monotonic() + LONGEST_WAIT
        origin = self.frames.locate(pose, base, TOPIC, lambda: time.monotonic() < deadline)
        return origin.transform(corners)

    def use(self, footprint: Footprint | None) -> None:
        """Use a footprint from now on."""
        if footprint != self.current:
            self.current = footprint
            self.report()
            self.on_change()

    def report(self) -> None:
        """Log which footprint is used."""
        if self.current is not None:
            self._logger.info(f'footprint of the robot: {self.current}')

    def values(self) -> dict[str, Any]:
        """Return what /diagnostics says."""
        if self.current is None:
            return {}
        radii = self.current.inscribed_radius, self.current.circumscribed_radius
        return {'footprint': str(self.current), 'footprint_radii': [round(r, 3) for r in radii]}
