"""The demo's caller: asks the running graph for a plan, prints it and draws it."""

from __future__ import annotations

import sys
import threading
from pathlib import Path

import numpy as np
import rclpy
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.diagnostics import PlanReport
from llm_astar_msgs_adapter.messages.markers import expanded_from_message
from llm_astar_msgs_adapter.messages.occupancy_grid import grid_from_message
from llm_astar_msgs_adapter.messages.path import path_from_message
from nav_msgs.msg import GridCells, OccupancyGrid
from numpy.typing import NDArray
from rclpy.signals import SignalHandlerOptions

from llm_astar_planner.nodes.common.qos import LATCHED, RELIABLE
from llm_astar_planner.nodes.common.spin import leave
from llm_astar_planner.nodes.tools.planner_client import DISCOVERY_SECONDS, Caller, CallerError
from llm_astar_planner.search.result import Cell
from llm_astar_planner.visualization.figures import Picture, save_picture, steered

# The explored cells are drawn only while somebody is known to look: ask until they come.
ATTEMPTS = 10


class _Eyes:
    """What the demo sees of the graph beside its answer."""

    def __init__(self, caller: Caller) -> None:
        self.grid_map: GridMap | None = None
        self.explored: dict[tuple[int, int], GridCells] = {}
        self.arrived = threading.Condition()
        caller.node.create_subscription(OccupancyGrid, 'map', self._on_map, LATCHED)
        caller.node.create_subscription(
            GridCells, 'planner_node/explored', self._on_explored, RELIABLE
        )

    def _on_map(self, message: OccupancyGrid) -> None:
        with self.arrived:
            self.grid_map = grid_from_message(message)
            self.arrived.notify_all()

    def _on_explored(self, message: GridCells) -> None:
        with self.arrived:
            self.explored[message.header.stamp.sec, message.header.stamp.nanosec] = message
            self.arrived.notify_all()

    def wait_for_explored(self, stamp: tuple[int, int]) -> GridCells | None:
        """Return the explored cells of the plan of that stamp, if they come."""
        with self.arrived:
            self.arrived.wait_for(lambda: stamp in self.explored, 1.0)
            return self.explored.get(stamp)

    def wait_for_map(self) -> GridMap:
        """Return the map. Raises CallerError where none comes."""
        with self.arrived:
            self.arrived.wait_for(lambda: self.grid_map is not None, DISCOVERY_SECONDS)
        if self.grid_map is None:
            raise CallerError('no map came')
        return self.grid_map


def call_and_draw(ends: tuple[Pose2D, Pose2D], picture: Path) -> bool:
    """Ask for a plan from start to goal; print and draw it. Tell whether one came."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('demo_caller')
    try:
        with Caller(node) as caller:
            return _demo(caller, *ends, picture)
    except CallerError as error:
        sys.stderr.write(f'llm-astar: error: {error}\n')
        return False
    finally:
        leave(node)
        rclpy.try_shutdown()


def _demo(caller: Caller, start: Pose2D, goal: Pose2D, picture: Path) -> bool:
    eyes = _Eyes(caller)
    grid_map = eyes.wait_for_map()
    caller.wait_until_ready(grid_map.digest, client='llm_client_node')
    for _ in range(ATTEMPTS):
        path, report, seconds = caller.call(start, goal)
        stamp = (path.header.stamp.sec, path.header.stamp.nanosec)
        explored = eyes.wait_for_explored(stamp)
        if explored is not None:
            break
    _print((start, goal), report, len(path.poses), seconds)
    cells = np.rint(grid_map.world_to_grid(path_from_message(path))).astype(np.int32)
    blank = np.zeros(grid_map.cells.shape, dtype=np.bool_)
    expanded = blank if explored is None else expanded_from_message(explored, grid_map)
    ends = (grid_map.world_to_cell(start.x, start.y), grid_map.world_to_cell(goal.x, goal.y))
    save_picture(_picture(grid_map, ends, cells, expanded, report), picture)
    print(f'picture    {picture}')
    return report.code == 0


def _print(ends: tuple[Pose2D, Pose2D], report: PlanReport, poses: int, seconds: float) -> None:
    start, goal = (f'({place.x:g}, {place.y:g})' for place in ends)
    print(f'asked      planner_node/get_plan from {start} to {goal}')
    print(f'answer     {report.summary}')
    print(f'guided by  {report.guided_by} (source {report.source}, {report.source_status})')
    for number, (x, y, verdict) in enumerate(report.waypoints, start=1):
        print(f'waypoint {number} ({x:g}, {y:g}) {verdict.replace("_", " ")}')
    if report.length is not None:
        print(f'path       {report.length:.2f} m, {poses} poses')
    print(f'work       {report.operation} expansions, {report.storage} states stored')
    print(
        f'time       {1000 * seconds:.1f} ms round trip, {1000 * report.seconds_source:.1f} ms of '
        f'it for waypoints, {1000 * report.seconds_search:.2f} ms for the search'
    )


def _picture(
    grid_map: GridMap,
    ends: tuple[Cell, Cell],
    cells: NDArray[np.int32],
    expanded: NDArray[np.bool_],
    report: PlanReport,
) -> Picture:
    places = grid_map.world_to_grid([(x, y) for x, y, _ in report.waypoints]).tolist()
    waypoints = [(x, y, verdict) for (x, y), (_, _, verdict) in zip(places, report.waypoints)]
    title = f'{steered(report.method, report.guided_by)}: {report.operation} expansions'
    return Picture(grid_map, *ends, cells, expanded, waypoints, title)
