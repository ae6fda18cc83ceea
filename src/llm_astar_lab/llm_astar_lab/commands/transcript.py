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
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from llm_astar_msgs_adapter.errors import printable
from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap, load_maps
from llm_astar_planner.cli.flags import option
from llm_astar_planner.instructions.transcript import parse_exchange as parse_instruction
from llm_astar_planner.resources import find_file
from llm_astar_planner.waypoints import transcript
from llm_astar_planner.waypoints.prompts.reply_parser import read_answer
from llm_astar_planner.waypoints.replay import ReplaySource, dataset_digest
from llm_astar_planner.waypoints.source import SampleKey
from llm_astar_planner.waypoints.transcript import Exchange, TranscriptError

from llm_astar_lab.datasets.named import BenchmarkSample, select_samples
from llm_astar_lab.runner.sources import Coverage, SourceSpec, cover, groups_of
from llm_astar_lab.templates import render

# Exit codes: nothing to complain about, malformed lines, or something is missing or differs.
SOUND, MALFORMED, INCOMPLETE = 0, 2, 3
# What all exchanges of one model and prompt have in common, if they were recorded alike.
COMMON = ('model_digest', 'prompt_digest', 'dataset_digest', 'temperature', 'seed')
# Models and prompts of a transcript, each of which is compared with the whole dataset.
MAX_MODELS = 100


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


class TranscriptCheck(NamedTuple):
    """What was found in a transcript.

    `values` is what --json prints: the lines, and by model and prompt what they hold. A sample in
    `twice` was answered more than once; `values` are those of the fields COMMON where any is
    known; `of_another_dataset` counts exchanges and `coverage` is what the model has of the
    dataset, which both need one. `coverage` is that of each model.
    """

    values: dict[str, Any]
    coverage: list[Coverage | None]


def check_transcript(
    path: Path, samples: Sequence[BenchmarkSample] = (), maps: Sequence[ProblemMap] = ()
) -> TranscriptCheck:
    """Check a transcript, and what it has of `samples` at scale 1, which are of `maps`.

    It is sound where no line is malformed or cut off, no sample is missing, and all exchanges of
    a model are of the same origin. Raises TranscriptError where the file cannot be read.
    """
    exchanges, instructions, problems, cut_off = check_lines(path)
    digest = dataset_digest([item for item in maps if isinstance(item, BarrierMap)])
    by_model: dict[tuple[str, str], list[Exchange]] = defaultdict(list)
    for exchange in exchanges:
        by_model[exchange.model, exchange.prompt].append(exchange)
    if len(by_model) > MAX_MODELS:
        raise TranscriptError(f'{path}: over {MAX_MODELS} models and prompts; split the file')
    coverage: list[Coverage | None] = []
    for (model, prompt), own in by_model.items():
        source = ReplaySource(path, model, prompt, exchanges=own)
        spec = SourceSpec(source, 'replay', prompt, model, path.name)
        is_known = samples and not problems
        coverage.append(cover(spec, [(item, 1) for item in samples]) if is_known else None)
    models = [describe_model(*item, digest) for item in zip(by_model.values(), coverage)]
    lacks = any(item['coverage'] and item['coverage']['missing'] for item in models)
    differ = any(len(held) > 1 for item in models for held in item['values'].values())
    foreign = any(item['of_another_dataset'] for item in models)
    is_whole = bool(models or not samples) and not (problems or cut_off)
    values = {
        'file': str(path), 'exchanges': len(exchanges), 'instructions': instructions,
        'problems': problems, 'cut_off': cut_off, 'models': models,
        'sound': is_whole and not (lacks or differ or foreign),
    }  # fmt: skip
    return TranscriptCheck(values, coverage)


def describe_model(
    exchanges: Sequence[Exchange], coverage: Coverage | None, digest: str
) -> dict[str, Any]:
    """Return what --json prints of one model and prompt; `digest` is that of the dataset."""
    answered = Counter(e.sample for e in exchanges if e.is_answered)
    foreign = sum(e.provenance.dataset_digest not in ('', digest) for e in exchanges)
    known = (e.provenance.time for e in exchanges if e.provenance.time)
    times = sorted(known, key=transcript.parse_time)
    return {
        'model': exchanges[0].model, 'prompt': exchanges[0].prompt, 'exchanges': len(exchanges),
        'samples': len({exchange.sample for exchange in exchanges}),
        'statuses': dict(Counter(exchange.status.value for exchange in exchanges)),
        'with_points': sum(read_answer(e.response).status.value == 'OK' for e in exchanges),
        'prompt_tokens': sum(exchange.prompt_tokens for exchange in exchanges),
        'completion_tokens': sum(exchange.completion_tokens for exchange in exchanges),
        'seconds': sum(exchange.seconds for exchange in exchanges),
        'times': [times[0], times[-1]] if times else [],
        'twice': name_samples(key for key, count in answered.items() if count > 1),
        'values': values_of(exchanges), 'of_another_dataset': foreign if digest else 0,
        'coverage': None if coverage is None else coverage.to_json(),
    }  # fmt: skip


def check_lines(path: Path) -> tuple[list[Exchange], int, list[str], str | None]:
    """Read every line, whatever is wrong with others. Raises TranscriptError for the file.

    Returns the exchanges, how many are about instructions, what is wrong, and the line cut off.
    """
    exchanges: list[Exchange] = []
    problems: list[str] = []
    about_instructions, cut_off = 0, None
    for where, record, problem in transcript.read_lines(path):
        if problem == transcript.CUT_OFF:
            cut_off = f'{where}: {problem}; readers skip it'
        elif problem:
            problems.append(f'{where}: {problem}')
        else:
            try:
                if transcript.is_about_instruction(record):
                    parse_instruction(record, where)
                    about_instructions += 1
                else:
                    exchanges.append(transcript.parse_exchange(record, where))
            except TranscriptError as error:
                problems.append(str(error))
    return exchanges, about_instructions, problems, cut_off


def values_of(exchanges: Sequence[Exchange]) -> dict[str, list[dict[str, Any]]]:
    """Return the known values of each of the fields COMMON, the most frequent one first."""
    found: dict[str, list[dict[str, Any]]] = {}
    for name in COMMON:
        samples: dict[Any, list[SampleKey]] = defaultdict(list)
        for exchange in exchanges:
            samples[getattr(exchange.provenance, name)].append(exchange.sample)
        values = [
            {'value': value, 'exchanges': len(keys), 'samples': name_samples(keys)}
            for value, keys in sorted(samples.items(), key=lambda item: -len(item[1]))
            if value not in ('', None)
        ]
        found |= {name: values} if values else {}
    return found


def name_samples(keys: Iterable[SampleKey]) -> list[str]:
    """Return text for samples: those of a dataset in ranges, live ones by map and pair."""
    every = set(keys)
    of_dataset = [key for key in every if isinstance(key.map, int) and isinstance(key.pair, int)]
    others = [f'map {key.map}: {key.pair}' for key in every.difference(of_dataset)]
    order = sorted(of_dataset, key=lambda key: (key.scale, key.map, key.pair))
    return [*map(str, groups_of(order)), *sorted(others)]
