# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""map_node: publishes a barrier map or a map_server map as an occupancy grid, latched."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.maps.barrier_map import find_barrier_map, load_barrier_maps
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.map_server import load_map
from llm_astar_msgs_adapter.messages.writing import grid_to_message
from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import GetMap
from rclpy.node import Node

from llm_astar_planner.nodes.common.entities import LATCHED
from llm_astar_planner.nodes.common.parameters import OVERRIDES, Parameters
from llm_astar_planner.nodes.common.spin import run_node
from llm_astar_planner.parameter import problem_of
from llm_astar_planner.resources import find_file

NAME = 'map_node'


class MapNode(Node):
    """Publishes `map` and serves `~/map`; a changed parameter publishes the new map."""

    def __init__(self, **node_options: Any) -> None:  # noqa: ANN401 - rclpy's own
        """Load and publish the map. Raises ParameterError where it cannot be loaded."""
        super().__init__(NAME, **OVERRIDES, **node_options)
        self._publisher = self.create_publisher(OccupancyGrid, 'map', LATCHED)
        self._settings = Parameters(self, NAME, partial(problem_of, load_grid))
        self.add_post_set_parameters_callback(lambda _: self._publish())
        self.create_service(GetMap, '~/map', self._on_get_map)
        self._publish()

    def _publish(self) -> None:
        grid_map = load_grid(self._settings.values())
        self._message = grid_to_message(grid_map, self.get_clock().now().to_msg())
        self._publisher.publish(self._message)
        size = f'{grid_map.width} x {grid_map.height} cells of {grid_map.resolution} m'
        name = self._settings['map_file']
        if not is_yaml(name):
            name = f'{name} map {self._settings["map_id"]}'
        self.get_logger().info(f'published {name}: {size}, digest {grid_map.digest}')

    def _on_get_map(self, _: GetMap.Request, response: GetMap.Response) -> GetMap.Response:
        response.map = self._message
        return response


def load_grid(values: dict[str, Any]) -> GridMap:
    """Return the map that map_node's parameters name.

    Raises FileNotFoundError, BarrierMapError, GridMapError or MapServerError.
    """
    path = find_file(values['map_file'], 'maps')
    if is_yaml(path):
        return load_map(path, frame_id=values['frame_id'])
    barrier_map = find_barrier_map(load_barrier_maps(path), values['map_id'])
    return barrier_map.to_grid(values['resolution'], values['frame_id'])


def is_yaml(path: str | Path) -> bool:
    """Return whether a file is a map_server map, by its name."""
    return Path(path).suffix.lower() in ('.yaml', '.yml')


def main(args: Sequence[str] | None = None) -> int:
    """Run map_node."""
    return run_node(MapNode, args)
