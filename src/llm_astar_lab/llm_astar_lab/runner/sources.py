"""The waypoint sources of a run: the named ones for each prompt and model, and the baselines."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.baselines import baseline_sources, visibility_problem
from llm_astar_planner.waypoints.config import SettingsError, SourceSettings, make_source
from llm_astar_planner.waypoints.plugins import BASELINE_NAMES
from llm_astar_planner.waypoints.replay import dataset_digest
from llm_astar_planner.waypoints.source import SampleKey, WaypointSource, name_problem
from llm_astar_planner.waypoints.transcript import read_transcript

from llm_astar_lab.datasets.samples import GRID_CONFIG

# The baselines that are cheap on any grid, because they need no visibility graph.
GRID_BASELINES = ('coarse', 'straight', 'random')
EMBEDDED, REPLAY = 'embedded', 'replay'
# The embedded model is run twice: its greedy route, and the best of this many routes.
BEST_OF = 8
BEST_OF_EMBEDDED = f'{EMBEDDED}-best-of-{BEST_OF}'


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


def make_source_specs(
    names: Sequence[str],
    prompts: Sequence[str],
    models: Sequence[str],
    *,
    settings: SourceSettings,
    dataset: Sequence[BarrierMap],
    transcripts: Sequence[str] = (),
    seed: int = 0,
    default: Sequence[str] | None = None,
) -> list[SourceSpec]:
    """Make the sources of a run; the first one is `none`.

    Every named source is made once per prompt and model, with the other `settings`, and a replay
    once per transcript. A replay without prompt and model covers all that its transcript holds.
    All baselines (or `default`) are added if a named source is not a baseline. Without names
    these are the baselines and the embedded model; the name `none` alone gives `none` alone.
    Raises ValueError for a source that cannot be made.
    """
    baselines = baseline_sources(seed)
    named = [name for name in dict.fromkeys(names) if name != 'none']
    prompts, models = list(dict.fromkeys(prompts)), list(dict.fromkeys(models))
    chosen = [name for name in named if name in baselines]
    if len(chosen) < len(named) or not names:
        chosen = list(baselines if default is None else default)
    specs = [SourceSpec()]
    if EMBEDDED in named or not names:
        specs += embedded_sources(settings)
    for name in named:
        if name == REPLAY:
            specs += replay_sources(settings, transcripts, prompts, models, dataset)
        elif name not in baselines and name != EMBEDDED:
            chosen_settings = replace(settings, source=name)
            specs += model_sources(chosen_settings, prompts, models, dataset, seed)
    specs += [SourceSpec(baselines[name], name) for name in chosen]
    twice = Counter((spec.name, spec.model, spec.prompt) for spec in specs)
    for (name, model, prompt), count in twice.items():
        if count > 1:
            row = ', '.join(filter(None, (name, model, prompt)))
            raise SettingsError(f'source: {count} would have the same rows, {row}: rename a file')
    return specs


def embedded_sources(settings: SourceSettings) -> list[SourceSpec]:
    """Return the embedded model twice: greedy, and the best of BEST_OF routes."""
    named = {1: EMBEDDED, BEST_OF: BEST_OF_EMBEDDED}
    return [
        SourceSpec(make_source(replace(settings, source=EMBEDDED, candidates=count)), name)
        for count, name in named.items()
    ]


def replay_sources(
    settings: SourceSettings,
    transcripts: Sequence[str],
    prompts: Sequence[str],
    models: Sequence[str],
    dataset: Sequence[BarrierMap],
) -> list[SourceSpec]:
    """Make a replay of each transcript, model and prompt; all that are recorded, or those named.

    Where two transcripts hold the same model and prompt, their rows are told apart by file name:
    `replay:NAME`. Raises SettingsError where that is the same too.
    """
    specs, own = [], dataset_digest(dataset)
    for transcript in transcripts or ('',):
        of_file = replace(settings, source=REPLAY, transcript=transcript)
        exchanges = read_transcript(transcript) if transcript else []
        recorded = dict.fromkeys((exchange.model, exchange.prompt) for exchange in exchanges)
        digests = Counter(exchange.provenance.dataset_digest for exchange in exchanges)
        foreign = digests.total() - digests[''] - digests[own] if own else 0
        chosen = [
            (model, prompt)
            for model, prompt in recorded
            if (not models or model in models) and (not prompts or prompt in prompts)
        ]
        for model, prompt in chosen or product(models or ('',), prompts or ('',)):
            source = make_source(replace(of_file, model=model, prompt=prompt), dataset)
            name = Path(transcript).name
            specs.append(SourceSpec(source, REPLAY, prompt, model, name, foreign=foreign))
    return told_apart(specs)


def told_apart(specs: Sequence[SourceSpec]) -> list[SourceSpec]:
    """Name replays of the same model and prompt by their files. Raises SettingsError."""
    held = Counter((spec.model, spec.prompt) for spec in specs)
    named = [
        replace(spec, name=f'{REPLAY}:{Path(spec.transcript).stem}')
        if held[spec.model, spec.prompt] > 1
        else spec
        for spec in specs
    ]
    twice = Counter((spec.name, spec.model, spec.prompt) for spec in named)
    for (name, model, prompt), count in twice.items():
        if count > 1:
            raise SettingsError(
                f'transcript: {count} files named {name.removeprefix(REPLAY + ":")} hold model '
                f'{model}, prompt {prompt}; rename all but one'
            )
    return named


def model_sources(
    settings: SourceSettings,
    prompts: Sequence[str],
    models: Sequence[str],
    dataset: Sequence[BarrierMap],
    seed: int = 0,
) -> list[SourceSpec]:
    """Make a source once per model and prompt. Raises ValueError where one cannot be made."""
    if settings.source == 'endpoint' and not models:
        raise SettingsError('model: --source endpoint needs --model')
    specs = []
    for model, prompt in product(models or ('',), prompts or ('',)):
        asked = replace(settings, model=model, prompt=prompt)
        source = make_source(asked, dataset, seed)
        label = prompt_label(asked) if settings.source == 'endpoint' else prompt
        problem = name_problem(label)
        if problem:
            raise SettingsError(f'prompt: {problem}')
        specs.append(SourceSpec(source, settings.source, label, model))
    return specs


def prompt_label(settings: SourceSettings) -> str:
    """Return the name of a prompt in rows: how it was asked, and how often repaired."""
    rounds = settings.repair_rounds
    return f'{settings.prompt_name}, repaired up to {rounds}x' if rounds else settings.prompt_name


def check_grid_options(problem: GridProblem, names: Sequence[str]) -> None:
    """Raise ValueError where a grid cannot be run with these sources."""
    slow = [name for name in names if name in BASELINE_NAMES and name not in GRID_BASELINES]
    reason = visibility_problem(Costmap(problem.to_grid(), GRID_CONFIG)) if slow else None
    if reason:
        raise ValueError(f'--source {",".join(slow)}: {reason}')
