"""llm_client_node: answers a start and a goal with waypoints on the latest map."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMapError, load_barrier_maps
from llm_astar_msgs_adapter.maps.grid_map import GridMap, GridMapError
from llm_astar_msgs_adapter.messages.diagnostics import (
    ExchangeReport,
    report_to_message,
    status_to_message,
)
from llm_astar_msgs_adapter.messages.path import path_to_message, pose_from_message
from nav_msgs.srv import GetPlan
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node

from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.nodes.common.entities import Entities
from llm_astar_planner.nodes.common.map_subscription import MapSubscription
from llm_astar_planner.nodes.common.parameters import Parameters
from llm_astar_planner.nodes.common.qos import RELIABLE, REPORTS
from llm_astar_planner.nodes.common.spin import run_node
from llm_astar_planner.planning.parameters import source_config
from llm_astar_planner.resources import find_file
from llm_astar_planner.search.result import Cell
from llm_astar_planner.waypoints.async_query import query_source
from llm_astar_planner.waypoints.factory import client_of, make_source
from llm_astar_planner.waypoints.prompts.instruction import clean_instruction
from llm_astar_planner.waypoints.source import (
    SampleKey,
    SourceStatus,
    WaypointQuery,
    WaypointReply,
    WaypointSource,
)

THREADS = 16
# What an exchange message carries of a reply; the transcript holds it whole.
MAX_TEXT = 16000


class LlmClientNode(Node):
    """Serves `~/get_waypoints`; an empty path is no waypoints, and `~/exchange` says why."""

    def __init__(self, **node_options: Any) -> None:  # noqa: ANN401 - rclpy's own
        """Set up the source. Raises ParameterError where its parameters do not fit."""
        super().__init__('llm_client_node', **node_options)
        self._grid_map: GridMap | None = None
        self._last: ExchangeReport | None = None
        self._chosen: dict[str, Any] = {}
        self._settings = Parameters(self, 'llm_client_node', self._problem)
        self._adopt()
        self.add_post_set_parameters_callback(lambda _: self._adopt())
        self._exchange_publisher = self.create_publisher(DiagnosticArray, '~/exchange', REPORTS)
        self._health_publisher = self.create_publisher(DiagnosticArray, '/diagnostics', RELIABLE)
        together = ReentrantCallbackGroup()
        MapSubscription(Entities(self), self._on_map)
        self.create_service(
            GetPlan, '~/get_waypoints', self._on_get_waypoints, callback_group=together
        )
        self.create_timer(1.0, self._publish_health, callback_group=together)
        self.get_logger().info(f'ready; waypoints by {self._source.name}')

    def _problem(self, values: dict[str, Any]) -> str | None:
        """Say why no source can be made of parameters, or keep the one made to be adopted."""
        chosen = {name: value for name, value in values.items() if name != 'instruction'}
        try:
            clean_instruction(values['instruction'])
            # A wish is no reason for a new source: the old one has its cache.
            if chosen != self._chosen:
                self._candidate = _make_source(values)
        except (BarrierMapError, OSError, ValueError) as error:
            return str(error)
        self._chosen = chosen
        return None

    def _adopt(self) -> None:
        self._source = self._candidate

    def _on_map(self, grid_map: GridMap) -> None:
        self._grid_map = grid_map
        self._publish_health()

    def _on_get_waypoints(
        self, request: GetPlan.Request, response: GetPlan.Response
    ) -> GetPlan.Response:
        """Ask the source; publish the exchange, then answer under the same stamp."""
        stamp = self.get_clock().now().to_msg()
        grid_map = self._grid_map
        wish = clean_instruction(self._settings['instruction'])
        query = self._query(request, grid_map, wish)
        reply = _refusal(query) if isinstance(query, str) else self._ask(query)
        self._last = _exchange_report(reply, query, wish)
        self._exchange_publisher.publish(report_to_message(self._last, self.get_name(), stamp))
        if self._last.level == DiagnosticStatus.OK:
            self.get_logger().info(self._last.summary)
        else:
            self.get_logger().warning(self._last.summary)
        if grid_map is not None:
            points = grid_map.grid_to_world(reply.waypoints)
            response.plan = path_to_message(points, grid_map.frame_id, stamp)
        response.plan.header.stamp = stamp
        return response

    def _query(
        self, request: GetPlan.Request, grid_map: GridMap | None, wish: str
    ) -> WaypointQuery | str:
        """Read a request; a string says why it is none.

        GetPlan has no field for the time a caller waits: here `tolerance` holds it, in seconds.
        """
        if grid_map is None:
            return 'no map has arrived yet'
        try:
            start = _cell(request.start, 'start', grid_map)
            goal = _cell(request.goal, 'goal', grid_map)
        except GridMapError as error:
            return str(error)
        limit = self._settings['timeout_s']
        if request.tolerance > 0.0:
            limit = min(limit, request.tolerance)
        return WaypointQuery(Costmap(grid_map), start, goal, limit, instruction=wish)

    def _ask(self, query: WaypointQuery) -> WaypointReply:
        reply, _ = query_source(self._source, query)
        finite = tuple(point for point in reply.waypoints if all(map(math.isfinite, point)))
        return replace(reply, waypoints=finite)

    def _publish_health(self) -> None:
        """Publish the state of the node: at 1 Hz, and whenever a map comes."""
        client = client_of(self._source)
        values = {
            'source': self._source.name,
            'endpoint': client.problem() or '' if client else None,
            'map_digest': self._grid_map.digest if self._grid_map else None,
            'last_status': self._last.status if self._last else None,
            'last_detail': self._last.detail if self._last else None,
            'instruction': self._settings['instruction'],
            **(client.budget.values() if client else {}),
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


def _exchange_report(
    reply: WaypointReply, query: WaypointQuery | str, wish: str
) -> ExchangeReport:
    key = SampleKey('', '') if isinstance(query, str) else query.live_key
    return ExchangeReport(
        label=reply.label,
        status=reply.status.value,
        detail=reply.detail,
        model=reply.model,
        prompt=reply.prompt,
        text=reply.text[:MAX_TEXT],
        messages=tuple((message.role, message.content[:MAX_TEXT]) for message in reply.messages),
        unit=reply.unit,
        prompt_tokens=reply.prompt_tokens,
        completion_tokens=reply.completion_tokens,
        seconds=reply.seconds,
        waypoints=reply.waypoints,
        map_digest=str(key.map),
        pair=str(key.pair),
        instruction=wish,
        instruction_outcome=reply.instruction,
    )


def _make_source(values: dict[str, Any]) -> WaypointSource:
    """Make the source the parameters name. Raises ValueError or OSError where it cannot be."""
    transcript, dataset = (
        str(find_file(values[name], 'maps')) if values[name] else ''
        for name in ('transcript', 'dataset')
    )
    settings = source_config(values | {'transcript': transcript})
    maps = load_barrier_maps(dataset) if dataset else None
    return make_source(settings, dataset=maps)


def main(args: Sequence[str] | None = None) -> int:
    """Run llm_client_node."""
    return run_node(LlmClientNode, args, lambda: MultiThreadedExecutor(num_threads=THREADS))


if __name__ == '__main__':
    raise SystemExit(main())
