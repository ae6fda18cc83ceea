# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Draws a plan of a running graph: its map, its path, and the cells that were expanded for it."""

import argparse
from collections import deque
from contextlib import suppress

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.fields import grid_from_message, path_from_message, stamp_of
from llm_astar_msgs_adapter.messages.markers import expanded_from_message
from llm_astar_msgs_adapter.messages.report import PlanReport
from llm_astar_planner.nodes.common.entities import LATCHED, RELIABLE
from llm_astar_planner.nodes.tools import planner_client
from llm_astar_planner.nodes.tools.planner_client import PlannerClient, PlannerClientError
from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.planning.types import describe_expansions
from nav_msgs.msg import GridCells, OccupancyGrid, Path

from llm_astar_lab.pictures.figures import Picture, describe_guidance, save_picture

# Longest wait for the expanded cells of a plan, which are published after it.
EXPANDED_SECONDS = 1.0
Ends = tuple[Pose2D, Pose2D]


class PlanView:
    """Collects the newest map of a graph and the expanded cells of a planner's plans."""

    def __init__(self, client: PlannerClient, planner: str, map_topic: str = 'map') -> None:
        """Subscribe; names are relative to the client's namespace."""
        self._client = client
        self._map_topic = map_topic
        self._maps: deque[OccupancyGrid] = deque(maxlen=1)
        self._expanded: dict[int, GridCells] = {}
        client.listen(OccupancyGrid, map_topic, self._maps.append, LATCHED)
        client.listen(GridCells, f'{planner}/explored', self._on_expanded, RELIABLE)

    def _on_expanded(self, message: GridCells) -> None:
        # Of the newest plan alone.
        self._expanded = {stamp_of(message): message}

    def grid_map(self, seconds: float) -> GridMap:
        """Return the newest map. Raises PlannerClientError if none comes within `seconds`."""
        self._client.wait_for(lambda: bool(self._maps), f'a map on {self._map_topic}', seconds)
        return grid_from_message(self._maps[-1])

    def picture(
        self, grid_map: GridMap, endpoints: Ends, path: Path, report: PlanReport
    ) -> Picture:
        """Return the picture of a plan; without expanded cells if none have arrived.

        Start and goal are in metres, in the map's frame.
        """
        start, goal = (grid_map.world_to_cell(place.x, place.y) for place in endpoints)
        points = grid_map.world_to_grid([(x, y) for x, y, _ in report.waypoints]).tolist()
        cells = self._expanded.get(stamp_of(path))
        expanded = np.zeros(grid_map.cells.shape, dtype=np.bool_)
        if cells is not None:
            expanded = expanded_from_message(cells, grid_map)
        length = 'no path' if report.length is None else f'{report.length:.2f} m'
        outcome = f'{length}, {describe_expansions(report.operation)}'
        title = f'{describe_guidance(report.method, report.guided_by)}: {outcome}'
        steps = np.rint(grid_map.world_to_grid(path_from_message(path))).astype(np.int32)
        waypoints = [(x, y, status) for (x, y), (_, _, status) in zip(points, report.waypoints)]
        return Picture(grid_map, start, goal, steps, expanded, waypoints, title)

    def draw(
        self, plan: planner_client.CalledPlan, endpoints: Ends, arguments: argparse.Namespace
    ) -> None:
        """Draw a plan that was called for on the map of the graph, by the options of `call`.

        Raises PlannerClientError without a map, ParameterError for endpoints in another frame.
        """
        grid_map = self.grid_map(arguments.time_limit)
        if plan.points:
            endpoints = Pose2D(*plan.points[0]), Pose2D(*plan.points[-1])
        elif arguments.frame not in ('', grid_map.frame_id):
            ends = f'start and goal in frame {arguments.frame!r}'
            what = f'{ends} cannot be drawn on a map in {grid_map.frame_id!r}'
            raise ParameterError(f'--png: without a path, {what}')
        stamp = stamp_of(plan.path)
        # They are published only once the planner has discovered a subscriber.
        with suppress(PlannerClientError):
            what = 'the expanded cells'
            self._client.wait_for(lambda: stamp in self._expanded, what, EXPANDED_SECONDS)
        save_picture(self.picture(grid_map, endpoints, plan.path, plan.report), arguments.png)
