# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Check transcripts: recorded exchanges with language models, which `replay` answers from.

examples:
  llm-astar transcript check demo_transcript.jsonl
  llm-astar transcript check replies.jsonl --map samples_1000.json --json

exit codes: 0 sound, 2 bad usage or malformed lines, 3 incomplete: samples of --map are missing, a
line was cut off, or digests, temperature or seed differ between exchanges of one model and prompt
"""

from __future__ import annotations

import argparse
import json

from llm_astar_msgs_adapter.errors import printable
from llm_astar_planner.cli.flags import option
from llm_astar_planner.resources import find_file

# Exit codes: nothing to complain about, malformed lines, or something is missing or differs.
SOUND, MALFORMED, INCOMPLETE = 0, 2, 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the action `check`."""
    actions = parser.add_subparsers(dest='action', required=True, metavar='ACTION')
    check = actions.add_parser(
        'check', help='validate every line, and summarise by model and prompt'
    )
    option(check, 'file FILE', 'a path, or a name in maps/')
    text = 'maps with start-goal pairs, a path or a name in maps/'
    option(check, '--map DATASET', f'{text}: say which samples are missing at scale 1')
    option(check, '--json', 'print what was found as JSON')


def run(args: argparse.Namespace) -> int:
    """Check a transcript; return its exit code. Raises ValueError for what cannot be read."""
    # These import numpy and the search, which `--help` should not wait for.
    from llm_astar_msgs_adapter.maps.problem_maps import load_maps  # noqa: PLC0415

    from llm_astar_lab.datasets.named import select_samples  # noqa: PLC0415
    from llm_astar_lab.runner.transcript_check import check_transcript  # noqa: PLC0415
    from llm_astar_lab.templates import render  # noqa: PLC0415

    path = find_file(args.file, 'maps')
    maps = load_maps(find_file(args.map, 'maps')) if args.map else []
    found = check_transcript(path, select_samples(maps, args.map) if maps else (), maps)
    values = found.values
    if args.json:
        print(json.dumps(values))
    else:
        held = zip(values['models'], found.coverage)
        text = render('commands/transcript.txt.j2', **values, held=held, dataset=args.map)
        for line in text.splitlines():
            print(('  ' if line.startswith(' ') else '') + printable(line))
    return MALFORMED if values['problems'] else SOUND if values['sound'] else INCOMPLETE
