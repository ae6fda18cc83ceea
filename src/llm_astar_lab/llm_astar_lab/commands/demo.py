# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Run the whole graph for one plan: three nodes and a client.

Start map_node, llm_client_node and planner_node as processes, call the planner's GetPlan as
another stack would, print and draw the plan, and stop everything. The waypoints come from the
embedded learned model, which is not an LLM and needs no key and no network.

examples:
  llm-astar demo
  llm-astar demo --pair 2 --png out/pair2.png
  llm-astar demo --map depot.yaml --start 0.4 -0.3 --goal 15.4 2.2 --robot-radius 0.2

exit codes: 0 a path, 1 no path, 2 bad usage or input
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_msgs_adapter.maps.grid_map import Pose2D
from llm_astar_planner.cli import flags
from llm_astar_planner.cli.run import running_nodes
from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.planning.parameters import COSTMAP
from llm_astar_planner.resources import find_file

NODES = ('map_node', 'llm_client_node', 'planner_node')
# ROS domains 101 to 230, so that the demo never joins a robot's graph.
FIRST_DOMAIN, DOMAINS = 101, 130
RADIUS = flags.named(COSTMAP, 'robot_radius')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    flags.add_picture_option(parser, 'draw the plan', 'out/demo.png')
    text = 'which start-goal pair of the demo map (default: 0)'
    flags.option(parser, '--pair', text, default=0, choices=range(4))
    text = 'another map, a map_server yaml or barrier maps; it needs --start and --goal'
    flags.option(parser, '--map FILE', text)
    text = 'start here, in metres of the map; a cell of barrier maps is one metre wide'
    flags.option(parser, '--start', text, **flags.POINT)
    flags.option(parser, '--goal', 'go here, in the same unit', **flags.POINT)
    flags.add_parameter_flags(parser, RADIUS)
    flags.option(parser, '--verbose', 'show the log of the nodes')


def run(arguments: argparse.Namespace) -> int:
    """Run the demo; return 0 if there was a path, else 1. Raises ParameterError on bad input."""
    map_file, endpoints = choose_endpoints(arguments)
    settings = {'map_file': map_file, **flags.given_values(arguments, RADIUS)}
    os.environ['ROS_DOMAIN_ID'] = str(FIRST_DOMAIN + os.getpid() % DOMAINS)
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    # The paper's rules are for its own maps; other maps get a robot's.
    params_file = find_file('planner.yaml' if arguments.map else 'demo.yaml', 'config')
    overrides = [part for name, value in settings.items() for part in ('-p', f'{name}:={value}')]
    options = ['--ros-args', '--params-file', str(params_file), *overrides]
    with (
        tempfile.TemporaryFile('w+') as log,
        running_nodes(dict.fromkeys(NODES, options), None if arguments.verbose else log),
    ):
        print(f'started {", ".join(NODES)} on domain {os.environ["ROS_DOMAIN_ID"]}', flush=True)
        # It takes a second, in which the nodes start too.
        from llm_astar_lab.nodes.plan_view import call_and_draw  # noqa: PLC0415

        has_path = call_and_draw(endpoints, Path(arguments.png))
        if not has_path:
            log.seek(0)
            sys.stderr.write(log.read())
    print('stopped the nodes')
    return 0 if has_path else 1


def choose_endpoints(arguments: argparse.Namespace) -> tuple[str, tuple[Pose2D, Pose2D]]:
    """Return the map file, and start and goal in metres: a pair of the demo map by default.

    Raises ParameterError where only one of start and goal is given.
    """
    map_file = find_file(arguments.map or 'demo.json', 'maps')
    start, goal = arguments.start, arguments.goal
    if arguments.map is None and start is None and goal is None:
        start, goal, _ = load_barrier_maps(map_file)[0].samples[arguments.pair]
    if start is None or goal is None:
        raise ParameterError('--start and --goal go together, and --map needs both')
    return str(map_file), (Pose2D(*start), Pose2D(*goal))
