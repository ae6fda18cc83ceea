"""Thresholds for continuous integration that a run must meet: [VARIANT:]METRIC=LIMIT."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from typing import NamedTuple

from llm_astar_planner.parameter import nearest_name

from llm_astar_lab.analysis.statistics import Interval, Ratio
from llm_astar_lab.analysis.summary import VariantSummary
from llm_astar_lab.results.row import METHOD_ALIASES, Variant

# Metrics in percent. A limit is the maximum of a ratio and the minimum of a share.
RATIOS = ('operation', 'storage', 'length', 'recorded')
SHARES = ('valid', 'optimal', 'instruction', 'recorded_instruction')


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
    name, equals, limit = text.rpartition('=')
    variant, colon, metric = name.rpartition(':')
    if not equals or (colon and not variant) or metric not in RATIOS + SHARES:
        known = ', '.join(RATIOS + SHARES)
        message = f'{text!r}: [VARIANT:]METRIC=LIMIT is expected, METRIC one of {known}'
        raise ValueError(message)
    method, slash, rest = variant.partition('/')
    try:
        return Threshold(METHOD_ALIASES.get(method, method) + slash + rest, metric, float(limit))
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
    for threshold in thresholds:
        if not variants_of(threshold.variant, known):
            near = nearest_name(threshold.variant, known)
            return (
                f'--fail-under {threshold.variant}: this run has no such variant{near or ";"} '
                f'it has {", ".join(known)}'
            )
    return None


def missed_thresholds(
    summaries: Sequence[VariantSummary], thresholds: Sequence[Threshold]
) -> list[str]:
    """Return a line for each threshold that was missed or whose variant was not run."""
    lines = []
    by_name: dict[str, list[VariantSummary]] = defaultdict(list)
    # Two variants may read alike: prompt a/b of model c, and prompt a of model b/c.
    for summary in summaries:
        by_name[str(summary.variant)].append(summary)
    for threshold in thresholds:
        if not threshold.variant:
            lines += problems_of_all(summaries, threshold)
            continue
        names = variants_of(threshold.variant, by_name)
        if not names:
            lines.append(f'{threshold.variant}: was not run; available are {", ".join(by_name)}')
        for known in names:
            problems = (threshold_problem(summary, threshold) for summary in by_name[known])
            lines += [f'{known}: {problem}' for problem in problems if problem is not None]
    return lines


def problems_of_all(summaries: Sequence[VariantSummary], threshold: Threshold) -> list[str]:
    """Return a line for each variant that has a metric and misses its limit, or that none has."""
    having = [item for item in summaries if not math.isnan(metric_value(item, threshold.metric))]
    if not having:
        return [f'{threshold.metric} is unknown, so the limit {threshold.limit:g} is not met']
    problems = [(item.variant, threshold_problem(item, threshold)) for item in having]
    return [f'{variant}: {problem}' for variant, problem in problems if problem is not None]


def metric_value(summary: VariantSummary, metric: str) -> float:
    """Return a metric of a variant in percent, NaN where it is unknown."""
    found = getattr(summary, metric)
    if isinstance(found, Ratio):
        found = found.mean
    value = found.value if isinstance(found, Interval) else found
    return math.nan if value is None else 100.0 * float(value)


def threshold_problem(summary: VariantSummary, threshold: Threshold) -> str | None:
    """Say how a variant misses a threshold, or return None where it meets it."""
    _, metric, limit = threshold
    value = metric_value(summary, metric)
    if math.isnan(value):
        return f'{metric} is unknown, so the limit {limit:g} is not met'
    if metric in RATIOS:
        return None if value <= limit else f'{metric} {value:.2f} % is above {limit:g}'
    return None if value >= limit else f'{metric} {value:.2f} % is below {limit:g}'
