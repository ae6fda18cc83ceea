# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What `llm-astar plan --png` and `places --png` draw."""

from llm_astar_msgs_adapter.maps.barrier_map import Point
from llm_astar_msgs_adapter.maps.grid_map import GridMap
from llm_astar_msgs_adapter.maps.places import Places
from llm_astar_planner.instructions.route import Route
from llm_astar_planner.planning.types import Plan

from llm_astar_lab.pictures.figures import picture_of, save_picture, write_figure
from llm_astar_lab.pictures.places import places_figure


def draw_plan(plan: Plan, route: Route, offset: Point, path: str) -> None:
    """Draw a plan with places and instruction. Raises OSError, and ValueError for the name."""
    save_picture(picture_of(plan, route.costmap, offset, route), path)


def draw_places(places: Places, grid_map: GridMap | None, path: str) -> None:
    """Draw places into a picture. Raises OSError and ValueError for its name."""
    write_figure(places_figure(places, grid_map), path)
