"""Run map_node, llm_client_node and planner_node until Ctrl-C.

What `ros2 launch llm_astar_planner planner.launch.py` does, without ROS 2's launch.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Mapping

from llm_astar_planner.cli.node_processes import running_nodes
from llm_astar_planner.parameter import ParameterError
from llm_astar_planner.planning.parameter_file import read_parameter_files
from llm_astar_planner.planning.parameters import NODES, check_names
from llm_astar_planner.resources import find_file

EPILOG = """\
examples:
  llm-astar run                                             the demo map
  llm-astar run --map depot.yaml -p robot_radius:=0.3
  llm-astar run --no-map --params-file config/llm_ollama.yaml    your stack's /map

Then, in another terminal: llm-astar call --start X Y --goal X Y, or watch, param, record.

exit codes: 1 a node has ended by itself, 2 bad usage, 130 Ctrl-C
"""
POLL_SECONDS = 0.2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    maps = parser.add_mutually_exclusive_group()
    maps.add_argument(
        '--map', default='demo.json', metavar='FILE',
        help='a map_server yaml or barrier maps (default: %(default)s)',
    )  # fmt: skip
    maps.add_argument(
        '--no-map', action='store_true', help="start no map_node: another node publishes 'map'"
    )
    parser.add_argument(
        '--map-id',
        type=int,
        default=0,
        metavar='ID',
        help='which of the barrier maps (default: 0)',
    )
    parser.add_argument(
        '--params-file', action='append', default=[], metavar='FILE',
        help="the nodes' parameter file, a path or a name in config/; may be given again",
    )  # fmt: skip
    parser.add_argument(
        '-p', '--param', action='append', default=[], metavar='NAME:=VALUE',
        help='a parameter of the nodes, over those of the files; may be given again',
    )  # fmt: skip
    parser.add_argument('--namespace', metavar='NAME', help='of all nodes (default: none)')
    parser.add_argument(
        '--log-level', default='info', metavar='NAME', help='of all nodes (default: info)'
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the nodes until one ends; return 1 then. Raises ParameterError on bad input."""
    nodes = node_arguments(arguments)
    with running_nodes(nodes) as processes:
        print(f'running {", ".join(nodes)}; Ctrl-C ends them', flush=True)
        ended = wait_for_end(processes)
        sys.stderr.write(f'llm-astar: error: {ended} has ended; stopping the others\n')
    return 1


def node_arguments(arguments: argparse.Namespace) -> dict[str, list[str]]:
    """Return the arguments of each node to start. Raises ParameterError, FileNotFoundError."""
    files = [str(find_file(name, 'config')) for name in arguments.params_file]
    read_parameter_files(files, tuple(NODES))
    for setting in arguments.param:
        name, sign, _ = setting.partition(':=')
        if not sign:
            raise ParameterError(f'-p {setting}: NAME:=VALUE is expected')
        check_names('planner_node', [name], shared=True)
    # As the launch file does, so that a robot in a namespace has its own transforms.
    common = ['--ros-args', '-r', '/tf:=tf', '-r', '/tf_static:=tf_static']
    common += ['--log-level', arguments.log_level]
    common += [word for file in files for word in ('--params-file', file)]
    if arguments.namespace:
        common += ['-r', f'__ns:=/{arguments.namespace.strip("/")}']
    settings = [word for setting in arguments.param for word in ('-p', setting)]
    nodes = {name: [*common, *settings] for name in ('llm_client_node', 'planner_node')}
    if arguments.no_map:
        return nodes
    which = {'map_file': find_file(arguments.map, 'maps'), 'map_id': arguments.map_id}
    chosen = [word for name, value in which.items() for word in ('-p', f'{name}:={value}')]
    return {'map_node': [*common, *chosen, *settings], **nodes}


def wait_for_end(processes: Mapping[str, subprocess.Popen[bytes]]) -> str:
    """Wait until a node ends without which no plans are made; return its name.

    Without llm_client_node plans go on.
    """
    needed = {name: node for name, node in processes.items() if name != 'llm_client_node'}
    while True:
        for name, node in needed.items():
            if node.poll() is not None:
                return name
        time.sleep(POLL_SECONDS)
