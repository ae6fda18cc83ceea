# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The planner's waypoint source: llm_client_node, queried over its service."""

import threading
import time
from collections.abc import Callable
from dataclasses import asdict

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.messages.fields import path_from_message
from llm_astar_msgs_adapter.messages.report import ExchangeReport, ReportError, report_from_message
from llm_astar_msgs_adapter.messages.writing import path_to_message
from nav_msgs.srv import GetPlan
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import SetParameters
from rclpy.qos import qos_profile_parameter_events

from llm_astar_planner.caches import Recent
from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.nodes.common.entities import CALLS, REPORTS, Entities, ask, setting
from llm_astar_planner.nodes.common.spin import SpinThread, side_node
from llm_astar_planner.planning.parameters import SET_BY_PLANNER
from llm_astar_planner.planning.plan_reuse import WaypointCache
from llm_astar_planner.planning.segment import snap
from llm_astar_planner.waypoints.config import helps_on
from llm_astar_planner.waypoints.source import SourceStatus, WaypointQuery, WaypointReply

LABEL = 'llm_client'
# The client publishes its exchange just before it answers; the two may arrive in either order.
EXCHANGE_PATIENCE = 0.1
POLL_SECONDS = 0.05
TRANSPORT_SECONDS = 0.1
MAX_SECONDS = 3600.0
KEPT_EXCHANGES = 64
# What a reply has of the client's exchange as it is.
SAID = ('label', 'detail', 'text', 'model', 'prompt', 'prompt_tokens', 'completion_tokens')

# The client's services are discovered one after the other.
DISCOVERY_SECONDS = 1.0


class ClientFailure(LlmAstarError):  # noqa: N818 - of the outside world, not a bug
    """Why the client gave no answer."""

    def __init__(self, status: SourceStatus, detail: str) -> None:
        """Take the status and a sentence."""
        super().__init__(detail)
        self.status = status


class WaypointClient:
    """Calls `<client>/get_waypoints` and reads `<client>/exchange` for how the answer was made.

    The costmap's rules are set on the client before it is asked.

    It has a node and a thread of its own, so that a planner whose callbacks all wait for
    waypoints still receives them.
    """

    name = LABEL

    def __init__(self, entities: Entities, client: str, on_change: Callable[[], None]) -> None:
        """Join the graph next to the node of `entities`, to query node `client`.

        `on_change` is called when the client starts or somebody else changes its parameters: it
        may answer differently from then on.
        """
        parent = entities.node
        self._client_name = client
        self._node = side_node(parent, 'waypoints')
        entities.on_close(self._node.destroy_node)
        service = parent.resolve_service_name(f'{client}/get_waypoints')
        exchange = parent.resolve_topic_name(f'{client}/exchange')
        self._client = self._node.create_client(GetPlan, service, qos_profile=CALLS)
        # While it is not, a query is answered at once: that nobody is there.
        self.service_is_ready: Callable[[], bool] = self._client.service_is_ready
        self._exchanges: Recent[tuple[int, int], ExchangeReport] = Recent(KEPT_EXCHANGES)
        self._arrived = threading.Condition()
        self._node.create_subscription(DiagnosticArray, exchange, self.on_exchange, REPORTS)
        self._full_name = parent.resolve_service_name(client)
        self._setter = self._node.create_client(SetParameters, f'{self._full_name}/set_parameters')
        self._rules, self._rules_lock = CostmapConfig(), threading.Lock()
        self._on_change = on_change
        self.cache = WaypointCache(LABEL)
        # Where the client chooses by the map to ask nobody it is asked on some maps only: that it
        # does so is known from its first answer without a source.
        self.helps_on: Callable[[Costmap], bool] | None = None
        self._node.create_subscription(
            ParameterEvent, '/parameter_events', self.on_event, qos_profile_parameter_events
        )
        entities.on_close(SpinThread(self._node).close)

    def waypoints(self, query: WaypointQuery) -> WaypointReply:
        """Return the waypoints of the last plan to the goal if they hold, else ask the client."""
        return self.cache.find(query) or self.ask(query)

    def ask(self, query: WaypointQuery) -> WaypointReply:
        """Query the client; every failure is a status, within the query's time limit."""
        deadline = time.monotonic() + query.time_limit
        if self.service_is_ready():
            self.put_rules(query.costmap.config, deadline)
        begin = time.monotonic()
        exchange = None
        try:
            path = self.call(query, deadline).plan
            exchange = self.exchange_of(path.header.stamp)
            if path.poses and path.header.frame_id != query.grid_map.frame_id:
                detail = f'{self._client_name} answered in frame {path.header.frame_id!r}'
                raise ClientFailure(SourceStatus.MALFORMED, detail)
        except ClientFailure as failure:
            seconds = time.monotonic() - begin
            return WaypointReply(
                label=LABEL, status=failure.status, detail=str(failure), seconds=seconds
            )
        # Only `auto` answers so, and decides by the map alone.
        is_auto = exchange is not None and exchange.status == SourceStatus.NONE.value
        self.helps_on = helps_on if is_auto else None
        places = query.grid_map.world_to_grid(path_from_message(path)).tolist()
        waypoints = tuple((snap(x), snap(y)) for x, y in places)
        seconds = time.monotonic() - begin
        if exchange is None:
            status = SourceStatus.OK if waypoints else SourceStatus.NO_WAYPOINTS
            return WaypointReply(waypoints, LABEL, status, seconds=seconds)
        known = exchange.status in SourceStatus.__members__
        status = SourceStatus(exchange.status) if known else SourceStatus.ERROR
        said = {name: getattr(exchange, name) for name in SAID}
        return WaypointReply(waypoints, status=status, seconds=seconds, **said)

    def call(self, query: WaypointQuery, deadline: float) -> GetPlan.Response:
        """Call the service. Raises ClientFailure at the deadline, or when the client is gone.

        Also when nobody waits for the answer any more.
        """
        if not self.service_is_ready():
            raise ClientFailure(SourceStatus.UNREACHABLE, f'{self._client_name} is not there')
        done = threading.Event()
        time_left = max(0.0, deadline - time.monotonic())
        future = self._client.call_async(to_message(query, time_left))
        future.add_done_callback(lambda _: done.set())
        while not done.wait(max(0.0, min(POLL_SECONDS, deadline - time.monotonic()))):
            failure = self.failure(query, deadline)
            if failure is not None:
                self._client.remove_pending_request(future)
                raise failure
        return future.result()

    def failure(self, query: WaypointQuery, deadline: float) -> ClientFailure | None:
        """Return why a query is not waited for any longer, None while it is."""
        if query.stop is not None and query.stop[0]:
            return ClientFailure(SourceStatus.LATE, 'nobody waits for it any more')
        if not self.service_is_ready():
            detail = f'{self._client_name} went away during the query'
            return ClientFailure(SourceStatus.UNREACHABLE, detail)
        if time.monotonic() >= deadline:
            detail = f'{self._client_name} was silent for {query.time_limit:.2f} s'
            return ClientFailure(SourceStatus.TIMEOUT, detail)
        return None

    def exchange_of(self, stamp: Time) -> ExchangeReport | None:
        """Return the exchange that belongs to the answer with this stamp, if it comes in time."""
        key = (stamp.sec, stamp.nanosec)
        with self._arrived:
            self._arrived.wait_for(lambda: key in self._exchanges, EXCHANGE_PATIENCE)
            return self._exchanges.get(key)

    def on_exchange(self, message: DiagnosticArray) -> None:
        """Keep an exchange until its answer arrives."""
        try:
            exchange = report_from_message(message, ExchangeReport)
        except ReportError as error:
            self._node.get_logger().warning(f'{self._client_name}/exchange: {error}')
            return
        stamp = message.header.stamp
        with self._arrived:
            self._exchanges[stamp.sec, stamp.nanosec] = exchange
            self._arrived.notify_all()

    def put_rules(self, config: CostmapConfig, deadline: float) -> None:
        """Set the costmap's rules on the client by `deadline` (monotonic) if it has others.

        GetPlan has no fields for them. What the client has is known from what was set; one that
        was never set is assumed to have the defaults. A client that does not take them is asked
        all the same, and its waypoints are checked as any.
        """
        with self._rules_lock:
            if config == self._rules:
                return
            patience = min(DISCOVERY_SECONDS, max(0.0, deadline - time.monotonic()))
            if self._setter.wait_for_service(patience):
                ask(self._setter, setting(asdict(config)), deadline - time.monotonic())
            self._rules = config  # once: a client without these parameters has no use of them

    def on_event(self, event: ParameterEvent) -> None:
        """Tell when the client may answer differently."""
        changed = {one.name for one in (*event.new_parameters, *event.changed_parameters)}
        # What the planner sets itself belongs to the query.
        if event.node == self._full_name and not changed <= set(SET_BY_PLANNER):
            if event.new_parameters:
                with self._rules_lock:
                    self._rules = CostmapConfig()  # the client was restarted
            self.helps_on = None
            self._on_change()


def to_message(query: WaypointQuery, seconds: float) -> GetPlan.Request:
    """Write a query as a message; `tolerance` holds the seconds that the client has."""
    grid = query.grid_map
    endpoints = grid.grid_to_world([query.start, query.goal])
    poses = path_to_message(endpoints, grid.frame_id, Time()).poses
    wait = max(0.01, seconds - TRANSPORT_SECONDS)
    return GetPlan.Request(start=poses[0], goal=poses[1], tolerance=min(wait, MAX_SECONDS))
