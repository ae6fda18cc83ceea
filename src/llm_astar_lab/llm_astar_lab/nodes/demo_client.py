"""The client of the demo: asks the running graph for a plan, prints it and draws it."""

from __future__ import annotations

import sys
from pathlib import Path

from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_planner.nodes.common.spin import joined
from llm_astar_planner.nodes.tools.planner_client import (
    DISCOVERY_SECONDS,
    PlannerClient,
    PlannerClientError,
)
from llm_astar_planner.planning.types import report_lines

from llm_astar_lab.nodes.plan_view import PlanView
from llm_astar_lab.pictures.figures import save_picture

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
    view = PlanView(client, 'planner_node')
    grid_map = view.grid_map(DISCOVERY_SECONDS)
    client.wait_until_ready(grid_map.digest, client='llm_client_node')
    for _ in range(ATTEMPTS):
        path, report, seconds = client.call(start, goal)
        if view.has_expanded(path):
            break
    print(*report_lines(report, (start, goal), len(path.poses), seconds), sep='\n')
    save_picture(view.picture(grid_map, (start, goal), path, report), picture)
    print(f'picture    {picture}')
    return report.code == 0
