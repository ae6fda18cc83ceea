"""Thresholds a run must keep, for continuous integration: CASE:METRIC=LIMIT."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from llm_astar_planner.benchmark.summary import CaseSummary

# Metrics in percent. A limit is the largest allowed value for ratios, the smallest for shares.
RATIOS = ('operation', 'storage', 'length', 'recorded')
SHARES = ('valid', 'optimal')


class Threshold(NamedTuple):
    """A limit on one metric of the cases named `case`, as `method/source/prompt/model`."""

    case: str
    metric: str
    limit: float


def parse_threshold(text: str) -> Threshold:
    """Read CASE:METRIC=LIMIT, such as `llm_astar/oracle:operation=35`. Raises ValueError."""
    name, equals, limit = text.rpartition('=')
    case, colon, metric = name.rpartition(':')
    if not (equals and colon and case) or metric not in RATIOS + SHARES:
        known = ', '.join(RATIOS + SHARES)
        message = f'--fail-under {text}: CASE:METRIC=LIMIT is expected, METRIC one of {known}'
        raise ValueError(message)
    try:
        return Threshold(case, metric, float(limit))
    except ValueError:
        message = f'--fail-under {text}: {limit!r} is not a number'
        raise ValueError(message) from None


def missed(summaries: Sequence[CaseSummary], thresholds: Sequence[Threshold]) -> list[str]:
    """Return a line for each threshold that was missed, or whose case was not run."""
    lines = []
    by_name = {str(summary.case): summary for summary in summaries}
    for threshold in thresholds:
        summary = by_name.get(threshold.case) or by_name.get(f'{threshold.case}/none')
        if summary is None:
            lines.append(f'{threshold.case}: was not run; there is {", ".join(by_name)}')
            continue
        value = _value(summary, threshold.metric)
        worse = 'above' if threshold.metric in RATIOS else 'below'
        kept = value <= threshold.limit if worse == 'above' else value >= threshold.limit
        if not kept:
            what = f'{threshold.metric} {value:.2f} %'
            if math.isnan(value):
                what, worse = f'{threshold.metric} is unknown, which', 'no match for'
            lines.append(f'{threshold.case}: {what} is {worse} {threshold.limit:g}')
    return lines


def _value(summary: CaseSummary, metric: str) -> float:
    if metric in RATIOS:
        ratio = getattr(summary, metric)
        return float('nan') if ratio is None else 100.0 * float(ratio.mean.value)
    return 100.0 * (summary.valid.value if metric == 'valid' else summary.optimal)
