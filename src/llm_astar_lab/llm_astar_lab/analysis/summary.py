"""Summarises rows: metrics of every variant, paired comparisons, and growth with the scale."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from llm_astar_lab.analysis.columns import (
    RowColumns,
    VariantColumns,
    columns_of,
)
from llm_astar_lab.analysis.families import (
    FamilyMeans,
    FamilySummary,
    Grouped,
    family_means,
    family_summaries,
)
from llm_astar_lab.analysis.solved_pairs import (
    Ratio,
    SolvedPairs,
    quotients,
    ratio_of,
)
from llm_astar_lab.analysis.statistics import (
    NO_SPREAD,
    UNKNOWN,
    Interval,
    Spread,
    is_optimal,
    mean_interval,
    ratio_interval,
    spread,
)
from llm_astar_lab.results.row import PAPER_ASTAR, WAYPOINTS_ONLY, Row, Variant

SampleId = tuple[int, int]
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
    `optimal` is the share of the paths found that are no longer than those of A*. `families` are
    the figures by family of maps, and `family_means` the operation ratios over all families and
    over all but one. `replies` counts a model's replies by what is wrong with them, empty where
    none was judged; `seconds_reply` is how long the model took when they were recorded.
    """

    variant: Variant
    samples: int
    maps: int
    valid: Interval
    operation: Ratio
    storage: Ratio
    length: Ratio
    optimal: Interval
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
    families: Mapping[str, FamilySummary] = field(default_factory=dict)
    family_means: FamilyMeans = field(default_factory=FamilyMeans)
    replies: Mapping[str, int] = field(default_factory=dict)
    seconds_reply: Spread = NO_SPREAD


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

    def of(self, prompt_tokens: int, completion_tokens: int) -> float:
        """Return what tokens cost."""
        return (prompt_tokens * self.prompt + completion_tokens * self.completion) / 1e6


class RunSummary(NamedTuple):
    """What the rows of a run show, with its metadata: all that a report's tables are made of."""

    variants: Sequence[VariantSummary] = ()
    comparisons: Sequence[PairedComparison] = ()
    growths: Sequence[Growth] = ()
    metadata: Mapping[str, Any] = MappingProxyType({})


def by_variant(rows: Iterable[Row], scale: int = 1) -> dict[Variant, dict[SampleId, Row]]:
    """Return the rows of a scale by variant and sample, variants in order of appearance."""
    variants: dict[Variant, dict[SampleId, Row]] = defaultdict(dict)
    for row in rows:
        if row.scale == scale:
            variants[row.variant][row.map, row.pair] = row
    return dict(variants)


def summarise_run(rows: Iterable[Row] | RowColumns, metadata: Mapping[str, Any]) -> RunSummary:
    """Summarise a run by the seed and the price in its metadata."""
    columns, parameters = columns_of(rows), metadata['parameters']
    seed, price = int(parameters.get('seed', 0)), parameters.get('price')
    variants = summarise(columns, seed, None if price is None else Price(*price))
    return RunSummary(variants, compare_with_none(columns, seed), growth(columns), metadata)


def summarise(
    rows: Iterable[Row] | RowColumns, seed: int = 0, price: Price | None = None
) -> list[VariantSummary]:
    """Summarise every variant at scale 1, in the order of the report's table.

    Rows are read once; columns that were made of them serve several analyses.
    """
    variants = columns_of(rows).at_scale(1)
    bases = variants.get(PAPER_ASTAR), variants.get(EXACT_ASTAR)
    return [
        summarise_variant(variant, variants[variant], bases, seed, price)
        for variant in sorted(variants, key=report_order)
    ]


def summarise_variant(
    variant: Variant,
    rows: VariantColumns,
    bases: tuple[VariantColumns | None, VariantColumns | None],
    seed: int,
    price: Price | None,
) -> VariantSummary:
    """Summarise the rows of one variant against those of A* and of our exact A*, `bases`."""
    found, maps = rows.flags('found'), rows.column('map')
    pairs, exact_pairs = (SolvedPairs.of(rows, base) for base in bases)
    families, family_means = by_family(rows, pairs, seed)
    # A map without obstacles has an infinite clearance.
    clearances = finite(rows.column('clearance')[found])
    tokens = [int(rows.column(name).sum()) for name in ('prompt_tokens', 'completion_tokens')]
    bounds, round_trips = rows.column('ratio'), rows.column('seconds_round_trip')
    return VariantSummary(
        variant=variant,
        samples=len(rows),
        maps=len(np.unique(maps)),
        valid=mean_interval(found, maps, seed),
        operation=pairs.ratio('operation', seed),
        storage=pairs.ratio('storage', seed),
        length=pairs.ratio('length', seed),
        optimal=optimal_share(pairs, seed),
        seconds_source=spread(rows.column('seconds_source')),
        seconds_search=spread(rows.column('seconds_search')),
        waypoints=rows.waypoints / len(rows),
        verdicts={
            name: count / rows.verdicts.total() for name, count in rows.verdicts.most_common()
        },
        prompt_tokens=tokens[0],
        completion_tokens=tokens[1],
        cost=None if price is None else price.of(*tokens),
        seconds_round_trip=spread(round_trips[round_trips >= 0]),
        operation_exact=exact_pairs.ratio('operation', seed) if len(exact_pairs) else None,
        proven=spread(bounds[bounds >= 1.0]),
        unanswered=int(np.count_nonzero(~rows.flags('answered'))),
        clearance=spread(clearances),
        least_clearance=float(clearances.min()) if len(clearances) else math.nan,
        turns=spread(finite(rows.column('turns')[found])),
        unknown_length=spread(finite(rows.column('unknown_length')[found])),
        recorded=recorded_ratio(rows, seed),
        instruction=satisfied_share(rows, 'instruction_satisfied', seed),
        recorded_instruction=satisfied_share(rows, 'recorded_instruction_satisfied', seed),
        families=families,
        family_means=family_means,
        replies=dict(rows.replies),
        seconds_reply=spread(finite(rows.column('seconds_reply'))),
    )


def by_family(
    rows: VariantColumns, pairs: SolvedPairs, seed: int
) -> tuple[dict[str, FamilySummary], FamilyMeans]:
    """Return the figures of a variant by family, and their means; empty for a single family."""
    names = rows.families
    if len(names) < 2:
        return {}, FamilyMeans()
    groups = np.stack([pairs.maps, pairs.rows.column('family')[pairs.places[0]]])
    ratios = [quotients(*pairs.columns(name), groups) for name in ('operation', 'length')]
    operation, length = (Grouped(values, *kept) for values, kept in ratios)
    valid = Grouped(rows.flags('found'), rows.column('map'), rows.column('family'))
    summaries = family_summaries(names, valid, operation, length, seed)
    return summaries, family_means(summaries, names, operation, seed)


def finite(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the values that are numbers."""
    return values[np.isfinite(values)]


def optimal_share(pairs: SolvedPairs, seed: int) -> Interval:
    """Return the share of pairs of rows whose first path is no longer than the second."""
    if not len(pairs):
        return UNKNOWN
    return mean_interval(is_optimal(*pairs.columns('length')), pairs.maps, seed)


def recorded_ratio(rows: VariantColumns, seed: int) -> Ratio | None:
    """Return the lengths over those of the paths in the bags; None where there is none."""
    recorded = rows.column('recorded_length')
    has_both = rows.flags('found') & (recorded > 0)
    if not has_both.any():
        return None
    lengths, maps = rows.column('length'), rows.column('map')
    return ratio_of(*quotients(lengths[has_both], recorded[has_both], maps[has_both]), seed)


def satisfied_share(rows: VariantColumns, column: str, seed: int) -> Interval:
    """Return the share of rows with 1 in a column among those that have a number there."""
    values = rows.column(column)
    asked = np.isfinite(values)
    return mean_interval(values[asked] == 1.0, rows.column('map')[asked], seed)


def compare_with_none(rows: Iterable[Row] | RowColumns, seed: int = 0) -> list[PairedComparison]:
    """Compare every variant that had waypoints with its method without any, at scale 1."""
    variants = columns_of(rows).at_scale(1)
    comparisons = []
    for variant in sorted(variants, key=report_order):
        none = variants.get(Variant(variant.method))
        if variant.source == 'none' or none is None:
            continue
        pairs = SolvedPairs.of(variants[variant], none)
        operation, maps = pairs.quotients('operation')
        length, length_maps = pairs.quotients('length')
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


def growth(rows: Iterable[Row] | RowColumns) -> list[Growth]:
    """Return the growth of every variant that was run at more than one scale.

    Only samples with a valid path at every scale of the variant count, so that all its factors
    are over the same samples.
    """
    found = []
    for variant, by_scale in columns_of(rows).by_variant():
        solved = {
            scale: np.flatnonzero(columns.flags('found') & (columns.column('operation') > 0))
            for scale, columns in by_scale.items()
        }
        scales = tuple(sorted(scale for scale, places in solved.items() if len(places)))
        if len(scales) < 2 or 1 not in scales:
            continue
        own = {scale: by_scale[scale].samples()[solved[scale]] for scale in scales}
        samples = own[1]
        for others in own.values():
            samples = np.intersect1d(samples, others)
        places = {}
        for scale, numbers in own.items():
            order = np.argsort(numbers)
            places[scale] = solved[scale][order[np.isin(numbers[order], samples)]]
        for quantity in GROWING_COLUMNS:
            values = {scale: by_scale[scale].column(quantity)[places[scale]] for scale in scales}
            factors = tuple(growth_factor(values[scale], values[1]) for scale in scales)
            slope = log_log_slope(scales, factors) if len(samples) else float('nan')
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
