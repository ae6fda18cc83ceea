"""`llm-astar speed`: our search against installed peers, side by side in one process."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


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
        '--size', type=int, default=1000, help='cells a side of a made map; 0: none (1000)'
    )
    parser.add_argument('--rounds', type=int, metavar='N', help='how often each is timed')
    parser.add_argument('--json', action='store_true', help='print the rows as JSON')


def run(arguments: argparse.Namespace) -> int:
    """Time, print, and return 0."""
    from llm_astar_planner.benchmark.speed import main  # noqa: PLC0415 - imports every peer

    words = ['--size', str(arguments.size)]
    if arguments.reference is not None:
        words += ['--reference', str(arguments.reference)]
    if arguments.rounds is not None:
        words += ['--rounds', str(arguments.rounds)]
    return main([*words, *(['--json'] if arguments.json else [])])
