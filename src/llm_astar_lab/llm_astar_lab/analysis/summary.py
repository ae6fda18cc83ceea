# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Summarises rows: metrics of every variant, paired comparisons, and growth with the scale."""

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from llm_astar_lab.analysis import statistics as stats
from llm_astar_lab.analysis.replies import count_problems
from llm_astar_lab.analysis.statistics import NO_SPREAD, UNKNOWN, Interval, Ratio, Spread, spread
from llm_astar_lab.results.row import PAPER_ASTAR, Row, Variant
from llm_astar_lab.results.stored_rows import StoredRows

Arrays = Mapping[str, NDArray[Any]]
SampleId = tuple[int, int]
# Our exact A* needs about half as many expansions as the paper's, so the ratio to it is stricter.
EXACT_ASTAR = Variant('exact_astar')
# The columns whose growth over the scales of the map is measured.
GROWING_COLUMNS = ('operation', 'storage')
# The columns that are compared with A*.
COMPARED = ('operation', 'storage', 'length')


@dataclass(frozen=True)
class FamilySummary:
    """A variant on the maps of one family.

    `valid` is the share of the samples with a valid path; `operation` and `length` are geometric
    means of the ratios to A*, over the samples that both solved.
    """

    samples: int
    maps: int
    valid: Interval
    operation: Interval
    length: Interval


@dataclass(frozen=True)
class FamilyMeans:
    """Geometric means of the families' operation ratios: of all, and without each one of them.

    What changes when one is left out shows how much of a figure hangs on it.
    """

    every: Interval = UNKNOWN
    without: Mapping[str, Interval] = field(default_factory=dict)


@dataclass(frozen=True)
class VariantSummary:
    """The metrics of one variant at scale 1.

    `operation`, `storage` and `length` are ratios to A* over the samples that both solved;
    `valid` is over all samples. `seconds_*` are per sample. `verdicts` are the shares of the
    waypoints by status.
    `unanswered` counts the samples whose source never answered, `failures` those and the replies
    without a list of points, by status. `operation_exact` is the ratio of
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
    unanswered: int = 0
    failures: Mapping[str, int] = field(default_factory=dict)
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
    Of the `asked` samples some have `failures` of the source, by status; `answered` are the
    operation ratio and the number of the compared samples that have none.
    """

    variant: Variant
    samples: int
    maps: int
    operation: Interval
    length: Interval
    asked: int = 0
    failures: Mapping[str, int] = field(default_factory=dict)
    answered: tuple[Interval, int] = UNKNOWN, 0


@dataclass(frozen=True)
class Growth:
    """The growth of one variant in one quantity, over the `samples` solved at every scale."""

    variant: Variant
    quantity: str
    samples: int
    scales: tuple[int, ...]
    factors: tuple[float, ...]
    slope: float


class RunSummary(NamedTuple):
    """What the rows of a run show, with its metadata: all that a report's tables are made of.

    `recorded` counts the `requests` of bags, those with recorded `plans`, how many of these are
    `broken`, and the requests whose plan is `empty`.
    """

    variants: Sequence[VariantSummary] = ()
    comparisons: Sequence[PairedComparison] = ()
    growths: Sequence[Growth] = ()
    metadata: Mapping[str, Any] = MappingProxyType({})
    recorded: Mapping[str, int] = MappingProxyType({})


def by_variant(rows: Iterable[Row]) -> dict[Variant, dict[SampleId, Row]]:
    """Return the rows of scale 1 by variant and sample, variants in order of appearance."""
    variants: dict[Variant, dict[SampleId, Row]] = defaultdict(dict)
    for row in rows:
        if row.scale == 1:
            variants[row.variant][row.map, row.pair] = row
    return dict(variants)


def summarise_run(rows: Iterable[Row] | StoredRows, metadata: Mapping[str, Any]) -> RunSummary:
    """Summarise a run by the seed in its metadata."""
    stored, seed = StoredRows.of(rows), int(metadata['parameters'].get('seed', 0))
    variants = summarise(stored, seed)
    recorded = {name: int(count[0]) for name, count in stored.arrays('recorded').items()}
    return RunSummary(
        variants, compare_with_none(stored, seed), growth(stored), metadata, recorded
    )


def summarise(rows: Iterable[Row] | StoredRows, seed: int = 0) -> list[VariantSummary]:
    """Summarise every variant at scale 1, in the order of the report's table."""
    stored = StoredRows.of(rows)
    families = stored.arrays('families')['family'].tolist()
    return [
        summarise_variant(stored, variant, families, seed)
        for variant in sorted(stored.variants('scale = 1'), key=attrgetter('report_order'))
    ]


def summarise_variant(
    stored: StoredRows, variant: Variant, names: Sequence[str], seed: int
) -> VariantSummary:
    """Summarise the rows of one variant against those of A* and of our exact A*.

    `names` are the families of the run's maps.
    """
    rows = stored.arrays('own_numbers', *variant)
    bases = PAPER_ASTAR, EXACT_ASTAR
    pairs, exact = (stored.arrays('solved_pairs', *variant, *base) for base in bases)
    found, maps = rows['found'], rows['map']
    is_optimal = stats.is_optimal(pairs['own_length'], pairs['base_length'])
    families, family_means = by_family(names, rows, pairs, seed)
    both = found & (rows['recorded_length'] > 0)
    # A map without obstacles has an infinite clearance.
    clearances = rows['clearance'][found & np.isfinite(rows['clearance'])]
    verdicts = count_texts(stored, variant, 'verdicts', lambda text: filter(None, text.split(';')))
    bounds, round_trips = rows['ratio'], rows['seconds_round_trip']
    return VariantSummary(
        variant=variant, samples=len(found), maps=len(np.unique(maps)),
        valid=stats.mean_interval(found, maps, seed),
        **{name: stats.ratio_of(pairs[name], pairs['map'], seed) for name in COMPARED},
        optimal=stats.mean_interval(is_optimal, pairs['map'], seed),
        seconds_source=spread(rows['seconds_source']),
        seconds_search=spread(rows['seconds_search']),
        waypoints=int(rows['waypoints'].sum()) / len(found),
        verdicts={name: count / verdicts.total() for name, count in verdicts.most_common()},
        prompt_tokens=int(rows['prompt_tokens'].sum()),
        completion_tokens=int(rows['completion_tokens'].sum()),
        seconds_round_trip=spread(round_trips[round_trips >= 0]),
        operation_exact=ratio_if_any(exact['operation'], exact['map'], seed),
        proven=spread(bounds[bounds >= 1.0]), unanswered=int(np.count_nonzero(~rows['answered'])),
        failures=failures_of(stored, variant), clearance=spread(clearances),
        least_clearance=float(clearances.min()) if len(clearances) else math.nan,
        turns=spread(rows['turns'][found]), unknown_length=spread(rows['unknown_length'][found]),
        recorded=ratio_if_any(rows['recorded'][both], maps[both], seed),
        instruction=satisfied_share(rows, 'instruction_satisfied', seed),
        recorded_instruction=satisfied_share(rows, 'recorded_instruction_satisfied', seed),
        families=families, family_means=family_means,
        replies=dict(count_texts(stored, variant, 'reply_problems', count_problems)),
        seconds_reply=spread(rows['seconds_reply']),
    )  # fmt: skip


def count_texts(
    stored: StoredRows, variant: Variant, column: str, split: Callable[[str], Iterable[str]]
) -> Counter[str]:
    """Count what the texts of a variant at scale 1 are split into, but for empty texts."""
    found = stored.arrays('texts', *variant, column=column)
    counts: Counter[str] = Counter()
    for text, times in zip(found['text'], found['times'].tolist()):
        for part in split(text):
            counts[part] += times
    return counts


def failures_of(stored: StoredRows, variant: Variant) -> dict[str, int]:
    """Return how often the source of a variant failed at scale 1, by status, the most first."""
    found = stored.arrays('failures', *variant)
    return dict(zip(found['source_status'].tolist(), found['times'].tolist()))


def ratio_if_any(ratios: ArrayLike, maps: NDArray[Any], seed: int) -> Ratio | None:
    """Return the ratio of two variants; None where they share no sample."""
    return stats.ratio_of(ratios, maps, seed) if len(maps) else None


def satisfied_share(rows: Arrays, column: str, seed: int) -> Interval:
    """Return the share of rows with 1 in a column among those that have a number there."""
    asked, maps = stats.known(rows[column], rows['map'])
    return stats.mean_interval(asked == 1.0, maps, seed)


def by_family(
    names: Sequence[str], rows: Arrays, pairs: Arrays, seed: int
) -> tuple[dict[str, FamilySummary], FamilyMeans]:
    """Return the figures of a variant by family, and their means; empty for a single family."""
    if len(names) < 2:
        return {}, FamilyMeans()
    summaries, ratios = {}, {}
    for name in names:
        own, solved = rows['family'] == name, pairs['family'] == name
        if not own.any():
            continue
        maps, both = rows['map'][own], pairs['map'][solved]
        ratios[name] = stats.known(pairs['operation'][solved], both)
        valid = stats.mean_interval(rows['found'][own], maps, seed)
        work = stats.ratio_interval(*ratios[name], seed)
        length = stats.ratio_interval(pairs['length'][solved], both, seed)
        summaries[name] = FamilySummary(len(maps), len(np.unique(maps)), valid, work, length)
    seeds = {name: (seed, names.index(name)) for name in ratios}
    return summaries, family_means(summaries, ratios, seeds)


def family_means(
    summaries: Mapping[str, FamilySummary],
    ratios: Mapping[str, tuple[stats.Floats, NDArray[Any]]],
    seeds: Mapping[str, tuple[int, int]],
) -> FamilyMeans:
    """Return the mean of two or more families' ratios, and the means without each of them.

    `ratios` are those of each family with their maps; the intervals are by bootstrap over these.
    Each family weighs the same, however many samples it has. Without a ratio in one of the
    families the means are unknown: they would be of other families than those of other variants.
    """
    if len(summaries) < 2 or not all(item.operation.value > 0 for item in summaries.values()):
        return FamilyMeans()
    logs = {name: np.log(item.operation.value) for name, item in summaries.items()}
    draws = {
        name: stats.bootstrap_means(np.log(values), maps, seeds[name])
        for name, (values, maps) in ratios.items()
    }

    def mean_without(left_out: str | None) -> Interval:
        kept = [name for name in logs if name != left_out]
        drawn = np.mean([draws[name] for name in kept], axis=0)
        mean = stats.middle_of(float(np.mean([logs[name] for name in kept])), drawn)
        return Interval(*(float(np.exp(end)) for end in mean))

    return FamilyMeans(mean_without(None), {name: mean_without(name) for name in logs})


def compare_with_none(rows: Iterable[Row] | StoredRows, seed: int = 0) -> list[PairedComparison]:
    """Compare every variant that had waypoints with its method without any, at scale 1."""
    stored = StoredRows.of(rows)
    variants = sorted(stored.variants('scale = 1'), key=attrgetter('report_order'))
    return [
        compared(stored, variant, none, seed)
        for variant in variants
        if variant.source != 'none' and (none := Variant(variant.method)) in variants
    ]


def compared(stored: StoredRows, variant: Variant, none: Variant, seed: int) -> PairedComparison:
    """Compare a variant with its method without waypoints, with and without its failures."""
    pairs = stored.arrays('solved_pairs', *variant, *none)
    _, maps = stats.known(pairs['operation'], pairs['map'])
    answered = np.where(pairs['failed'], np.nan, pairs['operation'])
    every = (pairs['operation'], pairs['length'], answered)
    work, length, without = (stats.ratio_interval(own, pairs['map'], seed) for own in every)
    asked = len(stored.arrays('own_numbers', *variant)['map'])
    return PairedComparison(
        variant, len(maps), len(np.unique(maps)), work, length, asked,
        failures_of(stored, variant), (without, int((~np.isnan(answered)).sum())),
    )  # fmt: skip


def growth(rows: Iterable[Row] | StoredRows) -> list[Growth]:
    """Return the growth of every variant that was run at more than one scale.

    Only samples with a valid path at every scale of the variant count, so that all its factors
    are over the same samples.
    """
    stored, found = StoredRows.of(rows), []
    for variant in stored.variants():
        solved = stored.arrays('solved_at_scales', *variant)
        scales = np.unique(solved['scale'])
        if len(scales) < 2 or 1 not in scales:
            continue
        everywhere = solved['times'] == len(scales)
        for quantity in GROWING_COLUMNS:
            values = solved[quantity][everywhere].reshape(len(scales), -1)
            base = values[scales.tolist().index(1)]
            factors = tuple(growth_factor(of_scale, base) for of_scale in values)
            slope = log_log_slope(scales, factors) if len(base) else math.nan
            found.append(
                Growth(variant, quantity, len(base), tuple(scales.tolist()), factors, slope)
            )
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
