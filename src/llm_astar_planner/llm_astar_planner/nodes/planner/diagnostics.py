"""The state of the planner for /diagnostics."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from llm_astar_msgs_adapter.messages.diagnostics import PlanReport, status_to_message
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup

from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.common.qos import RELIABLE

PERIOD = 1.0


class PlanStatistics:
    """Counts what became of the questions, and keeps the last report."""

    def __init__(self) -> None:
        """Nothing was asked yet."""
        self._lock = threading.Lock()
        self.last: PlanReport | None = None
        self.asked = self.planned = self.certified = 0

    def count(self, report: PlanReport) -> None:
        """Count a report; a plan is certified where a bound on its cost is proven."""
        with self._lock:
            self.last = report
            self.asked += 1
            self.planned += report.code == 0
            self.certified += report.code == 0 and report.ratio is not None

    def values(self) -> dict[str, Any]:
        """Return the figures by name; `certified_ratio` is of the plans made, None before any."""
        with self._lock:
            last = self.last
            return {
                'plans_asked': self.asked,
                'plans_made': self.planned,
                'certified_ratio': self.certified / self.planned if self.planned else None,
                'last_code': last.code_name if last else None,
                'last_guided_by': last.guided_by if last else None,
                'last_ratio': last.ratio if last else None,
                'last_source_status': last.source_status if last else None,
                'last_source_detail': last.source_detail if last else None,
            }


class Health:
    """Publishes the state at 1 Hz, and whenever it is told to."""

    def __init__(
        self, entities: Entities, state: Callable[[], tuple[bool, str, dict[str, Any]]]
    ) -> None:
        """Begin; `state` returns whether all is well, a sentence, and values by name."""
        self._node = entities.node
        self._state = state
        self._publisher = entities.publisher(DiagnosticArray, '/diagnostics', RELIABLE)
        entities.timer(PERIOD, self.publish, MutuallyExclusiveCallbackGroup())

    def publish(self) -> None:
        """Publish the state now."""
        is_well, message, values = self._state()
        level = DiagnosticStatus.OK if is_well else DiagnosticStatus.WARN
        name = f'{self._node.get_fully_qualified_name()[1:]}: planner'
        stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(status_to_message(name, level, message, values, stamp))
