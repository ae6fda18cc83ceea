"""llm_client_node: answers a start and a goal with waypoints on the latest map."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from llm_astar_msgs_adapter.barrier_map import BarrierMapError, load_barrier_maps
from llm_astar_msgs_adapter.grid_map import GridMap, GridMapError
from llm_astar_msgs_adapter.occupancy_grid import grid_from_message
from llm_astar_msgs_adapter.path import path_to_message, pose_from_message
from llm_astar_msgs_adapter.report import ExchangeReport, report_to_message, status_to_message
from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import GetPlan
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node

from llm_astar_planner.nodes.parameters import Parameter, Parameters
from llm_astar_planner.nodes.qos import LATCHED, RELIABLE, REPORTS
from llm_astar_planner.nodes.run import run
from llm_astar_planner.search.result import Cell
from llm_astar_planner.share import find_file
from llm_astar_planner.waypoint_source.base import (
    SourceStatus,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)
from llm_astar_planner.waypoint_source.factory import SOURCES, SourceSettings, make_source

THREADS = 16
# What an exchange message carries of a reply; the transcript holds it whole.
MAX_TEXT = 4000

PARAMETERS = (
    Parameter('source', 'none', 'Where waypoints come from', choices=tuple(SOURCES)),
    Parameter('timeout_s', 4.0, 'Seconds an answer may take', minimum=0.05, maximum=600.0),
    Parameter('model', '', 'The model asked, or whose exchanges are replayed'),
    Parameter('prompt', '', 'The prompt used, or whose exchanges are replayed'),
    Parameter('transcript', '', 'Recorded exchanges: a path, or a name in maps/'),
    Parameter('dataset', '', 'Barrier maps the transcript is about: a path, or a name in maps/'),
)


class LlmClientNode(Node):
    """Serves `~/get_waypoints`; an empty path is no waypoints, and `~/exchange` says why."""

    def __init__(self, **node_options: Any) -> None:  # noqa: ANN401 - rclpy's own
        """Set up the source. Raises ParameterError where its parameters do not fit."""
        super().__init__('llm_client_node', **node_options)
        self._grid_map: GridMap | None = None
        self._last: ExchangeReport | None = None
        self._settings = Parameters(self, PARAMETERS, _problem)
        self._source = _make_source(self._settings.values())
        self.add_post_set_parameters_callback(lambda _: self._remake_source())
        self._exchange_publisher = self.create_publisher(DiagnosticArray, '~/exchange', REPORTS)
        self._health_publisher = self.create_publisher(DiagnosticArray, '/diagnostics', RELIABLE)
        together = ReentrantCallbackGroup()
        self.create_subscription(
            OccupancyGrid,
            'map',
            self._on_map,
            LATCHED,
            callback_group=MutuallyExclusiveCallbackGroup(),
        )
        self.create_service(
            GetPlan, '~/get_waypoints', self._on_get_waypoints, callback_group=together
        )
        self.create_timer(1.0, self._publish_health, callback_group=together)
        self.get_logger().info(f'ready; waypoints by {self._source.name}')

    def _remake_source(self) -> None:
        self._source = _make_source(self._settings.values())

    def _on_map(self, message: OccupancyGrid) -> None:
        try:
            self._grid_map = grid_from_message(message)
        except GridMapError as error:
            self.get_logger().error(f'map refused, the last one stays: {error}')
            return
        self._publish_health()

    def _on_get_waypoints(
        self, request: GetPlan.Request, response: GetPlan.Response
    ) -> GetPlan.Response:
        """Ask the source; publish the exchange, then answer under the same stamp."""
        stamp = self.get_clock().now().to_msg()
        grid_map = self._grid_map
        reply = self._ask(request, grid_map)
        digest = '' if grid_map is None else grid_map.digest
        self._last = _exchange_report(reply, digest)
        self._exchange_publisher.publish(report_to_message(self._last, self.get_name(), stamp))
        self.get_logger().info(self._last.summary)
        if grid_map is not None:
            points = grid_map.grid_to_world(reply.waypoints)
            response.plan = path_to_message(points, grid_map.frame_id, stamp)
        response.plan.header.stamp = stamp
        return response

    def _ask(self, request: GetPlan.Request, grid_map: GridMap | None) -> WaypointReply:
        if grid_map is None:
            return _refusal('no map has arrived yet')
        try:
            start = _cell(request.start, 'start', grid_map)
            goal = _cell(request.goal, 'goal', grid_map)
        except GridMapError as error:
            return _refusal(str(error))
        source: WaypointSource = self._source
        query = WaypointQuery(grid_map, start, goal, self._settings['timeout_s'])
        try:
            reply = source.waypoints(query)
        except Exception as error:  # noqa: BLE001 - the planner must get an answer
            self.get_logger().error(f'{type(error).__name__} in source {source.name}')
            return _refusal(f'{type(error).__name__} in source {source.name}')
        finite = tuple(point for point in reply.waypoints if all(map(math.isfinite, point)))
        return WaypointReply(**{**vars(reply), 'waypoints': finite})

    def _publish_health(self) -> None:
        """Publish the state of the node: at 1 Hz, and whenever a map comes."""
        values = {
            'source': self._source.name,
            'map_digest': self._grid_map.digest if self._grid_map else None,
            'last_status': self._last.status if self._last else None,
            'last_detail': self._last.detail if self._last else None,
        }
        failed = self._last is not None and self._last.level != DiagnosticStatus.OK
        level = DiagnosticStatus.WARN if failed else DiagnosticStatus.OK
        message = self._last.summary if self._last else 'not asked yet'
        name = f'{self.get_fully_qualified_name()[1:]}: waypoints'
        stamp = self.get_clock().now().to_msg()
        self._health_publisher.publish(status_to_message(name, level, message, values, stamp))


def _cell(pose: PoseStamped, name: str, grid_map: GridMap) -> Cell:
    frame = pose.header.frame_id
    if frame not in ('', grid_map.frame_id):
        raise GridMapError(name, f'is in frame {frame!r}, the map in {grid_map.frame_id!r}')
    place = pose_from_message(pose, name)
    return grid_map.world_to_cell(place.x, place.y)


def _refusal(detail: str) -> WaypointReply:
    return WaypointReply(status=SourceStatus.ERROR, detail=detail)


def _exchange_report(reply: WaypointReply, digest: str) -> ExchangeReport:
    return ExchangeReport(
        label=reply.label,
        status=reply.status.value,
        detail=reply.detail,
        model=reply.model,
        prompt=reply.prompt,
        text=reply.text[:MAX_TEXT],
        prompt_tokens=reply.prompt_tokens,
        completion_tokens=reply.completion_tokens,
        seconds=reply.seconds,
        waypoints=reply.waypoints,
        map_digest=digest,
    )


def _make_source(values: dict[str, Any]) -> WaypointSource:
    """Make the source the parameters name. Raises ValueError or OSError where it cannot be."""
    transcript, dataset = (
        str(find_file(values[name], 'maps')) if values[name] else ''
        for name in ('transcript', 'dataset')
    )
    settings = SourceSettings(
        source=values['source'],
        transcript=transcript,
        model=values['model'],
        prompt=values['prompt'],
        timeout_s=values['timeout_s'],
    )
    maps = load_barrier_maps(dataset) if dataset else None
    return make_source(settings, dataset=maps)


def _problem(values: dict[str, Any]) -> str:
    try:
        _make_source(values)
    except (BarrierMapError, OSError, ValueError) as error:
        return str(error)
    return ''


def main(args: Sequence[str] | None = None) -> int:
    """Run llm_client_node."""
    return run(LlmClientNode, args, lambda: MultiThreadedExecutor(num_threads=THREADS))


if __name__ == '__main__':
    raise SystemExit(main())
