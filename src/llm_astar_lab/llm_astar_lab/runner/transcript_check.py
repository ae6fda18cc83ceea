"""Checks a transcript line by line, and says what it holds of a dataset."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap
from llm_astar_planner.instructions import transcript as instructions
from llm_astar_planner.waypoints.prompts.reply_parser import read_answer
from llm_astar_planner.waypoints.replay import ReplaySource, dataset_digest
from llm_astar_planner.waypoints.source import SampleKey, SourceStatus
from llm_astar_planner.waypoints.transcript import (
    CUT_OFF,
    Exchange,
    TranscriptError,
    is_about_instruction,
    parse_exchange,
    parse_time,
    read_lines,
)

from llm_astar_lab.datasets.samples import BenchmarkSample
from llm_astar_lab.runner.sources import Coverage, SourceSpec, cover, groups_of

# What all exchanges of one model and prompt have in common, if they were recorded alike.
COMMON = ('model_digest', 'prompt_digest', 'dataset_digest', 'temperature', 'seed')
# Models and prompts of a transcript, each of which is compared with the whole dataset.
MAX_MODELS = 100
# Exit codes: nothing to complain about, malformed lines, or something is missing or differs.
SOUND, MALFORMED, INCOMPLETE = 0, 2, 3


class Lines(NamedTuple):
    """The lines of a transcript: exchanges, how many are about instructions, what is wrong."""

    exchanges: list[Exchange]
    instructions: int
    problems: list[str]
    cut_off: str | None


@dataclass(frozen=True)
class RecordedModel:
    """What a transcript holds of one model and prompt.

    `twice` are the samples that were answered more than once. `values` are the exchanges of each
    value of the fields COMMON, where any is known. `foreign` counts the exchanges that were
    recorded on another dataset, `coverage` is what the model has of the dataset; both need one.
    """

    model: str
    prompt: str
    exchanges: Sequence[Exchange]
    twice: tuple[SampleKey, ...]
    values: dict[str, dict[Any, list[Exchange]]]
    coverage: Coverage | None = None
    foreign: int = 0

    @property
    def is_complete(self) -> bool:
        """Whether no sample is missing, and all exchanges are of the same origin."""
        missing = 0 if self.coverage is None else len(self.coverage.missing)
        return not (missing or self.foreign or self.differing)

    @property
    def differing(self) -> list[str]:
        """The fields that do not have the same value in all exchanges that say it."""
        return [name for name, found in self.values.items() if len(found) > 1]

    def to_json(self) -> dict[str, Any]:
        """Return what was found, for --json."""
        statuses = Counter(exchange.status.value for exchange in self.exchanges)
        times = sorted(
            (e.provenance.time for e in self.exchanges if e.provenance.time), key=parse_time
        )
        return {
            'model': self.model,
            'prompt': self.prompt,
            'exchanges': len(self.exchanges),
            'samples': len({exchange.sample for exchange in self.exchanges}),
            'statuses': dict(statuses),
            'with_points': sum(has_points(exchange) for exchange in self.exchanges),
            'prompt_tokens': sum(exchange.prompt_tokens for exchange in self.exchanges),
            'completion_tokens': sum(exchange.completion_tokens for exchange in self.exchanges),
            'seconds': sum(exchange.seconds for exchange in self.exchanges),
            'times': [times[0], times[-1]] if times else [],
            'twice': name_samples(self.twice),
            'values': {
                name: [
                    {
                        'value': value,
                        'exchanges': len(having),
                        'samples': name_samples(exchange.sample for exchange in having),
                    }
                    for value, having in found.items()
                ]
                for name, found in self.values.items()
            },
            'of_another_dataset': self.foreign,
            'coverage': None if self.coverage is None else self.coverage.to_json(),
        }


@dataclass(frozen=True)
class TranscriptCheck:
    """A checked transcript: its lines, and what they hold of each model and prompt.

    `wanted` is the number of samples that it should have.
    """

    path: Path
    lines: Lines
    models: tuple[RecordedModel, ...]
    wanted: int = 0

    @property
    def code(self) -> int:
        """The exit code: SOUND, MALFORMED or INCOMPLETE."""
        if self.lines.problems:
            return MALFORMED
        is_complete = all(model.is_complete for model in self.models)
        is_complete = is_complete and (bool(self.models) or not self.wanted)
        return SOUND if is_complete and self.lines.cut_off is None else INCOMPLETE

    def to_json(self) -> dict[str, Any]:
        """Return what was found, for --json."""
        return {
            'file': str(self.path),
            'exchanges': len(self.lines.exchanges),
            'instructions': self.lines.instructions,
            'problems': self.lines.problems,
            'cut_off': self.lines.cut_off,
            'models': [model.to_json() for model in self.models],
            'sound': self.code == SOUND,
        }


def check_transcript(
    path: Path, samples: Sequence[BenchmarkSample] = (), maps: Sequence[ProblemMap] = ()
) -> TranscriptCheck:
    """Check a transcript, and what it has of `samples` at scale 1, which are of `maps`.

    Raises TranscriptError where the file cannot be read.
    """
    lines = check_lines(path)
    digest = dataset_digest([item for item in maps if isinstance(item, BarrierMap)])
    by_model: dict[tuple[str, str], list[Exchange]] = defaultdict(list)
    for exchange in lines.exchanges:
        by_model[exchange.model, exchange.prompt].append(exchange)
    if len(by_model) > MAX_MODELS:
        raise TranscriptError(f'{path}: over {MAX_MODELS} models and prompts; split the file')
    models = []
    for (model, prompt), exchanges in by_model.items():
        coverage = None
        if samples and not lines.problems:
            source = ReplaySource(path, model, prompt, exchanges=exchanges)
            spec = SourceSpec(source, 'replay', prompt, model, path.name)
            coverage = cover(spec, [(sample, 1) for sample in samples])
        answered = Counter(e.sample for e in exchanges if e.is_answered)
        twice = tuple(key for key, count in answered.items() if count > 1)
        foreign = [e for e in exchanges if e.provenance.dataset_digest not in ('', digest)]
        models.append(
            RecordedModel(
                model,
                prompt,
                exchanges,
                twice,
                values_of(exchanges),
                coverage,
                len(foreign) if digest else 0,
            )
        )
    return TranscriptCheck(path, lines, tuple(models), len(samples))


def check_lines(path: Path) -> Lines:
    """Read every line, whatever is wrong with others. Raises TranscriptError for the file."""
    exchanges: list[Exchange] = []
    problems: list[str] = []
    about_instructions, cut_off = 0, None
    for where, record, problem in read_lines(path):
        if problem == CUT_OFF:
            cut_off = f'{where}: {problem}; readers skip it'
        elif problem:
            problems.append(f'{where}: {problem}')
        if problem:
            continue
        try:
            if is_about_instruction(record):
                instructions.parse_exchange(record, where)
                about_instructions += 1
            else:
                exchanges.append(parse_exchange(record, where))
        except TranscriptError as error:
            problems.append(str(error))
    return Lines(exchanges, about_instructions, problems, cut_off)


def values_of(exchanges: Iterable[Exchange]) -> dict[str, dict[Any, list[Exchange]]]:
    """Return the exchanges by each known value of the fields COMMON, the most frequent first."""
    found: dict[str, dict[Any, list[Exchange]]] = {name: defaultdict(list) for name in COMMON}
    for exchange in exchanges:
        for name in COMMON:
            value = getattr(exchange.provenance, name)
            if value not in ('', None):
                found[name][value].append(exchange)
    return {
        name: dict(sorted(values.items(), key=lambda item: -len(item[1])))
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
