"""Thresholds for continuous integration that a run must meet: VARIANT:METRIC=LIMIT."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from llm_astar_planner.benchmark.analysis.summary import VariantSummary
from llm_astar_planner.benchmark.results import METHOD_ALIASES

# Metrics in percent. A limit is the maximum of a ratio and the minimum of a share.
RATIOS = ('operation', 'storage', 'length', 'recorded')
SHARES = ('valid', 'optimal')


class Threshold(NamedTuple):
    """A limit in percent on one metric of a variant, written method/source/prompt/model.

    A method alone means the method without waypoints, if that was run. Any other beginning of a
    name means all variants whose names begin with it.
    """

    variant: str
    metric: str
    limit: float


def parse_threshold(text: str) -> Threshold:
    """Parse VARIANT:METRIC=LIMIT, such as `llm_astar/oracle:operation=35`. Raises ValueError."""
    name, equals, limit = text.rpartition('=')
    variant, colon, metric = name.rpartition(':')
    if not (equals and colon and variant) or metric not in RATIOS + SHARES:
        known = ', '.join(RATIOS + SHARES)
        message = f'{text!r}: VARIANT:METRIC=LIMIT is expected, METRIC one of {known}'
        raise ValueError(message)
    method, slash, rest = variant.partition('/')
    try:
        return Threshold(METHOD_ALIASES.get(method, method) + slash + rest, metric, float(limit))
    except ValueError:
        raise ValueError(f'{text!r}: {limit!r} is not a number') from None


def missed_thresholds(
    summaries: Sequence[VariantSummary], thresholds: Sequence[Threshold]
) -> list[str]:
    """Return a line for each threshold that was missed or whose variant was not run."""
    lines = []
    by_name = {str(summary.variant): summary for summary in summaries}
    for threshold in thresholds:
        name = threshold.variant
        exact = [known for known in (name, f'{name}/none') if known in by_name][:1]
        names = exact or [known for known in by_name if known.startswith(f'{name}/')]
        if not names:
            lines.append(f'{name}: was not run; available are {", ".join(by_name)}')
        for known in names:
            problem = threshold_problem(by_name[known], threshold)
            if problem is not None:
                lines.append(f'{known}: {problem}')
    return lines


def threshold_problem(summary: VariantSummary, threshold: Threshold) -> str | None:
    """Say how a variant misses a threshold, or return None where it meets it."""
    _, metric, limit = threshold
    if metric in RATIOS:
        ratio = getattr(summary, metric)
        value = math.nan if ratio is None else 100.0 * float(ratio.mean.value)
    else:
        value = 100.0 * (summary.valid.value if metric == 'valid' else summary.optimal)
    if math.isnan(value):
        return f'{metric} is unknown, so the limit {limit:g} is not met'
    if metric in RATIOS:
        return None if value <= limit else f'{metric} {value:.2f} % is above {limit:g}'
    return None if value >= limit else f'{metric} {value:.2f} % is below {limit:g}'
