# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Collects what a running planner and its waypoint client publish about themselves."""

from __future__ import annotations

import contextlib
import queue
from collections.abc import Iterator
from dataclasses import asdict
from enum import Enum
from functools import partial
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from llm_astar_msgs_adapter.messages.fields import stamp_of, status_values
from llm_astar_msgs_adapter.messages.report import (
    ExchangeReport,
    PlanReport,
    Report,
    ReportError,
    report_from_message,
)
from rclpy.node import Node

from llm_astar_planner.nodes.common.qos import RELIABLE, REPORTS
from llm_astar_planner.nodes.common.spin import SpinThread, check_names, joined

# Events kept for a reader that is busy; more are dropped, as on the topics themselves.
MAX_WAITING = 1000


class EventKind(str, Enum):
    """What an event is about."""

    PLAN = 'plan'
    EXCHANGE = 'exchange'  # of the waypoint client with its source
    HEALTH = 'health'  # a node's state, when it changed


class MonitorEvent(NamedTuple):
    """One event: when (nanoseconds of the node's clock), of which node, and its fields.

    The fields of a plan are those of PlanReport, of an exchange those of ExchangeReport; a state
    has `message` and the values of its diagnostic status.
    """

    kind: EventKind
    stamp: int
    node: str
    values: dict[str, Any]


class Monitor:
    """Collects the reports, exchanges and state changes of one planner and one client.

    Since the topics are latched, the last ten of each from before it subscribed come first.
    """

    def __init__(self, node: Node, planner: str, client: str) -> None:
        """Subscribe on `node`, which the caller spins, to nodes named relative to it."""
        self._node = node
        self._waiting: queue.Queue[MonitorEvent] = queue.Queue(MAX_WAITING)
        # As the nodes name themselves in /diagnostics: with their namespace, without the slash.
        self.planner, self._client = (
            node.resolve_service_name(name)[1:] for name in (planner, client)
        )
        self._states: dict[str, object] = {}
        self._heard = False
        on_report = partial(self._on_report, EventKind.PLAN, PlanReport, self.planner)
        on_exchange = partial(self._on_report, EventKind.EXCHANGE, ExchangeReport, self._client)
        for topic, on_message, qos in (
            (f'{planner}/report', on_report, REPORTS),
            (f'{client}/exchange', on_exchange, REPORTS),
            ('/diagnostics', self._on_diagnostics, RELIABLE),
        ):
            node.create_subscription(DiagnosticArray, topic, on_message, qos)
        self._report_topic = node.resolve_topic_name(f'{planner}/report')

    @property
    def has_heard_planner(self) -> bool:
        """Whether any message of the planner has arrived."""
        return self._heard

    @property
    def planner_exists(self) -> bool:
        """Whether anybody publishes the planner's reports."""
        return bool(self._node.count_publishers(self._report_topic))

    def next_event(self, seconds: float) -> MonitorEvent | None:
        """Return the next event, or None where none comes within `seconds`."""
        try:
            return self._waiting.get(timeout=seconds)
        except queue.Empty:
            return None

    def _on_report(
        self, kind: EventKind, report: type[Report], node: str, message: DiagnosticArray
    ) -> None:
        self._heard = self._heard or node == self.planner
        try:
            values = asdict(report_from_message(message, report))
        except ReportError as error:
            self._node.get_logger().warning(f'{node}: {error}; is it of another version?')
            return
        self._add(kind, stamp_of(message), node, values)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        """Add a node's state where it differs from the last one."""
        for status in message.status:
            values = status_values(status)
            if status.name == f'{self.planner}: planner':
                self._heard = True
                node, state = self.planner, status.message
            elif status.name == f'{self._client}: waypoints':
                node, state = self._client, f'waypoints by {values.get("source")}'
            else:
                continue
            if self._states.get(node) != state:
                self._states[node] = state
                state_values = {'message': state, **values}
                self._add(EventKind.HEALTH, stamp_of(message), node, state_values)

    def _add(self, kind: EventKind, stamp: int, node: str, values: dict[str, Any]) -> None:
        with contextlib.suppress(queue.Full):
            self._waiting.put_nowait(MonitorEvent(kind, stamp, node, values))


@contextlib.contextmanager
def monitoring(namespace: str, planner: str, client: str) -> Iterator[Monitor]:
    """Join the graph in `namespace` and monitor it. Raises NodeNameError."""
    with joined('llm_astar_watch', check_names(namespace, planner, client)) as node:
        monitor = Monitor(node, planner, client)
        with contextlib.closing(SpinThread(node)):
            yield monitor
