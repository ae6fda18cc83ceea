"""Serve route planning to agents over MCP, the Model Context Protocol.

The server speaks on standard input and output. Its tools are list_places, interpret, plan_route
and check_path, on a map file with its places. It needs the official SDK: pip install 'mcp>=2'.
"""

from __future__ import annotations

import argparse

from llm_astar_planner.cli.map_files import (
    add_map_options,
    add_places_option,
    open_maps,
    open_places,
    warn_of_places,
)
from llm_astar_planner.cli.planning_options import add_planning_options, read_planning_options
from llm_astar_planner.cli.route_tools import RouteTools
from llm_astar_planner.search.paper import compile_kernels

EPILOG = """\
examples:
  llm-astar mcp --map depot.yaml --places depot.places.geojson --robot-radius 0.3
  llm-astar mcp --map depot.yaml --source endpoint --base-url http://localhost:11434/v1 \\
    --model qwen2.5:7b
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    where = parser.add_argument_group('where')
    add_map_options(where, default='demo.json')
    add_places_option(where)
    add_planning_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Serve until the client closes standard input; return 0. Raises what reading files raises."""
    # An optional dependency; the help needs to work without it.
    from llm_astar_planner.cli.mcp_server import make_server  # noqa: PLC0415

    problem = open_maps(arguments)[1]
    options = read_planning_options(arguments, problem)
    places = open_places(options.values['places_file'], arguments.map)
    planner = options.make_planner(problem)
    warn_of_places(places, planner.grid_map)
    compile_kernels()
    tools = RouteTools(planner.prepare(), places, options.make_interpreter(), options)
    make_server(tools).run('stdio')
    return 0
