"""`llm-astar demo`: the whole graph at work, as three processes and a caller."""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

from llm_astar_msgs_adapter.maps.barrier_map import load_barrier_maps
from llm_astar_msgs_adapter.maps.grid_map import Pose2D

from llm_astar_planner.costmap.config import CostmapConfig
from llm_astar_planner.nodes import MODULES
from llm_astar_planner.resources import find_file

Ends = tuple[Pose2D, Pose2D]
NODES = ('map_node', 'llm_client_node', 'planner_node')
# A domain of its own, so that the demo never meets a robot's graph: 101 to 230.
FIRST_DOMAIN, DOMAINS = 101, 130
STOP_SECONDS = 10.0


def add_parser(commands: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the command to `llm-astar`."""
    parser = commands.add_parser(
        'demo',
        description='Start map_node, llm_client_node and planner_node as processes, call the '
        "planner's GetPlan as another stack would, print the plan and what guided it, draw it, "
        'and stop everything. The waypoints come from the embedded model, which is learned and '
        'no LLM: no key, no network.',
    )
    parser.set_defaults(run=run)
    parser.add_argument(
        '--png', default='out/demo.png', metavar='FILE', help='picture (default: %(default)s)'
    )
    parser.add_argument(
        '--pair', type=int, default=0, choices=range(4), help='which pair of the demo map'
    )
    parser.add_argument(
        '--map', metavar='FILE', help='another map: a map_server yaml or barrier maps (with ends)'
    )
    metres: dict[str, Any] = {'type': float, 'nargs': 2, 'metavar': ('X', 'Y')}
    parser.add_argument('--start', **metres, help='in metres, in the frame of the map')
    parser.add_argument('--goal', **metres, help='likewise')
    parser.add_argument(
        '--robot-radius', type=float, default=0.0, metavar='METRES', help='(default: %(default)s)'
    )
    parser.add_argument('--verbose', action='store_true', help='show what the nodes log')


def run(arguments: argparse.Namespace) -> int:
    """Run the demo; return 0 where a plan came, else 1. Raises ValueError on bad input."""
    map_file, ends = _question(arguments)
    CostmapConfig(robot_radius=arguments.robot_radius)  # which says what is wrong with it
    os.environ['ROS_DOMAIN_ID'] = str(FIRST_DOMAIN + os.getpid() % DOMAINS)
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    from llm_astar_planner.nodes.tools.demo_client import call_and_draw  # noqa: PLC0415

    with (
        tempfile.TemporaryFile('w+') as log,
        _graph(
            # The paper's rules are for its maps; others are planned on as a robot would.
            'planner.yaml' if arguments.map else 'demo.yaml',
            {'map_file': map_file, 'robot_radius': arguments.robot_radius},
            None if arguments.verbose else log,
        ),
    ):
        print(f'started {", ".join(NODES)} on domain {os.environ["ROS_DOMAIN_ID"]}', flush=True)
        came = call_and_draw(ends, Path(arguments.png))
        if not came:
            log.seek(0)
            sys.stderr.write(log.read())
    print('stopped the nodes')
    return 0 if came else 1


def _question(arguments: argparse.Namespace) -> tuple[str, Ends]:
    """Return the map file, and start and goal in metres: a pair of the demo map by default."""
    if arguments.map is None and arguments.start is None and arguments.goal is None:
        map_file = find_file('demo.json', 'maps')
        sample = load_barrier_maps(map_file)[0].samples[arguments.pair]
        return str(map_file), (Pose2D(*sample.start), Pose2D(*sample.goal))
    if arguments.start is None or arguments.goal is None:
        raise ValueError('--start and --goal go together, and --map needs both')
    map_file = find_file(arguments.map or 'demo.json', 'maps')
    return str(map_file), (Pose2D(*arguments.start), Pose2D(*arguments.goal))


@contextlib.contextmanager
def _graph(parameters: str, settings: dict[str, object], log: IO[str] | None) -> Iterator[None]:
    """Start the nodes, and stop them as Ctrl-C would. Settings go beside the file's."""
    overrides = [part for name, value in settings.items() for part in ('-p', f'{name}:={value}')]
    parameters = str(find_file(parameters, 'config'))
    nodes = [
        subprocess.Popen(  # noqa: S603 - our own modules, no shell
            [
                sys.executable,
                '-m',
                f'llm_astar_planner.nodes.{MODULES[name]}',
                '--ros-args',
                '--params-file',
                parameters,
                *overrides,
            ],
            stdout=log,
            stderr=subprocess.STDOUT if log else None,
        )
        for name in NODES
    ]
    try:
        yield
    finally:
        for node in nodes:
            node.terminate()
        for name, node in zip(NODES, nodes):
            try:
                code = node.wait(STOP_SECONDS)
            except subprocess.TimeoutExpired:
                node.kill()
                code = node.wait()
            # Ended before it could see to the signal: stopped all the same.
            if code not in (0, -signal.SIGTERM):
                sys.stderr.write(f'{name} ended with exit code {code}\n')
