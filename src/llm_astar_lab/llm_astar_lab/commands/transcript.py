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
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from llm_astar_msgs_adapter.errors import printable
from llm_astar_planner.cli.flags import option
from llm_astar_planner.resources import find_file

if TYPE_CHECKING:
    from llm_astar_lab.runner.transcript_check import RecordedModel, TranscriptCheck

# Lines about one thing that are printed; --json has all of them.
MAX_LINES = 20
MAX_GROUPS = 6


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

    from llm_astar_lab.datasets.samples import select_samples  # noqa: PLC0415
    from llm_astar_lab.runner.transcript_check import check_transcript  # noqa: PLC0415

    path = find_file(args.file, 'maps')
    maps = load_maps(find_file(args.map, 'maps')) if args.map else []
    found = check_transcript(path, select_samples(maps, args.map) if maps else (), maps)
    if args.json:
        print(json.dumps(found.to_json()))
    else:
        for line in describe(found, args.map):
            print(('  ' if line.startswith(' ') else '') + printable(line))
    return found.code


def describe(found: TranscriptCheck, dataset: str | None) -> Iterator[str]:
    """Yield lines about a checked transcript."""
    lines = found.lines
    yield from bounded([f'{found.path}: {problem}' for problem in lines.problems])
    if lines.cut_off is not None:
        yield f'{found.path}: {lines.cut_off}'
    for model in found.models:
        yield from describe_model(model, dataset)
    about = f', {lines.instructions} about instructions' if lines.instructions else ''
    from llm_astar_lab.runner.transcript_check import MALFORMED, SOUND  # noqa: PLC0415

    malformed = f'{len(lines.problems)} malformed lines'
    verdict = {SOUND: 'sound', MALFORMED: malformed}.get(found.code, 'incomplete')
    yield f'{found.path}: {len(lines.exchanges)} exchanges{about}: {verdict}'


def describe_model(model: RecordedModel, dataset: str | None) -> Iterator[str]:
    """Yield lines about what is recorded of one model and prompt."""
    values = model.to_json()
    statuses = ', '.join(f'{name} {count}' for name, count in values['statuses'].items())
    yield (
        f'model {model.model or "(none)"}, prompt {model.prompt or "(none)"}: '
        f'{values["exchanges"]} exchanges of {values["samples"]} samples ({statuses}), '
        f'{values["with_points"]} with a list of points; {values["prompt_tokens"]} tokens in, '
        f'{values["completion_tokens"]} out, {values["seconds"]:.1f} s'
    )
    if values['times']:
        yield f'  recorded from {values["times"][0]} to {values["times"][1]}'
    for name, held in values['values'].items():
        if name not in model.differing:
            yield f'  {name} {held[0]["value"]}' + of_some(held[0]['exchanges'], model)
        else:
            texts = (f'{v["value"]}: {v["exchanges"]} ({shortly(v["samples"])})' for v in held)
            yield f'  {name} differs: {", ".join(texts)}'
    if values['twice']:
        yield f'  recorded more than once, the last answer counts: {shortly(values["twice"])}'
    if model.foreign:
        yield f'  recorded on another dataset than {dataset}: {model.foreign} exchanges'
    if model.coverage is not None:
        yield f'  of {dataset}: {model.coverage.missing_sentence()}'


def of_some(count: int, model: RecordedModel) -> str:
    """Say how many exchanges have a value, where not all of them do."""
    return '' if count == len(model.exchanges) else f' in {count} of {len(model.exchanges)}'


def shortly(groups: Sequence[str]) -> str:
    """Return the first groups of samples as one text."""
    shown = [*groups[:MAX_GROUPS], *(['...'] if len(groups) > MAX_GROUPS else [])]
    return '; '.join(shown)


def bounded(lines: Sequence[str]) -> Iterator[str]:
    """Yield the first lines, and how many more there are."""
    yield from lines[:MAX_LINES]
    if len(lines) > MAX_LINES:
        yield f'and {len(lines) - MAX_LINES} more'
