# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Calls a running planner_node, and collects what it and its client publish about themselves."""

from __future__ import annotations

import contextlib
import math
import queue
import re
import threading
import time
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from enum import Enum
from functools import partial
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.maps.places import Places, places_from_geojson
from llm_astar_msgs_adapter.messages import report as reports
from llm_astar_msgs_adapter.messages.fields import path_from_message, stamp_of, status_values
from llm_astar_msgs_adapter.messages.writing import pose_to_message
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from std_msgs.msg import Bool, String

from llm_astar_planner.caches import Recent
from llm_astar_planner.instructions import interpretation as readings
from llm_astar_planner.instructions import messages
from llm_astar_planner.instructions.route import PlaceGoalError, find_place
from llm_astar_planner.nodes.common import entities
from llm_astar_planner.nodes.common.map_subscription import MapSubscription
from llm_astar_planner.nodes.common.spin import SpinThread, check_names, joined

# Seconds after which a planner that may not have discovered the caller is asked again: longer than
# the default of max_planning_time, so that few plans are made twice.
PLAN_AGAIN_S = 6.0
# Discovery takes from milliseconds to seconds on a loaded machine.
DISCOVERY_SECONDS = 15.0
POLL_SECONDS = 0.01
# 'X,Y' in metres, where a name could stand.
POINT = re.compile(r'\s*-?[\d.]+\s*,\s*-?[\d.]+\s*')
# Reports on plans of other clients arrive too, and nobody fetches them.
KEPT_REPORTS = entities.REPORTS_OF_CALLS.depth
# Events kept for a reader that is busy; more are dropped, as on the topics themselves.
MAX_WAITING = 1000


class PlannerClientError(LlmAstarError, RuntimeError):
    """The graph did not respond; the message says what was missing."""


class CalledPlan(NamedTuple):
    """A planner's answer: its path, its report and the round trip in seconds."""

    path: Path
    report: reports.PlanReport
    seconds: float

    @property
    def points(self) -> list[list[float]]:
        """The points of the path in metres."""
        points: list[list[float]] = path_from_message(self.path).tolist()
        return points


class PlannerClient:
    """Calls `<planner>/get_plan` and matches each response with its report. A context manager.

    It spins its node in a thread of its own, so that a round trip takes a millisecond or two.
    """

    def __init__(
        self, node: Node, planner: str = 'planner_node', seconds: float = DISCOVERY_SECONDS
    ) -> None:
        """Take a node that nobody else spins, and how long to wait for other nodes."""
        self.node, self.planner, self.seconds = node, planner, seconds
        # As the planner names itself in /diagnostics: with its namespace, without the slash.
        self._planner = node.resolve_service_name(planner)[1:]
        self._arrived = threading.Condition()
        # With the time of arrival, as `time.perf_counter` has it.
        self._reports: Recent[int, tuple[float, reports.PlanReport]] = Recent(KEPT_REPORTS)
        self._health: dict[str, dict[str, Any]] = {}
        self._client = node.create_client(
            GetPlan, f'{planner}/get_plan', qos_profile=entities.CALLS
        )
        self._services: dict[str, Client] = {}
        # Whether the last call was answered, so the planner has discovered this caller.
        self._is_discovered = False
        self.listen(
            DiagnosticArray, f'{planner}/report', self._on_report, entities.REPORTS_OF_CALLS
        )
        self.listen(DiagnosticArray, '/diagnostics', self._on_health, entities.RELIABLE)

    def __enter__(self) -> PlannerClient:
        self._thread = SpinThread(self.node)
        return self

    def __exit__(self, *error: object) -> None:
        self._thread.close()

    def listen(self, kind: type, topic: str, take: Callable[[Any], None], qos: QoSProfile) -> None:
        """Subscribe to a topic: `take` gets each message, then `wait_for` looks again."""

        def on_message(message: Any) -> None:  # noqa: ANN401 - of this kind
            with self._arrived:
                take(message)
                self._arrived.notify_all()

        self.node.create_subscription(kind, topic, on_message, qos)

    def wait_for(self, condition: Callable[[], bool], what: str, seconds: float) -> None:
        """Wait until a condition on the messages that have arrived holds.

        Raises PlannerClientError naming `what` if it does not within `seconds`.
        """
        with self._arrived:
            if not self._arrived.wait_for(condition, seconds):
                raise PlannerClientError(f'{what} did not come within {seconds:g} s')

    def wait_for_subscriber(self, publisher: Publisher, seconds: float) -> None:
        """Wait until somebody subscribes to a topic. Raises PlannerClientError."""
        deadline = time.monotonic() + seconds
        while not publisher.get_subscription_count():
            if time.monotonic() > deadline:
                raise PlannerClientError(f'nobody subscribes to {publisher.topic_name}')
            time.sleep(POLL_SECONDS)

    def wait_for_planner(self, seconds: float = DISCOVERY_SECONDS) -> None:
        """Wait until the planner's service exists. Raises PlannerClientError."""
        if not self._client.wait_for_service(seconds):
            raise PlannerClientError(
                f'{self._client.srv_name} does not exist; is {self._planner} running?'
            )

    def wait_until_ready(
        self,
        map_digest: str | None = None,
        *,
        client: str = '',
        seconds: float = DISCOVERY_SECONDS,
    ) -> None:
        """Wait until the planner has the map of that digest, or any map.

        `client` names a waypoint client that the planner must have discovered and that must have
        the map too. Raises PlannerClientError.
        """
        self.wait_for_planner(seconds)

        names = [f'{self._planner}: planner']
        if client:
            names.append(f'{self.node.resolve_service_name(client)[1:]}: waypoints')

        def is_ready() -> bool:
            planner, *others = (self._health.get(name, {}) for name in names)
            digests = [node.get('map_digest') for node in (planner, *others)]
            sees_client = not client or bool(planner.get('llm_client_ready'))
            return sees_client and all(one and map_digest in (None, one) for one in digests)

        self.wait_for(is_ready, f'{self._planner} ready with its map', seconds)

    def call(
        self, start: Pose2D, goal: Pose2D, frame_id: str = 'map', seconds: float = 30.0
    ) -> CalledPlan:
        """Ask for a plan.

        Raises PlannerClientError if no response or no report arrives within `seconds`.
        """
        request = GetPlan.Request(
            start=pose_to_message(start, frame_id, Time()),
            goal=pose_to_message(goal, frame_id, Time()),
            tolerance=0.0,
        )
        begin = time.perf_counter()
        ask_again = seconds if self._is_discovered else PLAN_AGAIN_S
        self._is_discovered = False
        path = self.ask(self._client, request, seconds, ask_again).plan
        self._is_discovered = True
        round_trip = time.perf_counter() - begin
        stamp = stamp_of(path)

        def has_report() -> bool:
            # One that came before the request is of an earlier plan at the same simulated time.
            return self._reports.get(stamp, (-math.inf,))[0] >= begin

        self.wait_for(has_report, 'the report of a plan', seconds)
        return CalledPlan(path, self._reports.pop(stamp)[1], round_trip)

    def ask(
        self,
        client: Client,
        request: Any,  # noqa: ANN401 - of the service
        seconds: float = DISCOVERY_SECONDS,
        ask_again: float = entities.ASK_AGAIN_S,
    ) -> Any:  # noqa: ANN401 - any service
        """Call a service of the graph, and again after `ask_again` seconds without a response.

        Raises PlannerClientError if none comes within `seconds`.
        """
        if not client.wait_for_service(seconds):
            raise PlannerClientError(f'{client.srv_name} does not exist')
        response = entities.ask(client, request, seconds, ask_again)
        if response is None:
            raise PlannerClientError(f'{client.srv_name} did not respond within {seconds:g} s')
        return response

    def service(self, kind: Any, name: str) -> Client:  # noqa: ANN401 - a service type
        """Return the client of a service, which is kept."""
        if name not in self._services:
            self._services[name] = self.node.create_client(kind, name)
        return self._services[name]

    def values(self, names: Sequence[str], node: str = '') -> dict[str, Any]:
        """Return parameters of the planner, or of another node. Raises PlannerClientError."""
        name = node or self.planner
        client = self.service(GetParameters, f'{name}/get_parameters')
        request = GetParameters.Request(names=list(names))
        found = self.ask(client, request, self.seconds).values
        if len(found) != len(names):
            raise PlannerClientError(f'{name} lacks some of {", ".join(names)}')
        return {name: parameter_value_to_python(value) for name, value in zip(names, found)}

    def set_values(self, values: Mapping[str, Any]) -> None:
        """Set parameters of the planner. Raises PlannerClientError where one is refused."""
        client = self.service(SetParameters, f'{self.planner}/set_parameters')
        results = self.ask(client, entities.setting(values), self.seconds).results
        for name, result in zip(values, results):
            if not result.successful:
                raise PlannerClientError(f'{self.planner} refused {name}: {result.reason}')

    def _on_report(self, message: DiagnosticArray) -> None:
        report = reports.report_from_message(message, reports.PlanReport)
        self._reports[stamp_of(message)] = time.perf_counter(), report

    def _on_health(self, message: DiagnosticArray) -> None:
        self._health.update((status.name, status_values(status)) for status in message.status)


class PlannerCaller(PlannerClient):
    """Calls one planner; every wait is at most `seconds` long and raises PlannerClientError.

    It is an Interpreter too: what the graph understands of a text.
    """

    name = 'graph'

    def __init__(self, node: Node, planner: str, seconds: float) -> None:
        """Call the node `planner` from a node that nobody else spins."""
        super().__init__(node, planner, seconds)
        self._answers: dict[str, list[dict[str, Any]]] = {}
        self._places: dict[str, Any] = {}
        self._maps: list[GridMap] = []
        self._listens_to_maps = False
        self._questions = node.create_publisher(String, f'{planner}/interpret', entities.RELIABLE)
        self._confirm = node.create_publisher(Bool, f'{planner}/confirm', entities.RELIABLE)
        self.listen(String, f'{planner}/interpretation', self._on_answer, entities.REPORTS)
        self.listen(String, f'{planner}/places_geojson', self._on_places, entities.LATCHED)

    def _on_answer(self, message: String) -> None:
        """Keep an answer to a question of this caller."""
        with contextlib.suppress(messages.QuestionFormatError):
            answer = messages.parse_object(message.data)
            self._answers.get(answer.get('id', ''), []).append(answer)

    def _on_places(self, message: String) -> None:
        """Keep the newest places."""
        with contextlib.suppress(messages.QuestionFormatError):
            self._places = messages.parse_object(message.data)

    def interpretations(self, text: str) -> Iterator[dict[str, Any]]:
        """Yield what the planner understands of a text: now, and again if a model is asked."""
        id_ = uuid.uuid4().hex
        self.wait_for_subscriber(self._questions, self.seconds)
        answers = self._answers[id_] = []
        self._questions.publish(String(data=messages.Question(text, id_).to_text()))
        for number in range(2):
            what = f'the interpretation by {self.planner}'
            self.wait_for(lambda: len(answers) > number, what, self.seconds)  # noqa: B023
            yield answers[number]
            if answers[number].get('status') != readings.Understanding.PENDING.value:
                return

    def confirm(self, text: str, *, is_meant: bool) -> None:
        """Answer the questions about the planner's instruction, which is `text`."""
        self.wait_for_subscriber(self._confirm, self.seconds)
        self._confirm.publish(Bool(data=is_meant))
        deadline = time.monotonic() + self.seconds
        while [*self.interpretations(text)][-1].get('questions'):
            if time.monotonic() > deadline:
                raise PlannerClientError(f'{self.planner} did not take the answer')
            time.sleep(POLL_SECONDS)

    def pose(self, where: str | Sequence[float], places: Places | None = None) -> Pose2D:
        """Return a point, which may be the text 'X,Y', or the goal of the place of that name.

        `places` are those to wait for, None for what the planner has. Raises PlaceGoalError with
        the names to choose from.
        """
        if not isinstance(where, str):
            return Pose2D(*where)
        if POINT.fullmatch(where):
            return Pose2D(*map(float, where.split(',')))
        place = find_place(where, self.places(places))
        if place.name not in self._places['goals']:
            raise PlaceGoalError(f'no cell of {place.name!r} is free on the map')
        return Pose2D(*self._places['goals'][place.name])

    def places(self, expected: Places | None = None) -> Places:
        """Return the planner's places, which come with their goals if there are any.

        Waits for those that are `expected`, where they were just set.
        """
        what = f'the places of {self.planner}'

        def have_come() -> bool:
            known = 'goals' in self._places or self._places.get('features') == []
            return known and (
                expected is None
                or places_from_geojson(self._places, what).digest == expected.digest
            )

        self.wait_for(have_come, what, self.seconds)
        return places_from_geojson(self._places, what)

    def grid_map(self) -> GridMap:
        """Return the newest map, to which it listens from the first call on."""
        if not self._listens_to_maps:
            self._listens_to_maps = True
            MapSubscription(entities.Entities(self.node), self._on_map)
        self.wait_for(lambda: bool(self._maps), 'a map', self.seconds)
        return self._maps[-1]

    def _on_map(self, grid_map: GridMap, _: float) -> None:
        """Keep the newest map."""
        with self._arrived:
            self._maps = [grid_map]
            self._arrived.notify_all()

    def interpret(self, text: str, places: Places, time_limit: float) -> readings.Interpretation:
        """Return what the graph understands of a text; its own places and limits hold."""
        del places, time_limit
        try:
            *_, answer = self.interpretations(text)
            if answer.get('error'):
                return readings.not_understood(text, str(answer['error']))
            return messages.interpretation_from_json(answer)
        except LlmAstarError as error:
            return readings.not_understood(text, str(error))


@contextlib.contextmanager
def calling(namespace: str, planner: str, seconds: float) -> Iterator[PlannerCaller]:
    """Join the graph in `namespace` to call `planner`. Raises NodeNameError."""
    with joined('llm_astar_call', check_names(namespace, planner)) as node:
        caller = PlannerCaller(node, planner, seconds)
        with caller:
            caller.wait_until_ready(seconds=seconds)
            yield caller


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
        on_report = partial(self._on_report, EventKind.PLAN, reports.PlanReport, self.planner)
        on_exchange = partial(
            self._on_report, EventKind.EXCHANGE, reports.ExchangeReport, self._client
        )
        for topic, on_message, qos in (
            (f'{planner}/report', on_report, entities.REPORTS),
            (f'{client}/exchange', on_exchange, entities.REPORTS),
            ('/diagnostics', self._on_diagnostics, entities.RELIABLE),
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
        self, kind: EventKind, report: type[reports.Report], node: str, message: DiagnosticArray
    ) -> None:
        self._heard = self._heard or node == self.planner
        try:
            values = asdict(reports.report_from_message(message, report))
        except reports.ReportError as error:
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
