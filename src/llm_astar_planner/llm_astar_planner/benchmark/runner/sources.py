"""The sources a run asks: those named, for each prompt and model, and the ablations beside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from llm_astar_msgs_adapter.maps.barrier_map import BarrierMap
from llm_astar_msgs_adapter.maps.grid_dataset import GridProblem

from llm_astar_planner.benchmark.datasets.grids import GRID_RULES
from llm_astar_planner.benchmark.runner.engine import Asker
from llm_astar_planner.costmap.costmap import Costmap
from llm_astar_planner.waypoints.baselines import ablation_sources, visibility_problem
from llm_astar_planner.waypoints.config import (
    DEFAULT_PROMPT,
    SettingsError,
    SourceSettings,
)
from llm_astar_planner.waypoints.factory import make_source
from llm_astar_planner.waypoints.learned.source import EmbeddedSource
from llm_astar_planner.waypoints.prompts.template import load_template
from llm_astar_planner.waypoints.transcript import read_transcript

# The ablations that cost next to nothing on any grid: they need no visibility graph.
GRID_ABLATIONS = ('straight', 'random')
EMBEDDED = 'embedded'
# The embedded model has two rows: its greedy route, and the best of several by lines of sight.
BEST_OF = 8


def make_askers(
    names: Sequence[str],
    prompts: Sequence[str],
    models: Sequence[str],
    *,
    settings: SourceSettings,
    dataset: Sequence[BarrierMap],
    seed: int = 0,
    default: Sequence[str] | None = None,
) -> list[Asker]:
    """Make the askers of a run; the first is that of no source.

    Every named source is made for every prompt and model (`settings` with these put in). A replay
    without them gets all its transcript holds. All ablations (or `default`) come along where a
    named source is none of them, and with the embedded model where nothing is named; `none` alone
    asks nobody. Raises ValueError for a source that cannot be made.
    """
    ablations = ablation_sources(seed)
    asked = [name for name in names if name != 'none']
    chosen = [name for name in asked if name in ablations]
    if len(chosen) < len(asked) or not names:
        chosen = list(ablations if default is None else default)
    askers = [Asker()]
    if EMBEDDED in asked or not names:
        askers += embedded_askers()
    for name in asked:
        if name not in ablations and name != EMBEDDED:
            askers += _combinations(replace(settings, source=name), prompts, models, dataset)
    return askers + [Asker(ablations[name], name) for name in chosen]


def embedded_askers() -> list[Asker]:
    """Return the askers of the embedded model: greedy, and the best of BEST_OF routes."""
    return [
        Asker(EmbeddedSource(1), EMBEDDED),
        Asker(EmbeddedSource(BEST_OF), f'{EMBEDDED}-best-of-{BEST_OF}'),
    ]


def check_grid_run(problem: GridProblem, scales: Sequence[int], names: Sequence[str]) -> None:
    """Raise ValueError where a grid cannot be run at these scales or with these sources."""
    for scale in scales:
        problem.scale(scale)
    slow = [name for name in names if name in ablation_sources() and name not in GRID_ABLATIONS]
    reason = visibility_problem(Costmap(problem.to_grid(), GRID_RULES)) if slow else None
    if reason:
        message = f'--source {",".join(slow)}: {reason}'
        raise ValueError(message)


def _combinations(
    settings: SourceSettings,
    prompts: Sequence[str],
    models: Sequence[str],
    dataset: Sequence[BarrierMap],
) -> list[Asker]:
    pairs = [(model, prompt) for model in models or ('',) for prompt in prompts or ('',)]
    if settings.source == 'replay' and settings.transcript:
        held = dict.fromkeys(
            (exchange.model, exchange.prompt) for exchange in read_transcript(settings.transcript)
        )
        fitting = [
            pair
            for pair in held
            if (not models or pair[0] in models) and (not prompts or pair[1] in prompts)
        ]
        pairs = fitting or pairs
    elif settings.source == 'endpoint' and not models:
        raise SettingsError('model: --source endpoint needs --model')
    askers = []
    for model, prompt in pairs:
        source = make_source(replace(settings, model=model, prompt=prompt), dataset)
        askers.append(Asker(source, settings.source, _prompt_name(settings, prompt), model))
    return askers


def _prompt_name(settings: SourceSettings, prompt: str) -> str:
    """Return the name a prompt goes by in rows and transcripts; a file's is its stem."""
    if settings.source == 'replay':
        return prompt
    name = load_template(prompt or DEFAULT_PROMPT).name
    rounds = settings.repair_rounds
    return f'{name}, repaired up to {rounds}x' if rounds else name
