"""`llm-astar watch`: the plans of a running planner, line by line in the terminal."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading
import time
from typing import TYPE_CHECKING, Any

from llm_astar_planner.nodes.tools.monitor_lines import Kind, to_json, to_line

if TYPE_CHECKING:
    from llm_astar_planner.nodes.tools.monitor import Watcher

# How long nothing may be heard before the user is told what to look at.
SILENCE_SECONDS = 3.0
# A signal that falls between two waits wakes nobody up: no wait is longer.
LONGEST_WAIT = 0.5

EPILOG = """\
The last plans from before the watch began come first, ten at most. Ctrl-C ends it.

examples:
  llm-astar watch
  llm-astar watch --namespace /robot1
  llm-astar watch --json --count 1 | jq .length
"""


def add_parser(commands: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the command to `llm-astar`."""
    parser = commands.add_parser(
        'watch',
        description='Print a line for each plan of a running planner_node, each exchange of its '
        'llm_client_node with its source, and each change of their state.',
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(run=run)
    parser.add_argument('--namespace', default='/', help='where the nodes are (default: /)')
    parser.add_argument(
        '--node', default='planner_node', help='the planner (default: %(default)s)'
    )
    parser.add_argument(
        '--client', default='llm_client_node', help='its waypoint client (default: %(default)s)'
    )
    parser.add_argument('--count', type=int, metavar='N', help='end after N plans')
    parser.add_argument('--json', action='store_true', help='print one JSON object a line')


def run(arguments: argparse.Namespace) -> int:
    """Watch until Ctrl-C or so many plans; return 0. Raises ValueError on bad input."""
    if arguments.count is not None and arguments.count < 1:
        raise ValueError(f'--count {arguments.count} is not 1 or more')
    from llm_astar_planner.nodes.tools.monitor import watching  # noqa: PLC0415

    stopped = threading.Event()
    # No exception: raised while the node is made, it would leave half of one that aborts at exit.
    before = signal.signal(signal.SIGINT, lambda *_: stopped.set())
    try:
        with watching(arguments.namespace, arguments.node, arguments.client) as watcher:
            _follow(watcher, arguments, stopped)
    finally:
        signal.signal(signal.SIGINT, before)
    return 0


def _follow(watcher: Watcher, arguments: argparse.Namespace, stopped: threading.Event) -> None:
    """Print what is seen until there were enough plans, or the watch is stopped."""
    left = arguments.count
    colour = sys.stdout.isatty() and 'NO_COLOR' not in os.environ
    silent_at = time.monotonic() + SILENCE_SECONDS
    while not stopped.is_set() and (left is None or left > 0):
        seen = watcher.next(LONGEST_WAIT)
        if seen is not None:
            text = to_json(seen) if arguments.json else to_line(seen, colour=colour)
            print(text, flush=True)
            if left is not None and seen.kind is Kind.PLAN:
                left -= 1
        elif not watcher.heard and time.monotonic() > silent_at:
            silent_at = float('inf')
            sys.stderr.write(f'llm-astar: {_advice(watcher)}\n')


def _advice(watcher: Watcher) -> str:
    """Say what to look at where nothing is heard of the planner."""
    if watcher.planner_is_there:
        return f'/{watcher.planner} is there and says nothing yet: it is starting, or it hangs'
    domain = os.environ.get('ROS_DOMAIN_ID', '0')
    reach = os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
    return (
        f'nothing is heard of /{watcher.planner}. Is it running? Is that its name (--node, '
        f'--namespace)? Has it the ROS_DOMAIN_ID of this shell, {domain}? Can it be discovered '
        f'from here (ROS_AUTOMATIC_DISCOVERY_RANGE is {reach})? Still waiting.'
    )
