# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""What a run must meet: thresholds [VARIANT:]METRIC=LIMIT, and a dataset's optimal lengths."""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

from llm_astar_msgs_adapter.errors import nearest_name
from llm_astar_msgs_adapter.maps.problem_maps import ProblemMap
from llm_astar_planner.search.methods import EXACT

from llm_astar_lab.analysis.statistics import Interval, Ratio
from llm_astar_lab.analysis.summary import VariantSummary
from llm_astar_lab.results.row import Row, Variant

# Metrics in percent. A limit is the maximum of a ratio and the minimum of a share.
RATIOS = ('operation', 'storage', 'length', 'recorded')
SHARES = ('valid', 'optimal', 'instruction', 'recorded_instruction')
# Reference lengths are printed with at least two digits.
ABSOLUTE_TOLERANCE, RELATIVE_TOLERANCE = 0.005, 1e-6
# With these heuristics A* never overestimates the remaining length.
ADMISSIBLE = frozenset({'euclidean', 'octile', 'chebyshev'})


class Threshold(NamedTuple):
    """A limit in percent on one metric of a variant, written method/source/prompt/model.

    A method alone means the method without waypoints, if that was run. Any other beginning of a
    name means all variants whose names begin with it, and no name all variants that have the
    metric.
    """

    variant: str
    metric: str
    limit: float


def parse_threshold(text: str) -> Threshold:
    """Parse [VARIANT:]METRIC=LIMIT, as `llm_astar/oracle:operation=35`. Raises ValueError."""
    left, equals, limit = text.rpartition('=')
    name, colon, metric = left.rpartition(':')
    if not equals or (colon and not name) or metric not in (*RATIOS, *SHARES):
        known = ', '.join((*RATIOS, *SHARES))
        raise ValueError(f'{text!r}: [VARIANT:]METRIC=LIMIT is expected, METRIC one of {known}')
    try:
        return Threshold(name, metric, float(limit))
    except ValueError:
        raise ValueError(f'{text!r}: {limit!r} is not a number') from None


def variants_of(name: str, known: Collection[str]) -> list[str]:
    """Return which of the known variants a name or its beginning means, all for ''."""
    if not name:
        return list(known)
    exact = [other for other in (name, f'{name}/none') if other in known][:1]
    return exact or [other for other in known if other.startswith(f'{name}/')]


def unknown_variant(thresholds: Sequence[Threshold], variants: Iterable[Variant]) -> str | None:
    """Say which threshold is about no variant of a run, before it starts, or return None."""
    known = [str(variant) for variant in variants]
    for name, *_ in thresholds:
        if not variants_of(name, known):
            which = f'this run has no such variant{nearest_name(name, known) or ";"}'
            return f'--fail-under {name}: {which} it has {", ".join(known)}'
    return None


def missed_thresholds(
    summaries: Sequence[VariantSummary], thresholds: Sequence[Threshold]
) -> list[str]:
    """Return a line for each threshold that was missed or whose variant was not run."""
    lines = []
    known = list(dict.fromkeys(str(summary.variant) for summary in summaries))
    for threshold in thresholds:
        names = variants_of(threshold.variant, known)
        # Two variants may read alike: prompt a/b of model c, and prompt a of model b/c.
        held = [summary for summary in summaries if str(summary.variant) in names]
        if not threshold.variant:
            held = [item for item in held if not math.isnan(metric_value(item, threshold.metric))]
            lines += [] if held else [unknown_metric(threshold)]
        elif not names:
            lines.append(f'{threshold.variant}: was not run; available are {", ".join(known)}')
        problems = ((summary.variant, threshold_problem(summary, threshold)) for summary in held)
        lines += [f'{variant}: {problem}' for variant, problem in problems if problem is not None]
    return lines


def metric_value(summary: VariantSummary, metric: str) -> float:
    """Return a metric of a variant in percent, NaN where it is unknown."""
    found: Ratio | Interval | None = getattr(summary, metric)
    interval = found.mean if isinstance(found, Ratio) else found
    return math.nan if interval is None else 100.0 * interval.value


def unknown_metric(threshold: Threshold) -> str:
    """Say that a metric is unknown, which misses any limit."""
    return f'{threshold.metric} is unknown, so the limit {threshold.limit:g} is not met'


def threshold_problem(summary: VariantSummary, threshold: Threshold) -> str | None:
    """Say how a variant misses a threshold, or return None where it meets it."""
    _, metric, limit = threshold
    value = metric_value(summary, metric)
    if math.isnan(value):
        return unknown_metric(threshold)
    is_met = value <= limit if metric in RATIOS else value >= limit
    where = 'above' if metric in RATIOS else 'below'
    return None if is_met else f'{metric} {value:.2f} % is {where} {limit:g}'


class Agreement(NamedTuple):
    """How many rows of a variant have the reference length.

    `first` describes the first row that has not; it is empty where all agree.
    """

    variant: Variant
    rows: int
    agreeing: int
    first: str = ''

    def __str__(self) -> str:
        """Return it as one line."""
        text = (
            f'{self.variant}: {self.agreeing} of {self.rows} rows agree with the optimal length '
            'in the dataset'
        )
        return f'{text}; the first that does not: {self.first}' if self.first else text


def agrees(length: float, reference: float) -> bool:
    """Tell whether a length equals the reference, up to the printed digits."""
    return abs(length - reference) <= ABSOLUTE_TOLERANCE + RELATIVE_TOLERANCE * length


def reference_lengths(maps: Iterable[ProblemMap]) -> dict[tuple[int, int], float]:
    """Return the reference lengths by map id and pair; barrier maps have none."""
    return {
        (item.id, pair): length
        for item in maps
        for pair, length in enumerate(getattr(item, 'optimal_lengths', ()))
        if length == length  # noqa: PLR0124 - NaN
    }


def compare_with_reference(
    rows: Iterable[Row], lengths: Mapping[tuple[int, int], float], heuristic: str
) -> list[Agreement]:
    """Compare the rows of the exact methods with the reference lengths, variant by variant.

    Only rows at scale 1 are: finer maps have other lengths. A row without a path does not agree.
    `astar` is exact only with an admissible heuristic.
    """
    exact = {EXACT, 'astar'} if heuristic in ADMISSIBLE else {EXACT}
    found: dict[Variant, Agreement] = {}
    for row in rows:
        reference = lengths.get((row.map, row.pair))
        if row.method not in exact or row.scale != 1 or reference is None:
            continue
        variant, count, agreeing, first = found.get(row.variant, Agreement(row.variant, 0, 0))
        is_equal = row.found and agrees(row.length, reference)
        first = first or ('' if is_equal else describe(row, reference))
        found[row.variant] = Agreement(variant, count + 1, agreeing + is_equal, first)
    return list(found.values())


def describe(row: Row, reference: float) -> str:
    """Say which row it is and what it has instead of the reference length."""
    found = f'length {row.length:.6f}' if row.found else row.code
    return f'map {row.map}, pair {row.pair}, {found}, in the dataset {reference:g}'
