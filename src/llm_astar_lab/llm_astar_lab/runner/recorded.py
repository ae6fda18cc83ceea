"""Which samples of a dataset the transcripts of a run hold, and which are missing in each."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any, NamedTuple

from llm_astar_planner.waypoints.replay import ReplaySource
from llm_astar_planner.waypoints.source import SampleKey, live_key

from llm_astar_lab.datasets.samples import BenchmarkSample, SelectionError, sample_pairs
from llm_astar_lab.runner.sources import SourceSpec

RECORDED, ALL = SAMPLES = ('recorded', 'all')
# Groups of maps that a sentence names; metadata.json has all of them.
MAX_NAMED = 4
Pair = tuple[BenchmarkSample, int]


class SampleGroup(NamedTuple):
    """Samples of some maps: ranges of map ids and of pairs, such as `0-2,5`."""

    maps: str
    pairs: str
    scale: int

    def __str__(self) -> str:
        """Return the group as a sentence names it."""
        one = 'map' if self.maps.isdigit() else 'maps'
        at = f' at scale {self.scale}' if self.scale != 1 else ''
        return f'{one} {self.maps}: pairs {self.pairs}{at}'


@dataclass(frozen=True)
class Coverage:
    """What one replay has of `total` samples: keys (map, pair, scale) it has and it lacks.

    `unanswered` are those of the missing whose exchange was recorded without an answer.
    """

    spec: SourceSpec
    recorded: frozenset[SampleKey]
    missing: tuple[SampleKey, ...]
    unanswered: tuple[SampleKey, ...]

    @property
    def total(self) -> int:
        """The number of samples that were looked for."""
        return len(self.recorded) + len(self.missing)

    def sentence(self) -> str:
        """Say what is missing, so that the row is not taken for one over the whole dataset."""
        spec = self.spec
        name = ', '.join(part for part in (spec.model, spec.prompt) if part)
        text = f'{spec.transcript}: {name}: only recorded samples count; {self.missing_sentence()}'
        if spec.foreign:
            text += f'; {spec.foreign} exchanges of the file were recorded on another dataset'
        return text

    def missing_sentence(self) -> str:
        """Say how many samples are recorded, and which are missing."""
        text = f'{len(self.recorded)} of {self.total} samples are recorded'
        if not self.missing:
            return text
        text += f', missing are {len(self.missing)}'
        if self.unanswered:
            text += f', of them {len(self.unanswered)} recorded without an answer'
        groups = [str(group) for group in groups_of(self.missing)]
        if len(groups) > MAX_NAMED:
            groups[MAX_NAMED:] = ['...']
        return f'{text} ({"; ".join(groups)})'

    def to_json(self) -> dict[str, Any]:
        """Return what metadata.json and summary.json say."""
        spec = self.spec
        return {
            'transcript': spec.transcript,
            'source': spec.name,
            'prompt': spec.prompt,
            'model': spec.model,
            'samples': self.total,
            'recorded': len(self.recorded),
            'unanswered': len(self.unanswered),
            'missing': [group._asdict() for group in groups_of(self.missing)],
        }


class RecordedRun(NamedTuple):
    """What a run covers that is limited to its replays, and what each of them lacks."""

    samples: list[BenchmarkSample]
    specs: list[SourceSpec]
    coverage: list[Coverage]


def keep_recorded(
    samples: Sequence[BenchmarkSample],
    specs: Sequence[SourceSpec],
    scales: Sequence[int],
    scale_samples: int,
    seed: int,
) -> RecordedRun:
    """Limit a run to the samples that its replays have at one of the scales.

    A replay is run on the samples that it has, every other source on those that any replay has.
    At scales above 1 only those count as missing that the run draws, as `sample_pairs` does with
    `scale_samples` and `seed`. Without a replay nothing changes. Raises SelectionError where no
    sample is left.
    """
    replays = [spec for spec in specs if isinstance(spec.source, ReplaySource)]
    if not replays:
        return RecordedRun(list(samples), list(specs), [])
    pairs = [(sample, scale) for scale in {1, *scales} for sample in samples]
    own = {id(spec): cover(spec, pairs).recorded for spec in replays}
    every = frozenset[SampleKey]().union(*own.values())
    recorded = {key[:2] for key in every}
    kept = [sample for sample in samples if sample.key in recorded]
    due = [(sample, 1) for sample in samples if 1 in scales]
    due += sample_pairs(kept, [scale for scale in scales if scale != 1], scale_samples, seed)
    coverage = [cover(spec, due) for spec in replays]
    if not every:
        raise SelectionError(
            f'{coverage[0].sentence()}; --samples all runs them without waypoints'
        )
    chosen = [replace(spec, samples=own.get(id(spec), every)) for spec in specs]
    return RecordedRun(kept, chosen, coverage)


def cover(spec: SourceSpec, pairs: Sequence[Pair]) -> Coverage:
    """Look for every sample at its scale in the transcript of a replay."""
    source = spec.source
    assert isinstance(source, ReplaySource)  # noqa: S101 - as the caller has seen
    keys = {SampleKey(*sample.key, scale) for sample, scale in pairs}
    recorded = keys & source.answered
    if any(isinstance(key.map, str) for key in source.answered):
        recorded |= set(recorded_live(source, pairs))
    missing = sorted(keys - recorded, key=lambda key: (key.scale, key.map, key.pair))
    unanswered = tuple(key for key in missing if key in source.unanswered)
    return Coverage(spec, frozenset(recorded), tuple(missing), unanswered)


def recorded_live(source: ReplaySource, pairs: Iterable[Pair]) -> Iterator[SampleKey]:
    """Yield the samples that were recorded under the key of their cells, as a live map's are."""
    of_map = groupby(pairs, key=lambda pair: (pair[0].barrier_map, pair[1]))
    for (problem, scale), of_scale in of_map:
        scaled = problem.scale(scale)
        digest = scaled.to_grid().digest
        for sample, _ in of_scale:
            points = replace(problem, samples=(sample.sample,)).scale(scale).samples[0]
            ends = scaled.to_cell(points.start), scaled.to_cell(points.goal)
            if live_key(digest, *ends) in source.answered:
                yield SampleKey(*sample.key, scale)


def groups_of(keys: Iterable[SampleKey]) -> Iterator[SampleGroup]:
    """Yield samples in groups of successive maps with the same pairs, in their order."""
    by_map: dict[tuple[int, int], list[int]] = defaultdict(list)
    for key in keys:
        by_map[key.scale, int(key.map)].append(int(key.pair))
    named = [(place, ranges(pairs)) for place, pairs in by_map.items()]
    for (scale, pairs), group in groupby(named, key=lambda item: (item[0][0], item[1])):
        yield SampleGroup(ranges([place[1] for place, _ in group]), pairs, scale)


def ranges(numbers: Sequence[int]) -> str:
    """Write ascending numbers as `--map-ids` reads them: `0-2,5`."""
    parts: list[list[int]] = []
    for number in numbers:
        if parts and number == parts[-1][1] + 1:
            parts[-1][1] = number
        else:
            parts.append([number, number])
    return ','.join(str(a) if a == b else f'{a}-{b}' for a, b in parts)
