"""Summarises rows: metrics of every variant, paired comparisons, and growth with the scale."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from llm_astar_planner.benchmark.analysis.statistics import (
    NO_SPREAD,
    UNKNOWN,
    Interval,
    Spread,
    is_optimal,
    mean_interval,
    ratio_interval,
    spread,
)
from llm_astar_planner.benchmark.results import PAPER_ASTAR, WAYPOINTS_ONLY, Row, Variant

SampleId = tuple[int, int]
RowPairs = Sequence[tuple[Row, Row]]
# Our exact A* needs about half as many expansions as the paper's, so the ratio to it is stricter.
EXACT_ASTAR = Variant('exact_astar')
# The order of a report: methods as in the paper, and models before the baseline sources.
METHOD_ORDER = (
    'astar', 'exact_astar', 'weighted_astar', 'dynamic_weighted_astar', WAYPOINTS_ONLY,
    'llm_astar', 'guided',
)  # fmt: skip
BASELINE_SOURCES = ('none', 'coarse', 'straight', 'oracle', 'noisy', 'random', 'reversed')
# The columns whose growth over the scales of the map is measured.
GROWING_COLUMNS = ('operation', 'storage')


@dataclass(frozen=True)
class Ratio:
    """Ratios of two variants on the same samples: geometric mean with interval, and spread."""

    mean: Interval
    spread: Spread


@dataclass(frozen=True)
class VariantSummary:
    """The metrics of one variant at scale 1.

    `operation`, `storage` and `length` are ratios to A* over the samples that both solved;
    `valid` is over all samples. `seconds_*` are per sample. `verdicts` are the shares of the
    waypoints by status. `cost` is in the currency of the given price, None without a price.
    `unanswered` counts the samples whose source never answered. `operation_exact` is the ratio of
    expansions to our exact A*, where that was run; `proven` are the proven suboptimality bounds,
    of methods that prove one. `clearance` and `unknown_length` (metres) and `turns` describe the
    paths found. `recorded` is the length over that of the path in the bag, where there is one.
    `instruction` is the share of satisfied instructions among the samples that had one, and
    `recorded_instruction` that of the plans in the bag; unknown where none had one.
    `optimal_share` is the share of the paths found that are no longer than those of A*, `optimal`
    its value.
    """

    variant: Variant
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
    instruction: Interval = UNKNOWN
    recorded_instruction: Interval = UNKNOWN
    optimal_share: Interval = UNKNOWN


@dataclass(frozen=True)
class PairedComparison:
    """A variant compared with its method without waypoints, on the samples that both solved.

    `operation` and `length` are geometric means of variant / none; below 1 the waypoints help.
    """

    variant: Variant
    samples: int
    maps: int
    operation: Interval
    length: Interval


@dataclass(frozen=True)
class Growth:
    """The growth of one variant in one quantity, over the `samples` solved at every scale."""

    variant: Variant
    quantity: str
    samples: int
    scales: tuple[int, ...]
    factors: tuple[float, ...]
    slope: float


@dataclass(frozen=True)
class Price:
    """The price of a million tokens, in any currency."""

    prompt: float
    completion: float


def by_variant(rows: Iterable[Row], scale: int = 1) -> dict[Variant, dict[SampleId, Row]]:
    """Return the rows of a scale by variant and sample, variants in order of appearance."""
    variants: dict[Variant, dict[SampleId, Row]] = defaultdict(dict)
    for row in rows:
        if row.scale == scale:
            variants[row.variant][row.map, row.pair] = row
    return dict(variants)


def summarise(
    rows: Sequence[Row], seed: int = 0, price: Price | None = None
) -> list[VariantSummary]:
    """Summarise every variant at scale 1, in the order of the report's table."""
    variants = by_variant(rows)
    astar, exact = variants.get(PAPER_ASTAR, {}), variants.get(EXACT_ASTAR, {})
    return [
        summarise_variant(variant, variants[variant], astar, exact, seed=seed, price=price)
        for variant in sorted(variants, key=report_order)
    ]


def summarise_variant(
    variant: Variant,
    rows: Mapping[SampleId, Row],
    astar: Mapping[SampleId, Row],
    exact: Mapping[SampleId, Row],
    *,
    seed: int,
    price: Price | None,
) -> VariantSummary:
    """Summarise the rows of one variant against those of A* and of our exact A*."""
    every = list(rows.values())
    found = [row for row in every if row.found]
    statuses = Counter(name for row in every for name in row.verdicts.split(';') if name)
    prompt_tokens = sum(row.prompt_tokens for row in every)
    completion_tokens = sum(row.completion_tokens for row in every)
    pairs, exact_pairs = solved_by_both(rows, astar), solved_by_both(rows, exact)
    recorded = [
        (row, replace(row, length=row.recorded_length)) for row in found if row.recorded_length > 0
    ]
    optimal = optimal_share(pairs, seed)
    # A map without obstacles has an infinite clearance.
    clearances = [row.clearance for row in found if math.isfinite(row.clearance)]
    cost = None
    if price is not None:
        cost = (prompt_tokens * price.prompt + completion_tokens * price.completion) / 1e6
    return VariantSummary(
        variant=variant,
        samples=len(every),
        maps=len({row.map for row in every}),
        valid=mean_interval([row.found for row in every], [row.map for row in every], seed),
        operation=ratio(pairs, 'operation', seed),
        storage=ratio(pairs, 'storage', seed),
        length=ratio(pairs, 'length', seed),
        optimal=optimal.value,
        optimal_share=optimal,
        seconds_source=spread([row.seconds_source for row in every]),
        seconds_search=spread([row.seconds_search for row in every]),
        waypoints=sum(bool(row.waypoints) + row.waypoints.count(';') for row in every)
        / len(every),
        verdicts={name: count / statuses.total() for name, count in statuses.most_common()},
        prompt_tokens=prompt_tokens,
        completion_tokens=completion_tokens,
        cost=cost,
        seconds_round_trip=spread([t for row in every if (t := row.seconds_round_trip) >= 0]),
        operation_exact=ratio(exact_pairs, 'operation', seed) if exact_pairs else None,
        proven=spread([row.ratio for row in every if row.ratio >= 1.0]),
        unanswered=sum(not row.answered for row in every),
        clearance=spread(clearances),
        least_clearance=min(clearances, default=float('nan')),
        turns=spread([row.turns for row in found if math.isfinite(row.turns)]),
        unknown_length=spread(
            [row.unknown_length for row in found if math.isfinite(row.unknown_length)]
        ),
        recorded=ratio(recorded, 'length', seed) if recorded else None,
        instruction=satisfied_share(every, 'instruction_satisfied', seed),
        recorded_instruction=satisfied_share(every, 'recorded_instruction_satisfied', seed),
    )


def optimal_share(pairs: RowPairs, seed: int) -> Interval:
    """Return the share of pairs of rows whose first path is no longer than the second."""
    if not pairs:
        return UNKNOWN
    lengths, best = zip(*((row.length, base.length) for row, base in pairs))
    return mean_interval(is_optimal(lengths, best), [row.map for row, _ in pairs], seed)


def satisfied_share(rows: Sequence[Row], column: str, seed: int) -> Interval:
    """Return the share of rows with 1 in a column among those that have a number there."""
    asked = [row for row in rows if math.isfinite(getattr(row, column))]
    if not asked:
        return UNKNOWN
    return mean_interval(
        [getattr(row, column) == 1.0 for row in asked], [row.map for row in asked], seed
    )


def compare_with_none(rows: Sequence[Row], seed: int = 0) -> list[PairedComparison]:
    """Compare every variant that had waypoints with its method without any, at scale 1."""
    variants = by_variant(rows)
    comparisons = []
    for variant in sorted(variants, key=report_order):
        none = variants.get(Variant(variant.method))
        if variant.source == 'none' or none is None:
            continue
        pairs = solved_by_both(variants[variant], none)
        operation, maps = quotients(pairs, 'operation')
        length, length_maps = quotients(pairs, 'length')
        comparisons.append(
            PairedComparison(
                variant,
                len(operation),
                len(np.unique(maps)),
                ratio_interval(operation, maps, seed) if len(operation) else UNKNOWN,
                ratio_interval(length, length_maps, seed) if len(length) else UNKNOWN,
            )
        )
    return comparisons


def growth(rows: Sequence[Row]) -> list[Growth]:
    """Return the growth of every variant that was run at more than one scale.

    Only samples with a valid path at every scale of the variant count, so that all its factors
    are over the same samples.
    """
    solved: dict[Variant, dict[int, dict[tuple[int, int], Row]]] = defaultdict(dict)
    for row in rows:
        if row.found and row.operation > 0:
            solved[row.variant].setdefault(row.scale, {})[row.map, row.pair] = row
    found = []
    for variant, by_scale in solved.items():
        if len(by_scale) < 2 or 1 not in by_scale:
            continue
        scales = tuple(sorted(by_scale))
        samples = sorted(set.intersection(*(set(of_scale) for of_scale in by_scale.values())))
        for quantity in GROWING_COLUMNS:
            columns = {
                scale: [float(getattr(by_scale[scale][sample], quantity)) for sample in samples]
                for scale in scales
            }
            factors = tuple(growth_factor(columns[scale], columns[1]) for scale in scales)
            slope = log_log_slope(scales, factors) if samples else float('nan')
            found.append(Growth(variant, quantity, len(samples), scales, factors, slope))
    return found


def growth_factor(scaled: ArrayLike, base: ArrayLike) -> float:
    """Return (1/n) sum_i scaled_i / base_i, the paper's mean growth of n samples from scale 1."""
    ratios = np.asarray(scaled, dtype=float) / np.asarray(base, dtype=float)
    return float(ratios.mean()) if ratios.size else float('nan')


def log_log_slope(scales: ArrayLike, growth: ArrayLike) -> float:
    """Fit log(growth) = slope log(scale) + c by least squares and return the slope.

    1 is linear in the scale, 2 is proportional to the area of the map. NaN for a single scale.
    """
    xs, ys = np.asarray(scales, dtype=float), np.asarray(growth, dtype=float)
    if len(np.unique(xs)) < 2:
        return float('nan')
    return float(np.polyfit(np.log(xs), np.log(ys), 1)[0])


def solved_by_both(
    rows: Mapping[SampleId, Row], others: Mapping[SampleId, Row]
) -> list[tuple[Row, Row]]:
    """Return the pairs of rows for samples on which both found a path."""
    return [
        (row, others[sample])
        for sample, row in rows.items()
        if row.found and sample in others and others[sample].found
    ]


def quotients(pairs: RowPairs, column: str) -> tuple[list[float], list[int]]:
    """Return first / second of a column where both are above 0, and the maps of these rows."""
    values = [(getattr(a, column), getattr(b, column), a.map) for a, b in pairs]
    usable = [(a / b, number) for a, b, number in values if a > 0 and b > 0]
    return [value for value, _ in usable], [number for _, number in usable]


def ratio(pairs: RowPairs, column: str, seed: int) -> Ratio:
    """Return the ratios of a column over pairs of rows."""
    values, maps = quotients(pairs, column)
    return Ratio(ratio_interval(values, maps, seed) if values else UNKNOWN, spread(values))


def is_baseline(variant: Variant) -> bool:
    """Whether a variant's waypoints come from no model."""
    return variant.source in BASELINE_SOURCES


def is_learned(variant: Variant) -> bool:
    """Whether a variant's waypoints come from the embedded model: learned, but not an LLM."""
    return variant.source.startswith('embedded')


def report_order(variant: Variant) -> tuple[int, str, bool, int, str]:
    """Return the sort key of the report: methods as in the paper, models before baselines."""
    known = variant.method in METHOD_ORDER
    method = METHOD_ORDER.index(variant.method) if known else len(METHOD_ORDER)
    source = BASELINE_SOURCES.index(variant.source) if is_baseline(variant) else -1
    return method, variant.method, is_baseline(variant), source, str(variant)
