# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Follows a running planner: its map, its paths with their reports, and its state."""

import contextlib
import threading
import time
from collections.abc import Iterator

import numpy as np
from llm_astar_msgs_adapter.maps.places import PlacesError, places_from_geojson
from llm_astar_msgs_adapter.messages.fields import path_from_message, stamp_of
from llm_astar_planner.caches import Recent
from llm_astar_planner.costmap.zones import ZonesError, zones_from_geojson
from llm_astar_planner.instructions.messages import QuestionFormatError, parse_object
from llm_astar_planner.nodes.common.entities import LATCHED, RELIABLE, Entities
from llm_astar_planner.nodes.common.map_subscription import MapSubscription
from llm_astar_planner.nodes.common.spin import SpinThread, check_names, joined
from llm_astar_planner.nodes.tools.planner_client import EventKind, Monitor, MonitorEvent
from nav_msgs.msg import Path
from numpy.typing import NDArray
from rclpy.node import Node
from std_msgs.msg import String

from llm_astar_lab.play.live import LiveFeed

# Paths kept until their report comes, and seconds after which a report is shown without its path:
# those from before the view began are not published again.
KEPT_PATHS = 16
PATH_WAIT_S = 1.0
# The longest wait for an event, and how long nothing is heard before that is said.
POLL_S = 0.1
SILENCE_S = 3.0


class LiveView:
    """Shows one planner's newest map, plan and state to a viewer."""

    def __init__(self, node: Node, planner: str, client: str, viewer: LiveFeed) -> None:
        """Subscribe on `node`, which the caller spins, to nodes named relative to it."""
        self._viewer = viewer
        self._monitor = Monitor(node, planner, client)
        # By stamp; other planners publish on this topic too.
        self._paths: Recent[int, NDArray[np.float64]] = Recent(KEPT_PATHS)
        self._report: MonitorEvent | None = None
        self._report_came = 0.0
        MapSubscription(Entities(node), lambda grid_map, _: viewer.show_map(grid_map))
        node.create_subscription(Path, 'plan', self._on_path, RELIABLE)
        node.create_subscription(String, f'{planner}/places_geojson', self._on_places, LATCHED)
        node.create_subscription(String, f'{planner}/zones_geojson', self._on_zones, LATCHED)

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
                advice = 'is it running, in this ROS_DOMAIN_ID? Still waiting'
                self._viewer.show_status(f'no message of /{self._monitor.planner}; {advice}')

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
        with contextlib.suppress(QuestionFormatError, PlacesError):
            places = parse_object(message.data)
            self._viewer.show_places(places_from_geojson(places, 'the places of the graph'))

    def _on_zones(self, message: String) -> None:
        with contextlib.suppress(QuestionFormatError, PlacesError, ZonesError):
            features = parse_object(message.data)
            is_empty = features.get('features') == []
            self._viewer.show_zones([] if is_empty else zones_from_geojson(features, 0.0)[0])

    def _on_path(self, message: Path) -> None:
        with contextlib.suppress(ValueError):  # a malformed path is somebody else's
            self._paths[stamp_of(message)] = path_from_message(message)


@contextlib.contextmanager
def live_view(namespace: str, planner: str, client: str, viewer: LiveFeed) -> Iterator[None]:
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
