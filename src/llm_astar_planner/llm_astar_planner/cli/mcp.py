# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

r"""Serve route planning to agents over MCP, the Model Context Protocol.

The server speaks on standard input and output. Its tools are list_places, interpret, plan_route,
ask_why and check_path, on a map file with its places, or on what a running planner_node plans
with. It needs the official SDK: pip install 'mcp>=2'.

usage: llm-astar mcp [--map FILE [--places FILE] | --graph [--namespace NAME]] [options]

examples:
  llm-astar mcp --map depot.yaml --places depot.places.geojson --robot-radius 0.3
  llm-astar mcp --map depot.yaml --source endpoint --base-url http://localhost:11434/v1 \
    --model qwen2.5:7b
  llm-astar mcp --graph --namespace /robot1

With --graph the map, the places and the parameters are those of the planner at that moment, and
the graph understands the instructions. The robot's own plans and instruction stay as they are.
"""

from __future__ import annotations

import argparse
import threading
from typing import TYPE_CHECKING

from llm_astar_planner.cli import map_files, planning_options
from llm_astar_planner.cli.flags import add_graph_options, option
from llm_astar_planner.cli.route_tools import RouteTools
from llm_astar_planner.planning.compile import compile_kernels
from llm_astar_planner.planning.parameters import costmap_config
from llm_astar_planner.planning.planner import Planner
from llm_astar_planner.waypoints.config import SourceSettings

if TYPE_CHECKING:
    from llm_astar_planner.nodes.tools.planner_client import PlannerCaller

# The longest wait for an answer of the graph; a small model takes long to understand.
GRAPH_SECONDS = 60.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    where = parser.add_argument_group('on a map file')
    map_files.add_map_options(where, default='demo.json')
    map_files.add_places_option(where)
    graph = parser.add_argument_group('on a running graph')
    option(graph, '--graph', 'use what a running planner has')
    add_graph_options(graph)
    planning_options.add_planning_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Serve until the client closes standard input; return 0. Raises what reading files raises."""
    # An optional dependency; the help needs to work without it.
    from llm_astar_planner.cli.mcp_server import make_server  # noqa: PLC0415

    compile_kernels()
    if not arguments.graph:
        tools = tools_of_files(arguments)
        make_server(lambda: tools).run('stdio')
        return 0
    from llm_astar_planner.nodes.tools.planner_client import calling  # noqa: PLC0415

    with calling(arguments.namespace, arguments.node, GRAPH_SECONDS) as caller:
        make_server(GraphTools(caller).current).run('stdio')
    return 0


def tools_of_files(arguments: argparse.Namespace) -> RouteTools:
    """Return the tools on a map file with its places. Raises what reading them raises."""
    problem = map_files.open_maps(arguments, 0)[1]
    options = planning_options.read_planning_options(arguments, problem)
    places = map_files.open_places(options.values['places_file'], arguments.map)
    planner = options.make_planner(problem)
    map_files.warn_of_places(places, planner.grid_map)
    return RouteTools(planner.prepare(), places, options.make_interpreter(), options)


class GraphTools:
    """Makes route tools on what a running planner has; they are made again when that changes."""

    def __init__(self, caller: PlannerCaller) -> None:
        """Take a caller of the planner."""
        self._caller = caller
        self._lock = threading.Lock()
        self._planner: Planner | None = None

    def current(self) -> RouteTools:
        """Return the tools. Raises PlannerClientError where the planner does not answer."""
        with self._lock:
            values = self._caller.values([item.name for item in planning_options.RULES])
            grid_map, config = self._caller.grid_map(), costmap_config(values)
            known = self._planner
            if known is None or (known.grid_map.digest, known.config) != (grid_map.digest, config):
                self._planner = known = Planner(grid_map, config).prepare()
        settings = SourceSettings(timeout_s=GRAPH_SECONDS)
        options = planning_options.PlanningOptions(values, settings)
        return RouteTools(known, self._caller.places(), self._caller, options)
