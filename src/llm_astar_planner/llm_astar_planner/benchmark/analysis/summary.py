"""From rows to figures: a summary of every case, and what its waypoints added over none."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from llm_astar_planner.benchmark.analysis.metrics import NO_SPREAD, Spread, optimal, share, spread
from llm_astar_planner.benchmark.analysis.statistics import (
    NOTHING,
    Interval,
    mean_interval,
    ratio_interval,
)
from llm_astar_planner.benchmark.results import Case, Row

SampleId = tuple[int, int]
BASELINE_METHOD = 'astar'
# A well-made A* needs about half of the paper's expansions: the harder baseline.
EXACT_METHOD = 'exact_astar'


@dataclass(frozen=True)
class Ratio:
    """Ratios to A* on the same samples: geometric mean with interval, and their spread."""

    mean: Interval
    spread: Spread


@dataclass(frozen=True)
class CaseSummary:
    """The figures of one case at scale 1.

    `operation`, `storage` and `length` are over the samples with a valid path; `valid` is over
    all. `seconds_*` are per sample. `verdicts` are shares of all waypoints. `cost` is in the
    currency of the price given, None without one. `unanswered` counts the samples for which the
    source never answered. `operation_exact` is over our exact A*, where it was run; `proven` are
    the ratios that paths were proven within, of the methods that prove any. `clearance` and
    `unknown_length` are metres and `turns` changes of direction, of the paths found; `recorded`
    is the length over that of the path a bag holds, where it holds one.
    """

    case: Case
    samples: int
    maps: int
    valid: Interval
    operation: Ratio
    storage: Ratio
    length: Ratio
    optimal: float
    seconds_source: Spread
    seconds_search: Spread
    waypoints: float
    verdicts: Mapping[str, float] = field(default_factory=dict)
    prompt_tokens: int = 0
    completion_tokens: int = 0
    cost: float | None = None
    unanswered: int = 0
    seconds_round_trip: Spread = NO_SPREAD
    operation_exact: Ratio | None = None
    proven: Spread = NO_SPREAD
    clearance: Spread = NO_SPREAD
    least_clearance: float = float('nan')
    turns: Spread = NO_SPREAD
    unknown_length: Spread = NO_SPREAD
    recorded: Ratio | None = None


@dataclass(frozen=True)
class Contrast:
    """A case against the same method without waypoints, on the samples both solved.

    `operation` and `length` are geometric means of case / none, below 1 where waypoints help.
    """

    case: Case
    samples: int
    maps: int
    operation: Interval
    length: Interval


@dataclass(frozen=True)
class Price:
    """What a million tokens cost, in any currency."""

    prompt: float
    completion: float


def by_case(rows: Iterable[Row], scale: int = 1) -> dict[Case, dict[SampleId, Row]]:
    """Sort the rows of a scale by case and sample, cases in their order of appearance."""
    cases: dict[Case, dict[SampleId, Row]] = defaultdict(dict)
    for row in rows:
        if row.scale == scale:
            cases[row.case][row.map, row.pair] = row
    return dict(cases)


def summarise(rows: Sequence[Row], seed: int = 0, price: Price | None = None) -> list[CaseSummary]:
    """Summarise every case at scale 1, in the order of the report's table."""
    cases = by_case(rows)
    baseline = cases.get(Case(BASELINE_METHOD), {})
    exact = cases.get(Case(EXACT_METHOD), {})
    summaries = [
        _summarise(case, of, (baseline, exact), seed, price) for case, of in cases.items()
    ]
    return sorted(summaries, key=lambda summary: place(summary.case))


def contrasts(rows: Sequence[Row], seed: int = 0) -> list[Contrast]:
    """Contrast every case that had waypoints with its method under none, at scale 1."""
    cases = by_case(rows)
    found = []
    for case in sorted(cases, key=place):
        none = cases.get(Case(case.method))
        if case.source != 'none' and none is not None:
            found.append(_contrast(case, cases[case], none, seed))
    return found


def _summarise(
    case: Case,
    rows: Mapping[SampleId, Row],
    baselines: tuple[Mapping[SampleId, Row], Mapping[SampleId, Row]],
    seed: int,
    price: Price | None,
) -> CaseSummary:
    every = list(rows.values())
    verdicts = Counter(name for row in every for name in row.verdicts.split(';') if name)
    judged = sum(verdicts.values())
    prompt_tokens = sum(row.prompt_tokens for row in every)
    completion_tokens = sum(row.completion_tokens for row in every)
    pairs, over_exact = (_pairs(rows, baseline) for baseline in baselines)
    lengths = [(row.length, base.length) for row, base in pairs]
    found = [row for row in every if row.found]
    clearances = _known([row.clearance for row in found])
    return CaseSummary(
        case=case,
        samples=len(every),
        maps=len({row.map for row in every}),
        valid=mean_interval([row.found for row in every], [row.map for row in every], seed),
        operation=_ratio(pairs, 'operation', seed),
        storage=_ratio(pairs, 'storage', seed),
        length=_ratio(pairs, 'length', seed),
        optimal=share(optimal(*zip(*lengths))) if lengths else float('nan'),
        seconds_source=spread([row.seconds_source for row in every]),
        seconds_search=spread([row.seconds_search for row in every]),
        waypoints=sum(bool(row.waypoints) + row.waypoints.count(';') for row in every)
        / len(every),
        verdicts={name: count / judged for name, count in verdicts.most_common()},
        prompt_tokens=prompt_tokens,
        completion_tokens=completion_tokens,
        cost=_cost(prompt_tokens, completion_tokens, price),
        seconds_round_trip=spread([t for row in every if (t := row.seconds_round_trip) >= 0]),
        operation_exact=_ratio(over_exact, 'operation', seed) if over_exact else None,
        proven=spread([row.ratio for row in every if row.ratio >= 1.0]),
        unanswered=sum(not row.answered for row in every),
        clearance=spread(clearances),
        least_clearance=min(clearances, default=float('nan')),
        turns=spread(_known([row.turns for row in found])),
        unknown_length=spread(_known([row.unknown_length for row in found])),
        recorded=_over_recorded(found, seed),
    )


def _known(values: Sequence[float]) -> list[float]:
    """Return the values that are finite: a map without obstacles has no clearance."""
    return [value for value in values if math.isfinite(value)]


def _over_recorded(rows: Sequence[Row], seed: int) -> Ratio | None:
    """Hold lengths against those of the recorded paths; None where there are none."""
    recorded = [(row, replace(row, length=row.recorded_length)) for row in rows]
    held = [pair for pair in recorded if pair[1].length > 0]
    return _ratio(held, 'length', seed) if held else None


def _pairs(rows: Mapping[SampleId, Row], others: Mapping[SampleId, Row]) -> list[tuple[Row, Row]]:
    """Pair the rows of samples that both solved."""
    return [
        (row, others[sample])
        for sample, row in rows.items()
        if row.found and sample in others and others[sample].found
    ]


def _quotients(
    pairs: Sequence[tuple[Row, Row]], name: str
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return a column's quotients where both have one above 0, and the maps they are from."""
    values = np.array([[getattr(a, name), getattr(b, name)] for a, b in pairs]).reshape(-1, 2)
    maps = np.array([row.map for row, _ in pairs], dtype=np.int64)
    usable = (values > 0).all(axis=1)
    return values[usable, 0] / values[usable, 1], maps[usable]


def _ratio(pairs: Sequence[tuple[Row, Row]], name: str, seed: int) -> Ratio:
    quotients, maps = _quotients(pairs, name)
    mean = ratio_interval(quotients, maps, seed) if len(quotients) else NOTHING
    return Ratio(mean, spread(quotients))


def _contrast(
    case: Case, rows: Mapping[SampleId, Row], none: Mapping[SampleId, Row], seed: int
) -> Contrast:
    pairs = _pairs(rows, none)
    operation, maps = _quotients(pairs, 'operation')
    length, length_maps = _quotients(pairs, 'length')
    return Contrast(
        case,
        len(operation),
        len(np.unique(maps)),
        ratio_interval(operation, maps, seed) if len(operation) else NOTHING,
        ratio_interval(length, length_maps, seed) if len(length) else NOTHING,
    )


def _cost(prompt_tokens: int, completion_tokens: int, price: Price | None) -> float | None:
    if price is None:
        return None
    return (prompt_tokens * price.prompt + completion_tokens * price.completion) / 1e6


METHOD_ORDER = (
    'astar', 'exact_astar', 'weighted_astar', 'dynamic_weighted_astar', 'llm_only', 'llm_astar',
    'guided',
)  # fmt: skip
ABLATIONS = ('none', 'straight', 'oracle', 'noisy', 'random', 'reversed')


def is_ablation(case: Case) -> bool:
    """Whether a case's waypoints come from no model."""
    return case.source in ABLATIONS


def is_learned(case: Case) -> bool:
    """Whether a case's waypoints come from the embedded model, which is learned but no LLM."""
    return case.source.startswith('embedded')


def place(case: Case) -> tuple[int, str, bool, int, str]:
    """Return the key to sort cases by: methods as in the paper, models before ablations."""
    known = case.method in METHOD_ORDER
    method = METHOD_ORDER.index(case.method) if known else len(METHOD_ORDER)
    ablation = ABLATIONS.index(case.source) if is_ablation(case) else -1
    return method, case.method, is_ablation(case), ablation, str(case)
