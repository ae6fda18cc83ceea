"""`llm-astar speed`: our search against installed peers, side by side in one process."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from llm_astar_planner.benchmark.speed import (
    ROUNDS,
    measure,
    reference_cases,
    synthetic_case,
    table,
)
from llm_astar_planner.cli_run import count

# Below it a made map has no room for its queries.
LEAST_SIZE = 50


def add_parser(commands: Any) -> None:  # noqa: ANN401 - argparse keeps its type private
    """Add the command to `llm-astar`."""
    parser = commands.add_parser(
        'speed',
        description='Time the exact search against the planners that are installed (the extra '
        'peers: nano-astar, pyastar2d, w9-pathfinding, llm-astar), interleaved in one process: '
        'ratios with their spread, and how right each peer is beside its time.',
    )
    parser.set_defaults(run=run)
    parser.add_argument(
        '--reference', type=Path, metavar='DIR', help='a folder of maps and scenarios to time too'
    )
    parser.add_argument(
        '--size', type=int, default=1000, metavar='N',
        help='cells a side of a made map; 0: none (%(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '--rounds', type=count, default=ROUNDS, metavar='N',
        help='how often each is timed (%(default)s)',
    )  # fmt: skip
    parser.add_argument('--json', action='store_true', help='print the rows as JSON')


def run(arguments: argparse.Namespace) -> int:
    """Time, print, and return 0. Raises ValueError or OSError on bad input."""
    if arguments.size and arguments.size < LEAST_SIZE:
        message = f'--size {arguments.size} is neither 0 nor {LEAST_SIZE} or more'
        raise ValueError(message)
    cases = [] if arguments.reference is None else reference_cases(arguments.reference)
    if arguments.size:
        cases.append(synthetic_case(arguments.size))
    rows = measure(cases, rounds=arguments.rounds)
    print(json.dumps([asdict(row) for row in rows], indent=1) if arguments.json else table(rows))
    if len({row.planner for row in rows}) == 1:
        sys.stderr.write('no peer is installed: pip install nano-astar pyastar2d w9-pathfinding\n')
    return 0
