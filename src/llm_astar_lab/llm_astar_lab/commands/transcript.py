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
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from llm_astar_msgs_adapter.errors import printable
from llm_astar_planner.cli.flags import option
from llm_astar_planner.resources import find_file

if TYPE_CHECKING:
    from llm_astar_lab.runner.sources import Coverage
    from llm_astar_lab.runner.transcript_check import TranscriptCheck

# Lines about one thing that are printed; --json has all of them.
MAX_LINES = 20
MAX_GROUPS = 6
# Exit codes: nothing to complain about, malformed lines, or something is missing or differs.
SOUND, MALFORMED, INCOMPLETE = 0, 2, 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the action `check`."""
    actions = parser.add_subparsers(dest='action', required=True, metavar='ACTION')
    check = actions.add_parser(
        'check', help='validate every line, and summarise by model and prompt'
    )
    option(check, 'file FILE', 'a path, or a name in maps/')
    option(
        check, '--map DATASET',
        'maps with start-goal pairs, a path or a name in maps/: say which samples are '
        'missing at scale 1',
    )  # fmt: skip
    option(check, '--json', 'print what was found as JSON')


def run(args: argparse.Namespace) -> int:
    """Check a transcript; return its exit code. Raises ValueError for what cannot be read."""
    # These import numpy and the search, which `--help` should not wait for.
    from llm_astar_msgs_adapter.maps.problem_maps import load_maps  # noqa: PLC0415

    from llm_astar_lab.datasets.named import select_samples  # noqa: PLC0415
    from llm_astar_lab.runner.transcript_check import check_transcript  # noqa: PLC0415

    path = find_file(args.file, 'maps')
    maps = load_maps(find_file(args.map, 'maps')) if args.map else []
    found = check_transcript(path, select_samples(maps, args.map) if maps else (), maps)
    values = found.values
    if args.json:
        print(json.dumps(values))
    else:
        for line in describe(found, args.map):
            print(('  ' if line.startswith(' ') else '') + printable(line))
    return MALFORMED if values['problems'] else SOUND if values['sound'] else INCOMPLETE


def describe(found: TranscriptCheck, dataset: str | None) -> Iterator[str]:
    """Yield lines about a checked transcript."""
    values = found.values
    path, problems, about = values['file'], values['problems'], values['instructions']
    yield from bounded([f'{path}: {problem}' for problem in problems])
    if values['cut_off'] is not None:
        yield f'{path}: {values["cut_off"]}'
    for model, coverage in zip(values['models'], found.coverage):
        yield from describe_model(model, coverage, dataset)
    verdict = 'sound' if values['sound'] else 'incomplete'
    verdict = f'{len(problems)} malformed lines' if problems else verdict
    others = f', {about} about instructions' if about else ''
    yield f'{path}: {values["exchanges"]} exchanges{others}: {verdict}'


def describe_model(
    model: Mapping[str, Any], coverage: Coverage | None, dataset: str | None
) -> Iterator[str]:
    """Yield lines about what is recorded of one model and prompt."""
    statuses = ', '.join(f'{name} {count}' for name, count in model['statuses'].items())
    yield (
        f'model {model["model"] or "(none)"}, prompt {model["prompt"] or "(none)"}: '
        f'{model["exchanges"]} exchanges of {model["samples"]} samples ({statuses}), '
        f'{model["with_points"]} with a list of points; {model["prompt_tokens"]} tokens in, '
        f'{model["completion_tokens"]} out, {model["seconds"]:.1f} s'
    )
    if model['times']:
        yield f'  recorded from {model["times"][0]} to {model["times"][1]}'
    for name, held in model['values'].items():
        if len(held) == 1:
            having, of_all = held[0]['exchanges'], model['exchanges']
            some = '' if having == of_all else f' in {having} of {of_all}'
            yield f'  {name} {held[0]["value"]}{some}'
        else:
            texts = (f'{v["value"]}: {v["exchanges"]} ({shortly(v["samples"])})' for v in held)
            yield f'  {name} differs: {", ".join(texts)}'
    if model['twice']:
        yield f'  recorded more than once, the last answer counts: {shortly(model["twice"])}'
    if foreign := model['of_another_dataset']:
        yield f'  recorded on another dataset than {dataset}: {foreign} exchanges'
    if coverage is not None:
        yield f'  of {dataset}: {coverage.missing_sentence()}'


def shortly(groups: Sequence[str]) -> str:
    """Return the first groups of samples as one text."""
    shown = [*groups[:MAX_GROUPS], *(['...'] if len(groups) > MAX_GROUPS else [])]
    return '; '.join(shown)


def bounded(lines: Sequence[str]) -> Iterator[str]:
    """Yield the first lines, and how many more there are."""
    yield from lines[:MAX_LINES]
    if len(lines) > MAX_LINES:
        yield f'and {len(lines) - MAX_LINES} more'
