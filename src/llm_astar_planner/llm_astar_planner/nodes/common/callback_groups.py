"""Callback groups that rclpy does not have."""

from __future__ import annotations

import threading
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup


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
