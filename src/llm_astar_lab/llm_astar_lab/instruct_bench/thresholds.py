"""Thresholds for continuous integration that a run over a suite must meet.

Written [SOURCE[/STYLE]:]METRIC=LIMIT, such as `grammar/free:satisfied=40`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from llm_astar_lab.instruct_bench.results import InstructionResult
from llm_astar_lab.instruct_bench.runner import NO_INSTRUCTION
from llm_astar_lab.instruct_bench.suite import STYLES
from llm_astar_lab.instruct_bench.summary import Share, by_source, summarise

# Metrics in percent, and those in milliseconds with the field in seconds that they come from.
PERCENT = ('exact', 'satisfied', 'recognised', 'false_claims', 'false_clauses', 'unasked_clauses')
MILLISECONDS = {'ms': 'seconds', 'longest_ms': 'longest', 'planning_ms': 'planning_seconds'}
METRICS = (*PERCENT, *MILLISECONDS)


class SuiteThreshold(NamedTuple):
    """A limit on one metric: the least, or the greatest with `is_upper`.

    An empty `source` means every source but `none`, an empty `style` all instructions.
    """

    source: str
    style: str
    metric: str
    limit: float
    is_upper: bool


def parse_suite_threshold(text: str, *, is_upper: bool) -> SuiteThreshold:
    """Parse [SOURCE[/STYLE]:]METRIC=LIMIT. Raises ValueError."""
    name, equals, limit = text.rpartition('=')
    group, _, metric = name.rpartition(':')
    source, _, style = group.partition('/')
    if not equals or metric not in METRICS or style not in ('', *STYLES):
        raise ValueError(
            f'{text!r}: [SOURCE[/STYLE]:]METRIC=LIMIT is expected, METRIC one of '
            f'{", ".join(METRICS)}, STYLE one of {", ".join(STYLES)}'
        )
    try:
        return SuiteThreshold(source, style, metric, float(limit), is_upper)
    except ValueError:
        raise ValueError(f'{text!r}: {limit!r} is not a number') from None


def missed_suite_thresholds(
    results: Sequence[InstructionResult], thresholds: Sequence[SuiteThreshold]
) -> list[str]:
    """Return a line for each threshold that was missed or whose source was not run."""
    sources = by_source(results)
    lines = [threshold_problems(sources, threshold) for threshold in thresholds]
    return [line for own in lines for line in own]


def threshold_problems(
    sources: Mapping[str, Sequence[InstructionResult]], threshold: SuiteThreshold
) -> list[str]:
    """Say which sources miss a threshold and by how much."""
    source, style, metric, limit, is_upper = threshold
    names = [source] if source else [name for name in sources if name != NO_INSTRUCTION]
    if not names or names[0] not in sources:
        return [f'{source or metric}: was not run; available are {", ".join(sources)}']
    lines = []
    for name in names:
        chosen = [result for result in sources[name] if style in ('', result.instruction.style)]
        value, unit = metric_value(chosen, metric), '%' if metric in PERCENT else 'ms'
        shown = f'{name}/{style}' if style else name
        if math.isnan(value):
            lines.append(f'{shown}: {metric} is unknown, so the limit {limit:g} is not met')
        elif value > limit if is_upper else value < limit:
            side = 'above' if is_upper else 'below'
            lines.append(f'{shown}: {metric} {value:.2f} {unit} is {side} {limit:g}')
    return lines


def metric_value(results: Sequence[InstructionResult], metric: str) -> float:
    """Return a metric of results in percent or milliseconds; NaN where it has no instructions."""
    if not results:
        return math.nan
    value = getattr(summarise(results), MILLISECONDS.get(metric, metric))
    if not isinstance(value, Share):
        return 1000.0 * float(value)
    if metric.endswith('_clauses') and not value.total:
        return 0.0
    return 100.0 * float(value.interval.value)
