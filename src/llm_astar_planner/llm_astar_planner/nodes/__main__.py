# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Start a node: `planner_node`, or `python -m llm_astar_planner.nodes planner_node`.

What takes long is imported last: before that, Ctrl-C ends the process without a traceback,
`--help` needs no rclpy, and a missing rclpy is one line.
"""

import signal
import sys
from collections.abc import Sequence
from functools import partial

ADVICE = 'source ROS 2, or install its wheels with `make install`; `llm-astar doctor` says more'

ABOUT = {
    'map_node': 'Publishes a barrier map or a map_server map as an occupancy grid.',
    'llm_client_node': 'Serves waypoints of a model, or of another source, to planner_node.',
    'planner_node': 'Plans on the newest map, for services, actions and the buttons of RViz.',
}
EXAMPLES = {
    'map_node': 'map_file:=depot.yaml',
    'llm_client_node': 'source:=coarse',
    'planner_node': 'robot_radius:=0.3',
}


def main(name: str, argv: Sequence[str] | None = None) -> int:
    """Run a node with arguments, without a program's name before them; return its exit code."""
    # Until the node joins the graph there is nothing to clean up.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    argv = sys.argv[1:] if argv is None else list(argv)
    try:
        return start(name, argv)
    except ImportError as error:
        sys.stderr.write(f'{name}: error: {error}; {ADVICE}\n')
        return 1


def start(name: str, argv: Sequence[str]) -> int:
    """Print the help, or import the node and run it. Raises ImportError where that fails."""
    from importlib import import_module  # noqa: PLC0415

    from llm_astar_planner.nodes import LAB_NODES, MODULES  # noqa: PLC0415
    from llm_astar_planner.nodes.common.process import follow_parent  # noqa: PLC0415

    if name not in (*MODULES, *LAB_NODES):
        known = ', '.join((*MODULES, *LAB_NODES))
        sys.stderr.write(f'error: {name!r} is no node; there are {known}\n')
        return 2
    follow_parent()
    own = argv[: argv.index('--ros-args')] if '--ros-args' in argv else argv
    if name in MODULES and {'-h', '--help'} & set(own):
        sys.stdout.write(usage(name))
        return 0
    if name in MODULES:
        run = import_module(f'llm_astar_planner.nodes.{MODULES[name]}').main
    else:
        from llm_astar_planner.plugins import extensions, not_installed  # noqa: PLC0415

        entry = extensions('nodes').get(name)
        if entry is None:
            sys.stderr.write(f'error: {not_installed(f"{name} is a node")}\n')
            return 2
        run = entry.load()
    return int(run([name, *argv]))


def usage(name: str) -> str:
    """Return the help of a node: how it is started, and a line for each parameter."""
    import json  # noqa: PLC0415
    from pathlib import Path  # noqa: PLC0415

    from llm_astar_planner.planning.parameters import NODES, SET_BY_PLANNER  # noqa: PLC0415

    hidden = SET_BY_PLANNER if name == 'llm_client_node' else ()
    text = ''
    for item in NODES[name]:
        if item.name not in hidden:
            default = f'{json.dumps(item.default)} {item.unit}'.strip()
            text += f'  {item.name} ({default}): {item.sentence.replace("`", "")}\n'
    usage = Path(__file__).with_name('usage.txt').read_text(encoding='utf-8')
    facts = {'name': name, 'about': ABOUT[name], 'example': EXAMPLES[name]}
    return usage.format(parameters=text, **facts)


map_node = partial(main, 'map_node')
llm_client_node = partial(main, 'llm_client_node')
planner_node = partial(main, 'planner_node')
benchmark_node = partial(main, 'benchmark_node')

if __name__ == '__main__':
    raise SystemExit(main(''.join(sys.argv[1:2]), sys.argv[2:]))
