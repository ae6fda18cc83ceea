"""Sees what a planner and its waypoint client tell of themselves."""

from __future__ import annotations

import contextlib
import queue
from collections.abc import Iterator
from dataclasses import asdict

import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from llm_astar_msgs_adapter.messages.diagnostics import (
    ExchangeReport,
    PlanReport,
    Report,
    ReportError,
    report_from_message,
    status_values,
)
from rclpy.exceptions import InvalidNamespaceException, InvalidTopicNameException
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.validate_namespace import validate_namespace
from rclpy.validate_topic_name import validate_topic_name

from llm_astar_planner.nodes.common.qos import RELIABLE, REPORTS
from llm_astar_planner.nodes.common.spin import SpinThread, leave
from llm_astar_planner.nodes.tools.monitor_lines import Kind, Seen

# What a reader who stands still can catch up on; more is lost, as on the topics themselves.
MAX_WAITING = 1000


class Watcher:
    """Collects the reports, exchanges and changes of state of one planner and one client.

    The last ten of each come from before it looked, since their topics are latched.
    """

    def __init__(self, node: Node, planner: str, client: str) -> None:
        """Subscribe by `node`, which somebody else spins, to nodes named relative to it."""
        self._node = node
        self._waiting: queue.Queue[Seen] = queue.Queue(MAX_WAITING)
        # As the nodes name themselves in /diagnostics: with their namespace, without the slash.
        self.planner, self._client = (
            node.resolve_service_name(name)[1:] for name in (planner, client)
        )
        self._states: dict[str, object] = {}
        self.heard = False
        for topic, on_message, qos in (
            (f'{planner}/report', self._on_report, REPORTS),
            (f'{client}/exchange', self._on_exchange, REPORTS),
            ('/diagnostics', self._on_diagnostics, RELIABLE),
        ):
            node.create_subscription(DiagnosticArray, topic, on_message, qos)
        self._report_topic = node.resolve_topic_name(f'{planner}/report')

    @property
    def planner_is_there(self) -> bool:
        """Whether anybody publishes the planner's reports."""
        return bool(self._node.count_publishers(self._report_topic))

    def next(self, seconds: float) -> Seen | None:
        """Return what was seen next, None where nothing was for so many seconds."""
        try:
            return self._waiting.get(timeout=seconds)
        except queue.Empty:
            return None

    def _on_report(self, message: DiagnosticArray) -> None:
        self._keep(Kind.PLAN, message, PlanReport, self.planner)

    def _on_exchange(self, message: DiagnosticArray) -> None:
        self._keep(Kind.EXCHANGE, message, ExchangeReport, self._client)

    def _keep(self, kind: Kind, message: DiagnosticArray, report: type[Report], node: str) -> None:
        try:
            values = asdict(report_from_message(message, report))
        except ReportError as error:
            self._node.get_logger().warning(f'{node}: {error}; is it of another version?')
            return
        self._put(Seen(kind, _seconds(message.header.stamp), node, values))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        """Keep a node's state where it is another than the last one."""
        for status in message.status:
            values = status_values(status)
            if status.name == f'{self.planner}: planner':
                self.heard = True
                node, state = self.planner, status.message
            elif status.name == f'{self._client}: waypoints':
                node, state = self._client, f'waypoints by {values.get("source")}'
            else:
                continue
            if self._states.get(node) != state:
                self._states[node] = state
                stamp = _seconds(message.header.stamp)
                self._put(Seen(Kind.HEALTH, stamp, node, {'message': state, **values}))

    def _put(self, seen: Seen) -> None:
        self.heard = self.heard or seen.kind is Kind.PLAN
        with contextlib.suppress(queue.Full):
            self._waiting.put_nowait(seen)


@contextlib.contextmanager
def watching(namespace: str, planner: str, client: str) -> Iterator[Watcher]:
    """Join the graph in `namespace` and watch. Raises ValueError for names no node can have."""
    namespace = f'/{namespace.strip("/")}'
    _check_names(namespace, planner, client)
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node(
            'llm_astar_watch',
            namespace=namespace,
            start_parameter_services=False,
            enable_rosout=False,
        )
        watcher = Watcher(node, planner, client)
        thread = SpinThread(node)
        thread.start()
        try:
            yield watcher
        finally:
            thread.close()
            leave(node)
    finally:
        rclpy.try_shutdown()


def _check_names(namespace: str, *nodes: str) -> None:
    """Raise ValueError where a namespace or a node's name cannot be one."""
    try:
        validate_namespace(namespace)
        for name in nodes:
            validate_topic_name(name)
    except (InvalidNamespaceException, InvalidTopicNameException) as error:
        raise ValueError(' '.join(str(error).split())) from None


def _seconds(stamp: Time) -> float:
    return float(stamp.sec + stamp.nanosec / 1e9)
