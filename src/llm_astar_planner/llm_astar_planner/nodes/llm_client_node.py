# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""llm_client_node: returns waypoints between a start and a goal on the latest map."""

import math
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_msgs_adapter.maps.grid_map import GridMap, GridMapError
from llm_astar_msgs_adapter.messages.fields import pose_from_message
from llm_astar_msgs_adapter.messages.report import ExchangeReport
from llm_astar_msgs_adapter.messages.writing import (
    path_to_message,
    report_to_message,
    status_to_message,
)
from nav_msgs.srv import GetPlan
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.instructions.chain import make_interpreter
from llm_astar_planner.nodes.common.entities import RELIABLE, REPORTS, Entities, QueuedService
from llm_astar_planner.nodes.common.map_subscription import MapSubscription
from llm_astar_planner.nodes.common.parameters import OVERRIDES, Parameters
from llm_astar_planner.nodes.common.questions import InterpretationServer
from llm_astar_planner.nodes.common.spin import run_node
from llm_astar_planner.planning import parameters as tables
from llm_astar_planner.planning.compile import compile_map_kernels, compile_progress
from llm_astar_planner.resources import find_file
from llm_astar_planner.search.arrays import StopFlag
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.async_query import TOO_LATE, QueryQueue, QueryTask
from llm_astar_planner.waypoints.config import make_source
from llm_astar_planner.waypoints.llm.source import client_of
from llm_astar_planner.waypoints.replay import NoSource
from llm_astar_planner.waypoints.source import (
    SampleKey,
    SourceStatus,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)

THREADS = 16
# Callers that wait for waypoints, at most, on threads of their own. More wait for one of these.
CALLERS = 13
# Of their questions so many run at a time: a request to a server only waits, but a model in this
# process computes. The rest waits, the newest first; those more than CALLERS are refused.
AT_A_TIME_BY_SERVER, AT_A_TIME = 8, 1
# Threads for questions, those included that have exceeded their time limit and still run.
QUERY_THREADS = 12
# Each change of a parameter makes a new source, and the queries to the one before it run on until
# their server answers or their time is up. With more threads no change is taken.
MOST_THREADS = 128
REPLACED_TOO_OFTEN = (
    'the parameters were changed too often: earlier queries still wait; try again in a minute'
)
# What an exchange message has of a reply as it is.
REPORTED = (
    *('label', 'detail', 'model', 'prompt', 'unit', 'prompt_tokens', 'completion_tokens'),
    *('seconds', 'waypoints'),
)
# Characters of a text in an exchange message; a transcript holds the whole text.
MAX_TEXT = 16000


class NoMapError(LlmAstarError, RuntimeError):
    """The node has received no map yet."""


class LlmClientNode(Node):
    """Serves `~/get_waypoints` and answers `~/interpret`.

    An empty path means no waypoints; `~/exchange` says why.
    """

    def __init__(self, **node_options: Any) -> None:  # noqa: ANN401 - rclpy's own
        """Make the source. Raises ParameterError where its parameters do not fit together."""
        super().__init__('llm_client_node', **OVERRIDES, **node_options)
        # Before anything that may raise: since Kilted rclpy destroys a node that was half made.
        self._entities = Entities(self)
        self._grid_map: GridMap | None = None
        self._costmap: Costmap | None = None
        self._costmap_lock = threading.Lock()
        self._last: ExchangeReport | None = None
        self._source: WaypointSource = NoSource()
        self._source_values: dict[str, Any] = {}
        self._interpretations: InterpretationServer | None = None
        self._settings = Parameters(self, 'llm_client_node', self.parameter_problem)
        self.adopt_source()
        self.add_post_set_parameters_callback(lambda _: self.adopt_source())
        self._exchange_publisher = self.create_publisher(DiagnosticArray, '~/exchange', REPORTS)
        self._health_publisher = self.create_publisher(DiagnosticArray, '/diagnostics', RELIABLE)
        # In the background, since a caller waits for no answer anyway.
        threading.Thread(target=self.compile, name='compiler', daemon=True).start()
        MapSubscription(self._entities, self.on_map)
        self._interpretations = InterpretationServer(self._entities, self._new_interpreter)
        waypoints, name = self.on_get_waypoints, '~/get_waypoints'
        QueuedService(self._entities, GetPlan, name, waypoints, threads=CALLERS)
        self._entities.timer(1.0, self.publish_health, ReentrantCallbackGroup())
        self._entities.on_close(lambda: self._queue.close())  # noqa: PLW0108 - it is replaced
        self.get_logger().info(f'ready; waypoints by {self._source.name}')

    def destroy_node(self) -> None:
        """Leave the graph; a model that is still asked is left alone."""
        self._entities.close()
        super().destroy_node()

    def compile(self) -> None:
        """Compile the kernels that costmaps take, or load them; log how far that is.

        What fails is compiled when it is needed, which then says what is wrong.
        """
        say = self.get_logger().info
        with suppress(Exception), compile_progress(say, 'the first waypoints', 'waypoints go on'):
            compile_map_kernels()

    def parameter_problem(self, values: dict[str, Any]) -> str | None:
        """Return why parameters do not make a source; else make the source and return None."""
        source_values = {
            name: value for name, value in values.items() if name not in tables.SET_BY_PLANNER
        }
        problem = self.change_of_fixed(values)
        if problem is not None:
            return problem
        try:
            if source_values != self._source_values:
                if threading.active_count() > MOST_THREADS:
                    return REPLACED_TOO_OFTEN
                transcript, dataset = values['transcript'], values['dataset']
                maps = load_barrier_maps(find_file(dataset, 'maps')) if dataset else None
                if transcript:
                    values = values | {'transcript': str(find_file(transcript, 'maps'))}
                self._new_source = make_source(tables.source_config(values), dataset=maps)
                self._new_interpreter = make_interpreter(values)
        except (OSError, ValueError) as error:
            return str(error)
        self._source_values = source_values
        return None

    def change_of_fixed(self, values: dict[str, Any]) -> str | None:
        """Say which parameter may not change any more since the start; None where none does."""
        before = self._source_values
        if not before or not values['fixed_endpoint']:
            return None
        changed = [name for name in tables.FIXED if values[name] != before[name]]
        if not changed:
            return None
        return f'{changed[0]}: is fixed; start the node with `fixed_endpoint: false` to change it'

    def adopt_source(self) -> None:
        """Use the source and the interpreter that the last check of the parameters made."""
        if self._new_source is not self._source:
            self._source = self._new_source
            at_a_time = AT_A_TIME_BY_SERVER if client_of(self._source) else AT_A_TIME
            self._queue = QueryQueue(at_a_time, QUERY_THREADS, CALLERS - 1 - at_a_time)
        if self._interpretations is not None:
            self._interpretations.adopt(self._new_interpreter)

    def on_map(self, grid_map: GridMap, _: float = 0.0) -> None:
        """Keep a new map."""
        self._grid_map = grid_map
        self.publish_health()

    def costmap(self) -> Costmap:
        """Return the latest map under the rules of the parameters. Raises NoMapError.

        It is made once and kept until the map or a rule changes, since that takes time.
        """
        config = tables.costmap_config(self._settings.current)
        with self._costmap_lock:
            grid_map, costmap = self._grid_map, self._costmap
            if grid_map is None:
                raise NoMapError('no map has arrived yet')
            if costmap is None or costmap.grid_map is not grid_map or costmap.config != config:
                costmap = Costmap(grid_map, config, previous=costmap)
                costmap.prepare()
                self._costmap = costmap
            return costmap

    def on_get_waypoints(
        self, request: GetPlan.Request, response: GetPlan.Response, arrived: float, busy: str = ''
    ) -> GetPlan.Response:
        """Query the source; publish the exchange, then respond with the same stamp."""
        reply, query = WaypointReply(status=SourceStatus.REFUSED, detail=busy), None
        if not busy:
            reply, query = self.ask(request, arrived)
        stamp = self.get_clock().now().to_msg()
        response.plan.header.stamp = stamp
        if self._grid_map is not None:
            response.plan.header.frame_id = self._grid_map.frame_id
        key = SampleKey('', '')
        if query is not None:
            key = query.live_key
            points = query.grid_map.grid_to_world(reply.waypoints)
            response.plan = path_to_message(points, query.grid_map.frame_id, stamp)
        self._last = exchange_report(reply, key)
        self._exchange_publisher.publish(report_to_message(self._last, self.get_name(), stamp))
        if reply.status is SourceStatus.NO_WAYPOINTS:
            # It was asked and had none to give, as often as each second.
            self.get_logger().debug(self._last.summary)
        elif self._last.level == DiagnosticStatus.OK:
            self.get_logger().info(self._last.summary)
        else:
            self.get_logger().warning(self._last.summary)
        return response

    def ask(
        self, request: GetPlan.Request, arrived: float
    ) -> tuple[WaypointReply, WaypointQuery | None]:
        """Ask the source; return its reply, and the query if the source was asked.

        GetPlan has no field for the caller's time limit, so `tolerance` holds it, in seconds from
        when the request `arrived` (monotonic).
        """
        source, queries = self._source, []
        limit = self._settings['timeout_s']
        if request.tolerance > 0.0:
            limit = min(limit, request.tolerance)
        deadline = arrived + limit
        limit = deadline - time.monotonic()
        if limit <= 0.0:
            return WaypointReply(status=SourceStatus.TIMEOUT, detail=TOO_LATE), None

        def answer(stop: StopFlag) -> WaypointReply:
            try:
                query = self.make_query(request, deadline - time.monotonic(), stop)
            except (GridMapError, NoMapError) as error:
                return WaypointReply(status=SourceStatus.ERROR, detail=str(error))
            queries.append(query)
            reply = source.waypoints(query)
            finite = tuple(point for point in reply.waypoints if all(map(math.isfinite, point)))
            return replace(reply, waypoints=finite)

        task = QueryTask(source.name, answer, limit, lambda _: None, self._queue)
        reply, _ = task.result()
        return reply, queries[0] if queries else None

    def make_query(
        self, request: GetPlan.Request, time_limit: float, stop: StopFlag
    ) -> WaypointQuery:
        """Convert a request. Raises NoMapError without a map, GridMapError for a wrong pose."""
        costmap = self.costmap()
        start = cell_of(request.start, 'start', costmap.grid_map)
        goal = cell_of(request.goal, 'goal', costmap.grid_map)
        return WaypointQuery(costmap, start, goal, time_limit, stop=stop)

    def publish_health(self) -> None:
        """Publish the state of the node on /diagnostics: at 1 Hz, and for every new map."""
        client = client_of(self._source)
        values = {
            'source': self._source.name,
            'endpoint': client.problem() or '' if client else None,
            'map_digest': self._grid_map.digest if self._grid_map else None,
            'last_status': self._last.status if self._last else None,
            'last_detail': self._last.detail if self._last else None,
            **(client.budget.values() if client else {}),
        }
        level = self._last.level if self._last else DiagnosticStatus.OK
        message = self._last.summary if self._last else 'not asked yet'
        name = f'{self.get_fully_qualified_name()[1:]}: waypoints'
        stamp = self.get_clock().now().to_msg()
        self._health_publisher.publish(status_to_message(name, level, message, values, stamp))


def cell_of(pose: PoseStamped, name: str, grid_map: GridMap) -> Cell:
    """Return the cell of a pose in the map's frame, or in none. Raises GridMapError."""
    frame = pose.header.frame_id
    if frame not in ('', grid_map.frame_id):
        raise GridMapError(name, f'is in frame {frame!r}, the map in {grid_map.frame_id!r}')
    place = pose_from_message(pose.pose, name)
    return grid_map.world_to_cell(place.x, place.y)


def exchange_report(reply: WaypointReply, key: SampleKey) -> ExchangeReport:
    """Return what `~/exchange` publishes of a reply; `key` identifies map, start and goal."""
    return ExchangeReport(
        **{name: getattr(reply, name) for name in REPORTED},
        status=reply.status.value,
        text=reply.text[:MAX_TEXT],
        messages=tuple((message.role, message.content[:MAX_TEXT]) for message in reply.messages),
        map_digest=str(key.map),
        pair=str(key.pair),
    )


def main(args: Sequence[str] | None = None) -> int:
    """Run llm_client_node."""
    return run_node(LlmClientNode, args, lambda: MultiThreadedExecutor(num_threads=THREADS))
