# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Checks a transcript line by line, and says what it holds of a dataset."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap
from llm_astar_planner.instructions.transcript import parse_exchange as parse_instruction
from llm_astar_planner.waypoints import transcript
from llm_astar_planner.waypoints.prompts.reply_parser import read_answer
from llm_astar_planner.waypoints.replay import ReplaySource, dataset_digest
from llm_astar_planner.waypoints.source import SampleKey, SourceStatus
from llm_astar_planner.waypoints.transcript import Exchange, TranscriptError

from llm_astar_lab.datasets.named import BenchmarkSample
from llm_astar_lab.runner.sources import Coverage, SourceSpec, cover, groups_of

# What all exchanges of one model and prompt have in common, if they were recorded alike.
COMMON = ('model_digest', 'prompt_digest', 'dataset_digest', 'temperature', 'seed')
# Models and prompts of a transcript, each of which is compared with the whole dataset.
MAX_MODELS = 100


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
    coverage: list[Coverage | None] = [None] * len(by_model)
    if samples and not problems:
        pairs = [(sample, 1) for sample in samples]
        for index, ((model, prompt), own) in enumerate(by_model.items()):
            source = ReplaySource(path, model, prompt, exchanges=own)
            spec = SourceSpec(source, 'replay', prompt, model, path.name)
            coverage[index] = cover(spec, pairs)
    held = zip(by_model.values(), coverage)
    models = [describe_model(own, covered, digest) for own, covered in held]
    complete = (models or not samples) and all(map(is_complete, models))
    values = {
        'file': str(path),
        'exchanges': len(exchanges),
        'instructions': instructions,
        'problems': problems,
        'cut_off': cut_off,
        'models': models,
        'sound': bool(complete) and not problems and cut_off is None,
    }
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
        'model': exchanges[0].model,
        'prompt': exchanges[0].prompt,
        'exchanges': len(exchanges),
        'samples': len({exchange.sample for exchange in exchanges}),
        'statuses': dict(Counter(exchange.status.value for exchange in exchanges)),
        'with_points': sum(has_points(exchange) for exchange in exchanges),
        'prompt_tokens': sum(exchange.prompt_tokens for exchange in exchanges),
        'completion_tokens': sum(exchange.completion_tokens for exchange in exchanges),
        'seconds': sum(exchange.seconds for exchange in exchanges),
        'times': [times[0], times[-1]] if times else [],
        'twice': name_samples(key for key, count in answered.items() if count > 1),
        'values': values_of(exchanges),
        'of_another_dataset': foreign if digest else 0,
        'coverage': None if coverage is None else coverage.to_json(),
    }


def is_complete(model: Mapping[str, Any]) -> bool:
    """Tell whether a model lacks no sample, and all its exchanges are of the same origin."""
    lacks = model['coverage'] and model['coverage']['missing']
    differs = any(len(held) > 1 for held in model['values'].values())
    return not (lacks or model['of_another_dataset'] or differs)


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


def values_of(exchanges: Iterable[Exchange]) -> dict[str, list[dict[str, Any]]]:
    """Return the known values of each of the fields COMMON, the most frequent one first."""
    found: dict[str, dict[Any, list[SampleKey]]] = {name: defaultdict(list) for name in COMMON}
    for exchange in exchanges:
        for name in COMMON:
            value = getattr(exchange.provenance, name)
            if value not in ('', None):
                found[name][value].append(exchange.sample)
    return {
        name: [
            {'value': value, 'exchanges': len(keys), 'samples': name_samples(keys)}
            for value, keys in sorted(values.items(), key=lambda item: -len(item[1]))
        ]
        for name, values in found.items()
        if values
    }


def has_points(exchange: Exchange) -> bool:
    """Tell whether the response of an exchange holds a list of points."""
    return read_answer(exchange.response).status is SourceStatus.OK


def name_samples(keys: Iterable[SampleKey]) -> list[str]:
    """Return text for samples: those of a dataset in ranges, live ones by map and pair."""
    every = set(keys)
    of_dataset = [key for key in every if isinstance(key.map, int) and isinstance(key.pair, int)]
    others = [f'map {key.map}: {key.pair}' for key in every.difference(of_dataset)]
    order = sorted(of_dataset, key=lambda key: (key.scale, key.map, key.pair))
    return [*map(str, groups_of(order)), *sorted(others)]
