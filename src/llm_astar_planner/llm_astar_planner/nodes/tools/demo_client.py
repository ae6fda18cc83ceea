"""The client of the demo: asks the running graph for a plan, prints it and draws it."""

from __future__ import annotations

import sys
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np
from llm_astar_msgs_adapter.maps.grid_map import GridMap, Pose2D
from llm_astar_msgs_adapter.messages.fields import grid_from_message, path_from_message, stamp_of
from llm_astar_msgs_adapter.messages.markers import expanded_from_message
from llm_astar_msgs_adapter.messages.report import PlanReport
from nav_msgs.msg import GridCells, OccupancyGrid
from nav_msgs.msg import Path as PathMessage

from llm_astar_planner.nodes.common.qos import LATCHED, RELIABLE
from llm_astar_planner.nodes.common.spin import joined
from llm_astar_planner.nodes.tools.planner_client import (
    DISCOVERY_SECONDS,
    PlannerClient,
    PlannerClientError,
)
from llm_astar_planner.visualization.figures import Picture, describe_guidance, save_picture

# Expanded cells are published only once the planner has discovered a subscriber, so the demo
# asks again until they arrive.
ATTEMPTS = 10


def call_and_draw(endpoints: tuple[Pose2D, Pose2D], picture: Path) -> bool:
    """Ask for a plan from start to goal, print and draw it; return whether there is a path."""
    try:
        with joined('demo_caller') as node, PlannerClient(node) as client:
            return run_demo(client, *endpoints, picture)
    except PlannerClientError as error:
        sys.stderr.write(f'llm-astar: error: {error}\n')
        return False


def run_demo(client: PlannerClient, start: Pose2D, goal: Pose2D, picture: Path) -> bool:
    """Ask for a plan, print and draw it; return whether there is a path.

    Raises PlannerClientError if the graph does not respond.
    """
    maps: list[OccupancyGrid] = []
    expanded: dict[int, GridCells] = {}
    client.listen(OccupancyGrid, 'map', maps.append, LATCHED)
    client.listen(
        GridCells,
        'planner_node/explored',
        lambda message: expanded.update({stamp_of(message): message}),
        RELIABLE,
    )
    client.wait_for(lambda: bool(maps), 'a map', DISCOVERY_SECONDS)
    grid_map = grid_from_message(maps[-1])
    client.wait_until_ready(grid_map.digest, client='llm_client_node')
    for _ in range(ATTEMPTS):
        path, report, seconds = client.call(start, goal)
        with suppress(PlannerClientError):
            has_arrived = partial(expanded.__contains__, stamp_of(path))
            client.wait_for(has_arrived, 'the expanded cells', 1.0)
            break
    print_plan((start, goal), report, len(path.poses), seconds)
    cells = expanded.get(stamp_of(path))
    save_picture(picture_of_plan(grid_map, (start, goal), path, cells, report), picture)
    print(f'picture    {picture}')
    return report.code == 0


def print_plan(
    endpoints: tuple[Pose2D, Pose2D], report: PlanReport, poses: int, seconds: float
) -> None:
    """Print what the planner reported, what was asked, and how long it took."""
    print(report.summary)
    for warning in report.warnings:
        print(f'warning    {warning}')
    print('asked      planner_node/get_plan, as another stack would')
    for name, place in zip(('start', 'goal'), endpoints):
        print(f'{name:<10} ({place.x:g}, {place.y:g}) m')
    print(f'waypoints  {report.waypoint_summary}')
    for number, (x, y, status) in enumerate(report.waypoints, start=1):
        print(f'waypoint {number} ({x:g}, {y:g}) m: {status.replace("_", " ")}')
    if report.length is not None:
        print(f'length     {report.length:.2f} m, {poses} poses')
    print(f'expansions {report.operation}, {report.storage} states stored')
    print(
        f'time       {1000 * seconds:.1f} ms round trip, {1000 * report.seconds_source:.1f} ms of '
        f'it for waypoints, {1000 * report.seconds_search:.2f} ms to search'
    )


def picture_of_plan(
    grid_map: GridMap,
    endpoints: tuple[Pose2D, Pose2D],
    path: PathMessage,
    expanded: GridCells | None,
    report: PlanReport,
) -> Picture:
    """Return the picture of a plan; without expanded cells if None arrived."""
    start, goal = (grid_map.world_to_cell(place.x, place.y) for place in endpoints)
    places = grid_map.world_to_grid([(x, y) for x, y, _ in report.waypoints]).tolist()
    return Picture(
        grid_map,
        start,
        goal,
        np.rint(grid_map.world_to_grid(path_from_message(path))).astype(np.int32),
        np.zeros(grid_map.cells.shape, dtype=np.bool_)
        if expanded is None
        else expanded_from_message(expanded, grid_map),
        [(x, y, status) for (x, y), (_, _, status) in zip(places, report.waypoints)],
        f'{describe_guidance(report.method, report.guided_by)}: {report.operation} expansions',
    )
