"""Follows a running planner: its reports and states, its map, its places and its paths."""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from collections.abc import Iterator
from dataclasses import asdict
from enum import Enum
from typing import Any, NamedTuple, Protocol

import numpy as np
from cachetools import FIFOCache
from diagnostic_msgs.msg import DiagnosticArray
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import Places, PlacesError
from llm_astar_msgs_adapter.maps.places_file import places_from_geojson
from llm_astar_msgs_adapter.messages.fields import path_from_message, stamp_of, status_values
from llm_astar_msgs_adapter.messages.report import (
    ExchangeReport,
    PlanReport,
    Report,
    ReportError,
    report_from_message,
)
from nav_msgs.msg import Path
from numpy.typing import NDArray
from rclpy.node import Node
from std_msgs.msg import String

from llm_astar_planner.instructions.messages import QuestionError, parse_object
from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.common.map_subscription import MapSubscription
from llm_astar_planner.nodes.common.qos import LATCHED, RELIABLE, REPORTS
from llm_astar_planner.nodes.common.spin import SpinThread, check_names, joined

# Events kept for a reader that is busy; more are dropped, as on the topics themselves.
MAX_WAITING = 1000

# Paths kept until their report comes, and seconds after which a report is shown without its path:
# those from before the view began are not published again.
KEPT_PATHS = 16
PATH_WAIT_S = 1.0
# The longest wait for an event, and how long nothing is heard before that is said.
POLL_S = 0.1
SILENCE_S = 3.0


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
        for topic, on_message, qos in (
            (f'{planner}/report', self._on_report, REPORTS),
            (f'{client}/exchange', self._on_exchange, REPORTS),
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

    def _on_report(self, message: DiagnosticArray) -> None:
        self._heard = True
        self._add_report(EventKind.PLAN, message, PlanReport, self.planner)

    def _on_exchange(self, message: DiagnosticArray) -> None:
        self._add_report(EventKind.EXCHANGE, message, ExchangeReport, self._client)

    def _add_report(
        self, kind: EventKind, message: DiagnosticArray, report: type[Report], node: str
    ) -> None:
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


class Viewer(Protocol):
    """Who is shown what a planner does; called from a thread of the view."""

    def show_map(self, grid_map: GridMap) -> None:
        """Take a newer map."""

    def show_places(self, places: Places) -> None:
        """Take newer places."""

    def show_plan(self, points: NDArray[np.float64], report: dict[str, Any]) -> None:
        """Take a newer plan: its points [n, 2] in metres, the fields of its PlanReport."""

    def show_status(self, sentence: str) -> None:
        """Take a newer sentence on the planner's state."""


class LiveView:
    """Shows one planner's newest map, plan and state to a viewer."""

    def __init__(self, node: Node, planner: str, client: str, viewer: Viewer) -> None:
        """Subscribe on `node`, which the caller spins, to nodes named relative to it."""
        self._viewer = viewer
        self._monitor = Monitor(node, planner, client)
        # By stamp; other planners publish on this topic too.
        self._paths: FIFOCache[int, NDArray[np.float64]] = FIFOCache(KEPT_PATHS)
        self._report: MonitorEvent | None = None
        self._report_came = 0.0
        MapSubscription(Entities(node), lambda grid_map, _: viewer.show_map(grid_map))
        node.create_subscription(Path, 'plan', self._on_path, RELIABLE)
        node.create_subscription(String, f'{planner}/places_geojson', self._on_places, LATCHED)

    def follow(self, stopped: threading.Event) -> None:
        """Show what comes until `stopped` is set."""
        silent_at = time.monotonic() + SILENCE_S
        while not stopped.is_set():
            event = self._monitor.next_event(POLL_S)
            if event is not None:
                self._take(event)
            self._show_plan()
            if not self._monitor.has_heard_planner and time.monotonic() > silent_at:
                silent_at = float('inf')
                self._viewer.show_status(
                    f'no message of /{self._monitor.planner}; is it running, in this '
                    'ROS_DOMAIN_ID? Still waiting'
                )

    def _take(self, event: MonitorEvent) -> None:
        if event.kind is EventKind.PLAN:
            self._report, self._report_came = event, time.monotonic()
        elif event.kind is EventKind.HEALTH and event.node == self._monitor.planner:
            self._viewer.show_status(f'/{event.node}: {event.values["message"]}')

    def _show_plan(self) -> None:
        """Show the newest report once its path is there, if it has one."""
        report = self._report
        if report is None:
            return
        points = self._paths.get(report.stamp)
        is_late = time.monotonic() > self._report_came + PATH_WAIT_S
        if points is not None or report.values['code'] != 0 or is_late:
            self._report = None
            self._viewer.show_plan(np.empty((0, 2)) if points is None else points, report.values)

    def _on_places(self, message: String) -> None:
        with contextlib.suppress(QuestionError, PlacesError):
            places = parse_object(message.data)
            self._viewer.show_places(places_from_geojson(places, 'the places of the graph'))

    def _on_path(self, message: Path) -> None:
        with contextlib.suppress(ValueError):  # a malformed path is somebody else's
            self._paths[stamp_of(message)] = path_from_message(message)


@contextlib.contextmanager
def live_view(namespace: str, planner: str, client: str, viewer: Viewer) -> Iterator[None]:
    """Join the graph in `namespace` and show a planner to a viewer. Raises NodeNameError."""
    with joined('llm_astar_play', check_names(namespace, planner, client)) as node:
        view = LiveView(node, planner, client, viewer)
        stopped = threading.Event()
        following = threading.Thread(target=view.follow, args=(stopped,), name='live view')
        with contextlib.closing(SpinThread(node)):
            following.start()
            try:
                yield
            finally:
                stopped.set()
                following.join()
