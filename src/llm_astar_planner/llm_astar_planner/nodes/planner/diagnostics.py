"""The state of the planner on /diagnostics."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from llm_astar_msgs_adapter.messages.writing import status_to_message
from rclpy._rclpy_pybind11 import RCLError

from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.common.qos import RELIABLE
from llm_astar_planner.planning.types import Plan, ResultCode, finite_or_none

PERIOD_S = 1.0


class PlanStatistics:
    """Counts what became of the requests, and keeps the last plan's figures."""

    def __init__(self) -> None:
        """Start at zero."""
        self._lock = threading.Lock()
        self._last: Plan | None = None
        self._asked = self._made = self._certified = 0

    def count(self, plan: Plan) -> None:
        """Count a plan; it is certified if a bound on its cost is proven."""
        is_made = plan.code is ResultCode.NONE
        with self._lock:
            self._last = plan
            self._asked += 1
            self._made += is_made
            self._certified += is_made and finite_or_none(plan.suboptimality_bound) is not None

    def values(self) -> dict[str, Any]:
        """Return the figures by name; `certified_ratio` is of the plans made, None without any."""
        with self._lock:
            last = self._last.to_dict() if self._last else {}
            return {
                'plans_asked': self._asked,
                'plans_made': self._made,
                'certified_ratio': self._certified / self._made if self._made else None,
                'last_code': last.get('code_name'),
                'last_guided_by': last.get('guided_by'),
                'last_ratio': last.get('ratio'),
                'last_source_status': last.get('source_status'),
                'last_source_detail': last.get('source_detail'),
            }


class DiagnosticsPublisher:
    """Publishes the state at 1 Hz, and on request.

    It has a thread of its own: a monitor must see the node also while every other thread plans.
    """

    def __init__(
        self, entities: Entities, state: Callable[[], tuple[bool, str, dict[str, Any]]]
    ) -> None:
        """Start; `state` returns whether all is well, a sentence, and values by name."""
        self._node = entities.node
        self._state = state
        self._publisher = entities.publisher(DiagnosticArray, '/diagnostics', RELIABLE)
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self.run, name='diagnostics', daemon=True)
        self._thread.start()
        entities.on_close(self.close)

    def run(self) -> None:
        """Publish the state once a second until `close`, or until the context is shut down."""
        try:
            while not self._closed.wait(PERIOD_S):
                self.publish()
        except RCLError:
            if self._node.context.ok():
                raise

    def close(self) -> None:
        """End the thread."""
        self._closed.set()
        self._thread.join()

    def publish(self) -> None:
        """Publish the state now."""
        is_well, message, values = self._state()
        level = DiagnosticStatus.OK if is_well else DiagnosticStatus.WARN
        name = f'{self._node.get_fully_qualified_name()[1:]}: planner'
        stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(status_to_message(name, level, message, values, stamp))
