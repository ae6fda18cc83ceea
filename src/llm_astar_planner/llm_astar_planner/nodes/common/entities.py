# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The publishers, subscriptions and services of one part of a node, closed together."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, TypeVar

from rclpy.callback_groups import CallbackGroup, ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.service import Service

from llm_astar_planner.nodes.common.qos import CALLS

_T = TypeVar('_T')


class Entities:
    """Creates entities on a node and destroys all of them in `close`."""

    def __init__(self, node: Node) -> None:
        """Take the node on which to create them."""
        self.node = node
        self._undo: list[Callable[[], Any]] = []

    def publisher(self, kind: type, name: str, qos: QoSProfile) -> Publisher:
        """Create a publisher."""
        return self._keep(self.node.create_publisher(kind, name, qos), self.node.destroy_publisher)

    def subscription(
        self,
        kind: type,
        name: str,
        callback: Callable[[Any], None],
        qos: QoSProfile,
        group: CallbackGroup,
    ) -> None:
        """Create a subscription."""
        made = self.node.create_subscription(kind, name, callback, qos, callback_group=group)
        self._keep(made, self.node.destroy_subscription)

    def service(
        self, kind: type, name: str, callback: Callable[[Any, Any], Any], group: CallbackGroup
    ) -> Service:
        """Create a service that loses no request of many callers."""
        made = self.node.create_service(
            kind, name, callback, qos_profile=CALLS, callback_group=group
        )
        return self._keep(made, self.node.destroy_service)

    def timer(self, seconds: float, callback: Callable[[], None], group: CallbackGroup) -> None:
        """Create a timer of a steady clock.

        That of the node may jump back, or stand still where time is simulated.
        """
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        made = self.node.create_timer(seconds, callback, callback_group=group, clock=steady)
        self._keep(made, self.node.destroy_timer)

    def _keep(self, made: _T, destroy: Callable[[_T], Any]) -> _T:
        self._undo.append(lambda: destroy(made))
        return made

    def on_close(self, undo: Callable[[], Any]) -> None:
        """Call `undo` in `close`, in its turn."""
        self._undo.append(undo)

    def close(self) -> None:
        """Destroy everything, in reverse order of creation."""
        while self._undo:
            self._undo.pop()()


class LimitedCallbackGroup(ReentrantCallbackGroup):
    """Lets at most so many callbacks run at a time; more wait in the middleware.

    So a flood of one kind leaves threads of the executor for all the others.
    """

    def __init__(self, limit: int) -> None:
        """Take how many may run at a time."""
        super().__init__()
        self._limit = limit
        self._lock = threading.Lock()
        self._running = 0

    def can_execute(self, _: Any) -> bool:  # noqa: ANN401 - rclpy's own
        """Tell whether another callback may run now."""
        return self._running < self._limit

    def beginning_execution(self, _: Any) -> bool:  # noqa: ANN401 - rclpy's own
        """Let a callback run if another one may."""
        with self._lock:
            may_run = self._running < self._limit
            self._running += may_run
            return may_run

    def ending_execution(self, _: Any) -> None:  # noqa: ANN401 - rclpy's own
        """Take note of a callback that has ended."""
        with self._lock:
            self._running -= 1
