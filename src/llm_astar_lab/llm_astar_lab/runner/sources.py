# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The waypoint sources of a run, and which samples of a dataset its transcripts hold."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, product
from pathlib import Path
from typing import Any, NamedTuple

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.baselines import baseline_sources, visibility_problem
from llm_astar_planner.waypoints.config import SettingsError, SourceSettings, make_source
from llm_astar_planner.waypoints.replay import ReplaySource, dataset_digest
from llm_astar_planner.waypoints.source import (
    BASELINE_NAMES,
    SampleKey,
    WaypointSource,
    live_key,
    name_problem,
)
from llm_astar_planner.waypoints.transcript import read_transcript

from llm_astar_lab.datasets import named as datasets
from llm_astar_lab.datasets.named import BenchmarkSample

# The baselines that are cheap on any grid, because they need no visibility graph.
GRID_BASELINES = ('coarse', 'straight', 'random')
EMBEDDED, REPLAY = 'embedded', 'replay'
# The embedded model is run twice: its greedy route, and the best of this many routes.
BEST_OF = 8
BEST_OF_EMBEDDED = f'{EMBEDDED}-best-of-{BEST_OF}'
RECORDED, ALL = SAMPLES = ('recorded', 'all')
# Groups of maps that a sentence names; metadata.json has all of them.
MAX_NAMED = 4
Pair = tuple[BenchmarkSample, int]


@dataclass(frozen=True)
class SourceSpec:
    """A waypoint source with the name, prompt and model that its rows carry.

    `transcript` is the file name of a replay. `samples` are the samples to run it on, None for
    all of a run. `foreign` counts the exchanges of its transcript that say that they were recorded
    on another dataset.
    """

    source: WaypointSource | None = None
    name: str = 'none'
    prompt: str = ''
    model: str = ''
    transcript: str = ''
    samples: frozenset[SampleKey] | None = None
    foreign: int = 0

    def covers(self, key: tuple[int, int, int]) -> bool:
        """Tell whether to run the source on a sample: map, pair and scale."""
        return self.samples is None or key in self.samples


@dataclass(frozen=True)
class SourceOptions:
    """What the sources of a run are made by: each is made once per prompt and model.

    `default` are the baselines that are added, None for all of them.
    """

    settings: SourceSettings
    dataset: Sequence[BarrierMap]
    prompts: Sequence[str] = ()
    models: Sequence[str] = ()
    transcripts: Sequence[str] = ()
    seed: int = 0
    default: Sequence[str] | None = None

    def specs(self, names: Sequence[str]) -> list[SourceSpec]:
        """Make the named sources; the first one is `none`.

        A replay is made once per transcript, and without prompt and model it covers all that its
        transcript holds. All baselines (or `default`) are added if a named source is not a
        baseline. Without names these are the baselines and the embedded model; the name `none`
        alone gives `none` alone. Raises ValueError for a source that cannot be made.
        """
        baselines = baseline_sources(self.seed)
        named = [name for name in dict.fromkeys(names) if name != 'none']
        chosen = [name for name in named if name in baselines]
        if len(chosen) < len(named) or not names:
            chosen = list(baselines if self.default is None else self.default)
        specs = [SourceSpec()]
        if EMBEDDED in named or not names:
            specs += embedded_sources(self.settings)
        for name in named:
            if name == REPLAY:
                specs += self.replays()
            elif name not in baselines and name != EMBEDDED:
                specs += self.of_models(name)
        specs += [SourceSpec(baselines[name], name) for name in chosen]
        for row, count in Counter((spec.name, spec.model, spec.prompt) for spec in specs).items():
            if count > 1:
                what = f'{count} would have the same rows, {", ".join(filter(None, row))}'
                raise SettingsError(f'source: {what}: rename a file')
        return specs

    @property
    def asked(self) -> Iterator[tuple[str, str]]:
        """The models and prompts, each with each; '' where none is named."""
        models, prompts = (dict.fromkeys(some or ('',)) for some in (self.models, self.prompts))
        return product(models, prompts)

    def replays(self) -> list[SourceSpec]:
        """Make a replay of each transcript, model and prompt: all recorded ones, or those named.

        Where two transcripts hold the same model and prompt, their rows are told apart by file
        name: `replay:NAME`.
        """
        specs, own = [], dataset_digest(self.dataset)
        for transcript in self.transcripts or ('',):
            of_file = replace(self.settings, source=REPLAY, transcript=transcript)
            exchanges = read_transcript(transcript) if transcript else []
            recorded = dict.fromkeys((exchange.model, exchange.prompt) for exchange in exchanges)
            digests = Counter(exchange.provenance.dataset_digest for exchange in exchanges)
            foreign = digests.total() - digests[''] - digests[own] if own else 0
            chosen = [
                (model, prompt)
                for model, prompt in recorded
                if model in (self.models or [model]) and prompt in (self.prompts or [prompt])
            ]
            for model, prompt in chosen or self.asked:
                source = make_source(replace(of_file, model=model, prompt=prompt), self.dataset)
                name = Path(transcript).name
                specs.append(SourceSpec(source, REPLAY, prompt, model, name, foreign=foreign))
        held = Counter((spec.model, spec.prompt) for spec in specs)
        return [
            replace(spec, name=f'{REPLAY}:{Path(spec.transcript).stem}')
            if held[spec.model, spec.prompt] > 1
            else spec
            for spec in specs
        ]

    def of_models(self, name: str) -> Iterator[SourceSpec]:
        """Make a source once per model and prompt. Raises ValueError where one cannot be made."""
        if name == 'endpoint' and not self.models:
            raise SettingsError('model: --source endpoint needs --model')
        for model, prompt in self.asked:
            settings = replace(self.settings, source=name, model=model, prompt=prompt)
            source, label = make_source(settings, self.dataset, self.seed), prompt
            if name == 'endpoint':
                label = settings.prompt_name
            if problem := name_problem(label):
                raise SettingsError(f'prompt: {problem}')
            yield SourceSpec(source, name, label, model)


def embedded_sources(settings: SourceSettings) -> list[SourceSpec]:
    """Return the embedded model twice: greedy, and the best of BEST_OF routes."""
    return [
        SourceSpec(make_source(replace(settings, source=EMBEDDED, candidates=count)), name)
        for count, name in ((1, EMBEDDED), (BEST_OF, BEST_OF_EMBEDDED))
    ]


def check_grid_options(problem: GridProblem, names: Sequence[str]) -> None:
    """Raise ValueError where a grid cannot be run with these sources."""
    slow = [name for name in names if name in BASELINE_NAMES and name not in GRID_BASELINES]
    reason = visibility_problem(Costmap(problem.to_grid(), datasets.GRID_CONFIG)) if slow else None
    if reason:
        raise ValueError(f'--source {",".join(slow)}: {reason}')


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
        text = f'{spec.transcript}: {name}: only recorded samples count; '
        text += f'{len(self.recorded)} of {self.total} samples are recorded'
        if self.missing:
            text += f', missing are {len(self.missing)}'
            if self.unanswered:
                text += f', of them {len(self.unanswered)} recorded without an answer'
            groups = [str(group) for group in groups_of(self.missing)]
            if len(groups) > MAX_NAMED:
                groups[MAX_NAMED:] = ['...']
            text += f' ({"; ".join(groups)})'
        if spec.foreign:
            text += f'; {spec.foreign} exchanges of the file were recorded on another dataset'
        return text

    def to_json(self) -> dict[str, Any]:
        """Return what metadata.json and summary.json say."""
        spec = self.spec
        return {
            'transcript': spec.transcript, 'source': spec.name, 'prompt': spec.prompt,
            'model': spec.model, 'samples': self.total, 'recorded': len(self.recorded),
            'unanswered': len(self.unanswered),
            'missing': [group._asdict() for group in groups_of(self.missing)],
        }  # fmt: skip


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
    due += datasets.sample_pairs(
        kept, [scale for scale in scales if scale != 1], scale_samples, seed
    )
    coverage = [cover(spec, due) for spec in replays]
    if not every:
        raise datasets.SelectionError(
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
    runs = groupby(enumerate(numbers), key=lambda item: item[1] - item[0])
    ends = ((run[0][1], run[-1][1]) for run in (list(group) for _, group in runs))
    return ','.join(str(a) if a == b else f'{a}-{b}' for a, b in ends)
