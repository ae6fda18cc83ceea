"""Thresholds a run must keep, for continuous integration: CASE:METRIC=LIMIT."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import NamedTuple

from llm_astar_planner.benchmark.analysis.summary import CaseSummary

# Metrics in percent. A limit is the largest allowed value for ratios, the smallest for shares.
RATIOS = ('operation', 'storage', 'length', 'recorded')
SHARES = ('valid', 'optimal')


class Threshold(NamedTuple):
    """A limit on one metric of a case, as `method/source/prompt/model`.

    `method` alone is the one without waypoints, if there is one; any other beginning of a name
    stands for all cases that begin so.
    """

    case: str
    metric: str
    limit: float


def parse_threshold(text: str) -> Threshold:
    """Read CASE:METRIC=LIMIT, such as `llm_astar/oracle:operation=35`. Raises ValueError."""
    name, equals, limit = text.rpartition('=')
    case, colon, metric = name.rpartition(':')
    if not (equals and colon and case) or metric not in RATIOS + SHARES:
        known = ', '.join(RATIOS + SHARES)
        message = f'{text!r}: CASE:METRIC=LIMIT is expected, METRIC one of {known}'
        raise ValueError(message)
    try:
        return Threshold(case, metric, float(limit))
    except ValueError:
        message = f'{text!r}: {limit!r} is not a number'
        raise ValueError(message) from None


def missed(summaries: Sequence[CaseSummary], thresholds: Sequence[Threshold]) -> list[str]:
    """Return a line for each threshold that was missed, or whose case was not run."""
    lines = []
    by_name = {str(summary.case): summary for summary in summaries}
    for threshold in thresholds:
        names = _meant(threshold.case, by_name)
        if not names:
            lines.append(f'{threshold.case}: was not run; there is {", ".join(by_name)}')
        for name in names:
            what = _missed(_value(by_name[name], threshold.metric), threshold)
            if what:
                lines.append(f'{name}: {what}')
    return lines


def _meant(case: str, names: Collection[str]) -> list[str]:
    """Return the names of the cases a threshold is for."""
    for name in (case, f'{case}/none'):
        if name in names:
            return [name]
    return [name for name in names if name.startswith(f'{case}/')]


def _missed(value: float, threshold: Threshold) -> str:
    """Say how a value misses a threshold, '' where it keeps it."""
    metric, limit = threshold.metric, threshold.limit
    if math.isnan(value):
        return f'{metric} is unknown, which is no match for {limit:g}'
    if metric in RATIOS:
        return '' if value <= limit else f'{metric} {value:.2f} % is above {limit:g}'
    return '' if value >= limit else f'{metric} {value:.2f} % is below {limit:g}'


def _value(summary: CaseSummary, metric: str) -> float:
    if metric in RATIOS:
        ratio = getattr(summary, metric)
        return float('nan') if ratio is None else 100.0 * float(ratio.mean.value)
    return 100.0 * (summary.valid.value if metric == 'valid' else summary.optimal)
