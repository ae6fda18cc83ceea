# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Run map_node, llm_client_node and planner_node until Ctrl-C.

What `ros2 launch llm_astar_planner planner.launch.py` does, without ROS 2's launch.

examples:
  llm-astar run                                             the demo map
  llm-astar run --map depot.yaml --places depot.places.geojson -p robot_radius:=0.3
  llm-astar run --no-map --params-file config/llm_ollama.yaml    your stack's /map

Then, in another terminal: llm-astar call --start X Y --goal X Y, or watch, param, record.

exit codes: 1 a node has ended by itself, 2 bad usage, 130 Ctrl-C
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from llm_astar_msgs_adapter.maps.places import places_beside

from llm_astar_planner.cli.flags import option
from llm_astar_planner.cli.map_files import PLACES_FILE, add_places_option
from llm_astar_planner.nodes.common.process import PARENT_VARIABLE, handling
from llm_astar_planner.parameter import ParameterError, Scalar
from llm_astar_planner.planning.parameters import NODES, check_names, read_parameter_files
from llm_astar_planner.resources import find_file

POLL_SECONDS = 0.2
STOP_SECONDS = 10.0
# What ends a command but would not let it stop its nodes.
ENDING = (signal.SIGTERM, signal.SIGHUP)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    maps = parser.add_mutually_exclusive_group()
    text = 'a map_server yaml or barrier maps (default: %(default)s)'
    option(maps, '--map FILE', text, default='demo.json')
    option(maps, '--no-map', "start no map_node: another node publishes 'map'")
    option(parser, '--map-id ID', 'which of the barrier maps (default: 0)', default=0)
    add_places_option(parser)
    text = "the nodes' parameter file, a path or a name in config/; may be given again"
    option(parser, '--params-file FILE', text, action='append', default=[])
    text = 'a parameter of the nodes, over those of the files; may be given again'
    option(parser, '-p --param NAME:=VALUE', text, action='append', default=[])
    option(parser, '--namespace NAME', 'of all nodes (default: none)')
    option(parser, '--log-level NAME', 'of all nodes (default: info)', default='info')


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
    in_files = read_parameter_files(files, tuple(NODES))['planner_node']
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
    places = places_setting(arguments, in_files)
    nodes = {
        'llm_client_node': [*common, *settings],
        'planner_node': [*common, *places, *settings],
    }
    if arguments.no_map:
        return nodes
    which = {'map_file': find_file(arguments.map, 'maps'), 'map_id': arguments.map_id}
    chosen = [word for name, value in which.items() for word in ('-p', f'{name}:={value}')]
    return {'map_node': [*common, *chosen, *settings], **nodes}


def places_setting(arguments: argparse.Namespace, in_files: Mapping[str, Scalar]) -> list[str]:
    """Return the words that name the places of planner_node: by `--places`, else beside the map.

    None where the parameter files name them, or nothing does. Raises FileNotFoundError.
    """
    name = PLACES_FILE.name
    if arguments.places_file:
        found: Path | None = find_file(arguments.places_file, 'maps')
    elif arguments.no_map or in_files.get(name):
        return []
    else:
        found = places_beside(find_file(arguments.map, 'maps'))
    return [] if found is None else ['-p', f'{name}:={found.resolve()}']


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


@contextlib.contextmanager
def running_nodes(
    arguments: Mapping[str, Sequence[str]],
) -> Iterator[dict[str, subprocess.Popen[bytes]]]:
    """Start the named nodes, each with its arguments; stop them in the end, SIGTERM included.

    The kernel stops them should this process be killed.
    """
    nodes: dict[str, subprocess.Popen[bytes]] = {}
    with ended_by_signals():
        try:
            for name, words in arguments.items():
                nodes[name] = start_node(name, words)
            yield nodes
        finally:
            stop_nodes(nodes)


def start_node(name: str, words: Sequence[str]) -> subprocess.Popen[bytes]:
    """Start a node in a session of its own, so that Ctrl-C is left to this process."""
    return subprocess.Popen(  # noqa: S603 - our own modules, no shell
        [sys.executable, '-m', 'llm_astar_planner.nodes', name, *words],
        stdin=subprocess.DEVNULL,
        env={**os.environ, PARENT_VARIABLE: str(os.getpid())},
        start_new_session=True,
    )


def stop_nodes(nodes: Mapping[str, subprocess.Popen[bytes]]) -> None:
    """Stop all nodes; say which had to be killed or had failed."""
    for node in nodes.values():
        node.terminate()
    for name, node in nodes.items():
        try:
            code = node.wait(STOP_SECONDS)
        except subprocess.TimeoutExpired:
            node.kill()
            code = node.wait()
        # A node that has no signal handler yet is ended by the signal itself.
        if code not in (0, -signal.SIGTERM):
            sys.stderr.write(f'{name} ended with exit code {code}\n')


@contextlib.contextmanager
def ended_by_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise SystemExit with the exit code of a process that they ended.

    One that is ignored, as under nohup, stays so.
    """

    def end(number: int, _: object) -> None:
        signal.signal(number, signal.SIG_DFL)
        raise SystemExit(128 + number)

    heeded = [number for number in ENDING if signal.getsignal(number) is not signal.SIG_IGN]
    with handling(heeded, end):
        yield
