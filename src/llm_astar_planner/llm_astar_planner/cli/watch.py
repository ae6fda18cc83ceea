# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Print a line for each plan of a running planner_node.

It prints one for each exchange of its llm_client_node with its source and for each change of
their state, too.

The last plans from before the watch come first, at most ten. Ctrl-C ends it.
Lengths are in metres.

examples:
  llm-astar watch
  llm-astar watch --namespace /robot1
  llm-astar watch --json --count 1 | jq .length

exit codes: 0 after Ctrl-C or --count plans, 2 bad usage
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from llm_astar_msgs_adapter.messages.report import ExchangeReport, PlanReport

from llm_astar_planner.cli.flags import add_graph_options, at_least, option
from llm_astar_planner.nodes.common.process import handling

if TYPE_CHECKING:
    from llm_astar_planner.nodes.tools.planner_client import Monitor, MonitorEvent

# After how long without a message of the planner the user is advised what to check.
SILENCE_SECONDS = 3.0
# A signal that arrives between two waits interrupts neither, so every wait is at most this long.
LONGEST_WAIT = 0.5
# Clauses stand below the words of their plan, behind the time.
CLAUSE_INDENT = ' ' * 10


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    add_graph_options(parser, client=True)
    option(parser, '--count N', 'end after N plans', type=at_least(1, int))
    option(parser, '--json', 'print one JSON object per line')


def run(arguments: argparse.Namespace) -> int:
    """Watch until Ctrl-C or `--count` plans; return 0. Raises NodeNameError."""
    from llm_astar_planner.nodes.tools.planner_client import monitoring  # noqa: PLC0415

    stopped = threading.Event()
    # Not an exception: raised while the node is made, it would leave half a node, which aborts
    # the process at exit.
    with (
        handling([signal.SIGINT], lambda *_: stopped.set()),
        monitoring(arguments.namespace, arguments.node, arguments.client) as monitor,
    ):
        print_events(monitor, arguments, stopped)
    return 0


def print_events(
    monitor: Monitor, arguments: argparse.Namespace, stopped: threading.Event
) -> None:
    """Print events until there were `--count` plans or `stopped` is set."""
    left = arguments.count
    silent_at = time.monotonic() + SILENCE_SECONDS
    while not stopped.is_set() and (left is None or left > 0):
        event = monitor.next_event(LONGEST_WAIT)
        if event is not None:
            print(to_json(event) if arguments.json else to_line(event), flush=True)
            if left is not None and event.kind == 'plan':
                left -= 1
        elif not monitor.has_heard_planner and time.monotonic() > silent_at:
            silent_at = float('inf')
            sys.stderr.write(f'llm-astar: {advice(monitor)}\n')


def advice(monitor: Monitor) -> str:
    """Return what to check where no message of the planner arrives."""
    if monitor.planner_exists:
        return (
            f'/{monitor.planner} is running but has published nothing yet: it is starting, or '
            'it hangs'
        )
    domain = os.environ.get('ROS_DOMAIN_ID', '0')
    reach = os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
    return (
        f'no message of /{monitor.planner}. Is it running? Is that its name (--node, '
        f'--namespace)? Does it use the ROS_DOMAIN_ID of this shell, {domain}? Can it be '
        f'discovered from here (ROS_AUTOMATIC_DISCOVERY_RANGE is {reach})? Still waiting.'
    )


def to_json(event: MonitorEvent) -> str:
    """Return one JSON object on one line: `kind`, `stamp` and `node`, then the fields."""
    head = {'kind': event.kind.value, 'stamp': event.stamp / 1e9, 'node': event.node}
    return json.dumps({**head, **event.values})


def to_line(event: MonitorEvent) -> str:
    """Return one line for a person.

    A plan with an instruction has a line more for each clause. Characters that could control the
    terminal, such as a model may write, are replaced.
    """
    clock = time.strftime('%H:%M:%S', time.localtime(event.stamp / 1e9))
    words = {'plan': plan_words, 'exchange': exchange_words, 'health': health_words}
    line = '  '.join([clock, *filter(None, words[event.kind.value](event))])
    texts = (line, *clause_lines(event))
    return '\n'.join(''.join(x if x.isprintable() else ' ' for x in text) for text in texts)


def clause_lines(event: MonitorEvent) -> Iterator[str]:
    """Yield a line for each clause of a plan's instruction, with its status, and for the note."""
    # Importing numpy takes a tenth of a second.
    from llm_astar_planner.planning.report import clause_facts  # noqa: PLC0415

    report = event.values.get('instruction_report') if event.kind == 'plan' else None
    if not report:
        return
    for clause in report['clauses']:
        words = clause['clause'].removeprefix('not understood: ') + clause_facts(clause)
        yield f'{CLAUSE_INDENT}{clause["status"]:<14}  {words}'
    if report['note']:
        yield f'{CLAUSE_INDENT}{report["note"]}'


def plan_words(event: MonitorEvent) -> list[str]:
    """Return what a plan's line says: as in the log, and its times."""
    report = PlanReport(**event.values)
    return [
        report.summary,
        f'method {report.method}' if report.method else '',
        f'{1000 * report.seconds_search:.1f} ms to search',
        f'{1000 * report.seconds_source:.1f} ms for waypoints' if report.seconds_source else '',
        *(f'! {warning}' for warning in report.warnings),
    ]


def exchange_words(event: MonitorEvent) -> list[str]:
    """Return the words of the line of an exchange with a source; empty ones are left out."""
    report = ExchangeReport(**event.values)
    tokens = f'{report.prompt_tokens} + {report.completion_tokens} tokens'
    return [
        'exchange',
        report.summary,
        tokens if report.prompt_tokens or report.completion_tokens else '',
        f'{report.seconds:.2f} s',
        report.detail if report.status == 'OK' else '',
    ]


def health_words(event: MonitorEvent) -> list[str]:
    """Return the words of the line of a node's new state."""
    return ['health  ', event.node, event.values['message']]
