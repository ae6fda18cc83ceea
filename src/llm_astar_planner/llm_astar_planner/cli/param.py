# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""List, read and set the parameters of running nodes.

examples:
  llm-astar param list                                        all nodes, with their values
  llm-astar param get planner_node robot_radius
  llm-astar param set planner_node robot_radius 0.3           until the node ends
  llm-astar param set planner_node instruction "avoid the kitchen"

For values that stay, see --params-file and -p of llm-astar run and of the nodes. The --help of a
node says what its parameters are.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from llm_astar_planner.cli.flags import add_time_limit, option
from llm_astar_planner.parameter import ParameterError

if TYPE_CHECKING:
    from llm_astar_planner.nodes.tools.parameter_client import ParameterClient

# The positional arguments that each action takes: at least, at most.
COUNTS = {'list': (0, 1), 'get': (2, 2), 'set': (3, 3)}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument('action', choices=COUNTS, metavar='{list,get,set}')
    option(parser, 'words', 'see the examples', nargs='*', metavar='NODE NAME VALUE')
    option(parser, '--namespace NAME', "the node's namespace (default: /)", default='/')
    add_time_limit(parser, 10.0)
    option(parser, '--json', 'print one JSON value')


def run(arguments: argparse.Namespace) -> int:
    """Do it; return 0. Raises ParameterError, RemoteParameterError, NodeNameError."""
    action, words = arguments.action, arguments.words
    least, most = COUNTS[action]
    if not least <= len(words) <= most:
        names = ('NODE', 'NAME', 'VALUE')
        usage = ' '.join([*names[:least], *(f'[{name}]' for name in names[least:most])])
        raise ParameterError(
            f'param {action} {usage} is expected, not {" ".join(words) or "none"}'
        )
    from llm_astar_planner.nodes.tools.parameter_client import parameter_client  # noqa: PLC0415

    with parameter_client(arguments.namespace, words[:1], arguments.time_limit) as client:
        answer, text = ACTIONS[action](client, *words)
    print(json.dumps(answer) if arguments.json else text)
    return 0


def list_all(client: ParameterClient, *nodes: str) -> tuple[Any, str]:
    """Return the values of the parameters of a node, or of all nodes, and their text."""
    found = {node: client.parameters(node) for node in nodes or client.nodes()}
    if not found:
        raise ParameterError('no node is running; start some with llm-astar run')
    lines, values = [], {}
    for node, parameters in found.items():
        lines += [node, *(f'  {name:<32} {shown(one.value)}' for name, one in parameters.items())]
        values[node] = {name: plain(one.value) for name, one in parameters.items()}
    return values, '\n'.join(lines)


def get(client: ParameterClient, node: str, name: str) -> tuple[Any, str]:
    """Return the value of a parameter."""
    value = plain(client.parameter(node, name).value)
    return value, shown(value)


def set_value(client: ParameterClient, node: str, name: str, text: str) -> tuple[Any, str]:
    """Set a parameter; return its new value."""
    before, after = client.set(node, name, text)
    return plain(after), f'{name}: {shown(plain(after))} (was {shown(plain(before))})'


Action = Callable[..., tuple[Any, str]]
ACTIONS: dict[str, Action] = {'list': list_all, 'get': get, 'set': set_value}


def plain(value: Any) -> Any:  # noqa: ANN401 - of the parameter's type
    """Return a parameter's value as JSON has it: lists instead of arrays and bytes."""
    return value if value is None or isinstance(value, bool | int | float | str) else list(value)


def shown(value: Any) -> str:  # noqa: ANN401 - of the parameter's type
    """Return a value as YAML and `-p` take it; a text as it is, unless it moves the cursor."""
    if isinstance(value, str) and value.isprintable():
        return value or "''"
    return json.dumps(plain(value))
