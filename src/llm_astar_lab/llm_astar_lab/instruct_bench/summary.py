"""The figures of a run over a suite: shares with their intervals, seconds, tokens; and limits.

Thresholds for continuous integration are written [SOURCE[/STYLE]:]METRIC=LIMIT, such as
`grammar/free:satisfied=40`.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from llm_astar_lab.analysis.statistics import Interval, wilson_interval
from llm_astar_lab.instruct_bench.results import (
    NOT_UNDERSTOOD,
    RECOGNISED,
    VIOLATED,
    InstructionResult,
)
from llm_astar_lab.instruct_bench.runner import NO_INSTRUCTION
from llm_astar_lab.instruct_bench.suite import OK, STYLES

# Metrics in percent, and those in milliseconds with the field in seconds that they come from.
PERCENT = ('exact', 'satisfied', 'recognised', 'false_claims', 'false_clauses', 'unasked_clauses')
MILLISECONDS = {'ms': 'seconds', 'longest_ms': 'longest', 'planning_ms': 'planning_seconds'}
METRICS = (*PERCENT, *MILLISECONDS)


@dataclass(frozen=True)
class Share:
    """How many of how many."""

    count: int
    total: int

    @property
    def interval(self) -> Interval:
        """The share with its interval, NaN of nothing."""
        return wilson_interval(self.count, self.total)

    def to_json(self) -> dict[str, Any]:
        """Return count, total, and percent with its limits, null of nothing."""
        percent = [round(100 * end, 2) if self.total else None for end in self.interval]
        return {'count': self.count, 'of': self.total, 'percent': percent[0], 'from': percent[1],
                'to': percent[2]}  # fmt: skip


@dataclass(frozen=True)
class SuiteSummary:
    """The figures of some results.

    - `exact`: understood exactly, of all. `satisfied`: the path fulfils all checks, of those that
      can be met; `already`: it did so without instruction.
    - `false_claims`: reported as satisfied, but not so, of all; `false_clauses`: single clauses
      wrongly reported as satisfied, `unasked_clauses`: those that were not asked on a path that
      fails a check, both of all clauses reported as satisfied.
    - `recognised`: impossible, contradictory or irrelevant ones that were recognised or said not
      to be understood; `said_not_understood`: the latter alone; `said_violated`: of the same, a
      clause was only reported as violated.
    - `unanswered`: the source gave no answer in time.
    - `seconds`, `longest`: median and maximum of understanding; `planning_seconds`: median.
    """

    instructions: int
    exact: Share
    satisfied: Share
    already: Share
    false_claims: Share
    false_clauses: Share
    unasked_clauses: Share
    recognised: Share
    said_not_understood: Share
    said_violated: Share
    unanswered: Share
    seconds: float
    longest: float
    planning_seconds: float
    prompt_tokens: int
    output_tokens: int

    def to_json(self) -> dict[str, Any]:
        """Return the figures by name."""
        return {
            name: value.to_json() if isinstance(value, Share) else value
            for name, value in vars(self).items()
        }


def summarise(results: Sequence[InstructionResult]) -> SuiteSummary:
    """Return the figures of results, at least one."""
    possible = [result for result in results if result.instruction.expect == OK]
    hopeless = [result for result in results if result.instruction.expect != OK]
    outcomes = [result.outcome for result in results if result.outcome is not None]
    claimed = sum(len(result.claimed_clauses) for result in results)
    return SuiteSummary(
        instructions=len(results),
        exact=share(result.exact for result in results),
        satisfied=share(result.fulfilled for result in possible),
        already=share(result.already for result in possible),
        false_claims=share(result.false_claim for result in results),
        false_clauses=Share(sum(len(result.false_clauses) for result in results), claimed),
        unasked_clauses=Share(sum(len(result.unasked_clauses) for result in results), claimed),
        recognised=share(
            result.recognition in (RECOGNISED, NOT_UNDERSTOOD) for result in hopeless
        ),
        said_not_understood=share(result.recognition == NOT_UNDERSTOOD for result in hopeless),
        said_violated=share(result.recognition == VIOLATED for result in hopeless),
        unanswered=share(result.unanswered for result in results),
        seconds=statistics.median(result.seconds for result in results),
        longest=max(result.seconds for result in results),
        planning_seconds=statistics.median(result.planning_seconds for result in results),
        prompt_tokens=sum(outcome.interpretation.prompt_tokens for outcome in outcomes),
        output_tokens=sum(outcome.interpretation.output_tokens for outcome in outcomes),
    )


def share(flags: Iterable[bool]) -> Share:
    """Return how many of some flags are set."""
    listed = list(flags)
    return Share(sum(listed), len(listed))


# How results are grouped for tables: to the names of the groups that a result belongs to.
GROUPS: dict[str, Callable[[InstructionResult], Sequence[str]]] = {
    'style': lambda result: [result.instruction.style or 'unstated'],
    'language': lambda result: [result.instruction.lang],
    'clause': lambda result: result.instruction.clause_kinds or ['no clause'],
    'clauses': lambda result: [str(len(result.instruction.truth.clauses))],
    'expected': lambda result: [result.instruction.expect],
    'writer': lambda result: [result.instruction.writer or 'unstated'],
    'map': lambda result: [result.instruction.suite_map.name],
}


def by_source(results: Iterable[InstructionResult]) -> dict[str, list[InstructionResult]]:
    """Return the results of each source, in the order of the sources."""
    found: dict[str, list[InstructionResult]] = {}
    for result in results:
        found.setdefault(result.source, []).append(result)
    return found


def grouped(
    results: Sequence[InstructionResult], group: str
) -> dict[str, list[InstructionResult]]:
    """Return results by one of GROUPS, the names sorted; a result may be in several groups."""
    found: dict[str, list[InstructionResult]] = {}
    for result in results:
        for name in GROUPS[group](result):
            found.setdefault(name, []).append(result)
    return dict(sorted(found.items()))


def summary_to_json(results: Sequence[InstructionResult]) -> dict[str, Any]:
    """Return the figures of each source, all together and by each of GROUPS."""
    return {
        source: {
            'all': summarise(own).to_json(),
            **{
                group: {
                    name: summarise(part).to_json() for name, part in grouped(own, group).items()
                }
                for group in GROUPS
            },
        }
        for source, own in by_source(results).items()
    }


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
