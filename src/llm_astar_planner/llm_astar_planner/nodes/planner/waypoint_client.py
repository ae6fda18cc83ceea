"""The planner's waypoint source: the llm_client_node of the graph, asked over its service."""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace

import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.messages.diagnostics import (
    ExchangeReport,
    ReportError,
    report_from_message,
)
from llm_astar_msgs_adapter.messages.path import path_from_message, path_to_message
from nav_msgs.srv import GetPlan
from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.qos import qos_profile_parameter_events

from llm_astar_planner.nodes.common.qos import REPORTS
from llm_astar_planner.nodes.common.spin import SpinThread
from llm_astar_planner.nodes.planner.remote_instruction import WISH, RemoteInstruction
from llm_astar_planner.planning.waypoint_filter import snap
from llm_astar_planner.waypoints.source import (
    SourceStatus,
    Waypoint,
    WaypointQuery,
    WaypointReply,
)

LABEL = 'llm_client'
# The client publishes its exchange just before it answers; the two may cross on the way.
EXCHANGE_PATIENCE = 0.1
POLL = 0.05
TRANSPORT_SECONDS = 0.1
MAX_SECONDS = 3600.0
KEPT_EXCHANGES = 64
# Questions under way at a time: more than the node serves callers only if the client hangs.
MAX_PENDING = 32


class WaypointClient:
    """Asks `<client>/get_waypoints` and reads `<client>/exchange` for what lies behind the answer.

    A wish goes ahead of the question, to the client's parameter `instruction`; it counts as
    followed where the exchange says that the answer is to this very wish.

    It has a node and a thread of its own, so that a planner whose callbacks all wait for
    waypoints still receives them.
    """

    name = LABEL

    def __init__(self, parent: Node, client: str, on_change: Callable[[], None]) -> None:
        """Join the graph beside `parent`, in its context and namespace, to ask node `client`.

        `on_change` is called when the client starts, or its parameters change: from then on it
        may answer otherwise.
        """
        self._client_name = client
        self._node = rclpy.create_node(
            f'_{parent.get_name()}_waypoints',
            namespace=parent.get_namespace(),
            context=parent.context,
            start_parameter_services=False,
            enable_rosout=False,
            use_global_arguments=False,
        )
        # Remaps are the parent's: given to this node too, __node would rename both alike.
        service = parent.resolve_service_name(f'{client}/get_waypoints')
        exchange = parent.resolve_topic_name(f'{client}/exchange')
        self._client = self._node.create_client(GetPlan, service)
        self._exchanges: OrderedDict[tuple[int, int], ExchangeReport] = OrderedDict()
        self._arrived = threading.Condition()
        self._free = threading.BoundedSemaphore(MAX_PENDING)
        self._node.create_subscription(DiagnosticArray, exchange, self._on_exchange, REPORTS)
        self._full_name = parent.resolve_service_name(client)
        self._wish = RemoteInstruction(self._node, self._full_name)
        self._on_change = on_change
        self._node.create_subscription(
            ParameterEvent, '/parameter_events', self._on_parameters, qos_profile_parameter_events
        )
        self._thread = SpinThread(self._node)
        self._thread.start()

    @property
    def ready(self) -> bool:
        """Whether the client's service is there."""
        return bool(self._client.service_is_ready())

    def close(self) -> None:
        """Leave the graph."""
        self._thread.close()
        self._node.destroy_node()

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Ask the client; every failure is a status, within the query's time limit."""
        deadline = time.monotonic() + query.time_limit
        for is_last in (False, True):
            problem = self._wish.put(query.instruction, deadline)
            asked = replace(query, time_limit=max(0.0, deadline - time.monotonic()))
            reply, exchange = self._answer(asked)
            # A client that was started anew, or told by others, is told and asked once more.
            if is_last or problem or self._wish.is_answered(query.instruction, exchange):
                break
        return replace(reply, instruction=_outcome(query, reply, exchange, problem))

    def _answer(self, query: WaypointQuery) -> tuple[WaypointReply, ExchangeReport | None]:
        """Ask once; return the reply and the exchange behind it, if there is one."""
        begin = time.monotonic()
        if not self._free.acquire(blocking=False):
            detail = f'{MAX_PENDING} questions to {self._client_name} are under way'
            return self._failure(SourceStatus.REFUSED, detail, begin), None
        try:
            response, status, detail = self._call(query, begin + query.time_limit)
        finally:
            self._free.release()
        if response is None:
            return self._failure(status, detail, begin), None
        path = response.plan
        exchange = self._exchange(path.header.stamp)
        if path.poses and path.header.frame_id != query.grid_map.frame_id:
            detail = f'{self._client_name} answered in frame {path.header.frame_id!r}'
            return self._failure(SourceStatus.MALFORMED, detail, begin), exchange
        places = query.grid_map.world_to_grid(path_from_message(path)).tolist()
        waypoints = tuple((snap(x), snap(y)) for x, y in places)
        return self._reply(waypoints, exchange, begin), exchange

    def _call(
        self, query: WaypointQuery, deadline: float
    ) -> tuple[GetPlan.Response | None, SourceStatus, str]:
        """Call the service; give up at the deadline, or as soon as it is gone."""
        if not self.ready:
            return None, SourceStatus.UNREACHABLE, f'{self._client_name} is not there'
        done = threading.Event()
        future = self._client.call_async(_request(query))
        future.add_done_callback(lambda _: done.set())
        while not done.wait(max(0.0, min(POLL, deadline - time.monotonic()))):
            gone = not self.ready
            if gone or time.monotonic() >= deadline:
                self._client.remove_pending_request(future)
                if gone:
                    detail = f'{self._client_name} went away while asked'
                    return None, SourceStatus.UNREACHABLE, detail
                detail = f'{self._client_name} was silent for {query.time_limit:.2f} s'
                return None, SourceStatus.TIMEOUT, detail
        return future.result(), SourceStatus.OK, ''

    def _exchange(self, stamp: Time) -> ExchangeReport | None:
        """Return the exchange behind the answer of that stamp, if it comes in time."""
        key = (stamp.sec, stamp.nanosec)
        with self._arrived:
            self._arrived.wait_for(lambda: key in self._exchanges, EXCHANGE_PATIENCE)
            return self._exchanges.get(key)

    def _on_exchange(self, message: DiagnosticArray) -> None:
        try:
            exchange = report_from_message(message, ExchangeReport)
        except ReportError as error:
            self._node.get_logger().warning(f'{self._client_name}/exchange: {error}')
            return
        stamp = message.header.stamp
        with self._arrived:
            self._exchanges[stamp.sec, stamp.nanosec] = exchange
            if len(self._exchanges) > KEPT_EXCHANGES:
                self._exchanges.popitem(last=False)
            self._arrived.notify_all()

    def _on_parameters(self, event: ParameterEvent) -> None:
        changed = (*event.new_parameters, *event.changed_parameters)
        # A wish is part of the question, and is set from here.
        if event.node == self._full_name and {one.name for one in changed} != {WISH}:
            self._on_change()

    def _reply(
        self, waypoints: tuple[Waypoint, ...], exchange: ExchangeReport | None, begin: float
    ) -> WaypointReply:
        seconds = time.monotonic() - begin
        if exchange is None:
            status = SourceStatus.OK if waypoints else SourceStatus.NO_WAYPOINTS
            return WaypointReply(waypoints, LABEL, status, seconds=seconds)
        return WaypointReply(
            waypoints,
            exchange.label,
            _status(exchange.status),
            exchange.detail,
            exchange.text,
            exchange.model,
            exchange.prompt,
            exchange.prompt_tokens,
            exchange.completion_tokens,
            seconds,
        )

    def _failure(self, status: SourceStatus, detail: str, begin: float) -> WaypointReply:
        seconds = time.monotonic() - begin
        return WaypointReply(label=LABEL, status=status, detail=detail, seconds=seconds)


def _request(query: WaypointQuery) -> GetPlan.Request:
    grid: GridMap = query.grid_map
    ends = grid.grid_to_world([query.start, query.goal])
    poses = path_to_message(ends, grid.frame_id, Time()).poses
    # The client reads the time it has from `tolerance`; a part of it is for the way.
    wait = max(0.01, query.time_limit - TRANSPORT_SECONDS)
    return GetPlan.Request(start=poses[0], goal=poses[1], tolerance=min(wait, MAX_SECONDS))


def _outcome(
    query: WaypointQuery, reply: WaypointReply, exchange: ExchangeReport | None, problem: str
) -> str:
    """Say what became of the wish, '' where none was made or where the reply's failure says it."""
    if not query.instruction:
        return ''
    if exchange is None:
        is_lost = reply.status in (SourceStatus.OK, SourceStatus.NO_WAYPOINTS)
        return problem or ('the client does not say what it answered' if is_lost else '')
    if exchange.instruction != query.instruction:
        return problem or 'the client answered another wish'
    return str(exchange.instruction_outcome)


def _status(name: str) -> SourceStatus:
    return SourceStatus(name) if name in SourceStatus.__members__ else SourceStatus.ERROR
