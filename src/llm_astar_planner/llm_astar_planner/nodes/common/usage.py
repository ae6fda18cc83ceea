# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What `--help` prints for the nodes that have parameters."""

from __future__ import annotations

import json
import shutil
import textwrap

from llm_astar_planner.parameter import Parameter
from llm_astar_planner.planning.parameters import NODES, SET_BY_PLANNER

ABOUT = {
    'map_node': 'Publishes a barrier map or a map_server map as an occupancy grid.',
    'llm_client_node': 'Serves waypoints of a model, or of another source, to planner_node.',
    'planner_node': 'Plans on the newest map, for services, actions and the buttons of RViz.',
}
USAGE = """\
usage: {name} [-h] [--ros-args [-p NAME:=VALUE]... [--params-file FILE]...
       [-r __ns:=/NAMESPACE] [-r FROM:=TO]... [--log-level LEVEL]]

{about}

example: {name} --ros-args -p {example}

parameters:
"""
EXAMPLES = {
    'map_node': 'map_file:=depot.yaml',
    'llm_client_node': 'source:=coarse',
    'planner_node': 'robot_radius:=0.3',
}
REFERENCE = """
docs/reference.md has the whole sentences, topics and services; config/planner.yaml is a parameter
file with every default. Of a running node: llm-astar param list {name}.
"""
WIDEST, SHORTEST = 120, 30


def usage(name: str) -> str:
    """Return the help of a node: how it is started, and a line for each parameter."""
    width = min(shutil.get_terminal_size().columns, WIDEST)
    hidden = SET_BY_PLANNER if name == 'llm_client_node' else ()
    lines = [line_of(item, width) for item in NODES[name] if item.name not in hidden]
    head = USAGE.format(name=name, about=ABOUT[name], example=EXAMPLES[name])
    return head + '\n'.join(lines) + '\n' + REFERENCE.format(name=name)


def line_of(item: Parameter, width: int) -> str:
    """Return name, default, unit and the beginning of the sentence of a parameter."""
    unit = f' {item.unit}' if item.unit else ''
    head = f'  {item.name} ({json.dumps(item.default)}{unit})'.ljust(36)
    room = max(width - len(head) - 1, SHORTEST)
    return f'{head} {textwrap.shorten(item.sentence.replace("`", ""), room, placeholder=" ...")}'
