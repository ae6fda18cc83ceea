# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The figures of a run over a suite: as tables, Markdown, JSON and CSV rows."""

import statistics
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.files import read_yaml
from llm_astar_planner.planning.report import clause_line

from llm_astar_lab.analysis.statistics import Interval, wilson_interval
from llm_astar_lab.instruct_bench.maps import SuiteError
from llm_astar_lab.instruct_bench.runner import InstructionResult
from llm_astar_lab.instruct_bench.suite import OK
from llm_astar_lab.report.table import TextRows, markdown_table, text_table
from llm_astar_lab.templates import TEMPLATES, render

# `report.yaml`: columns, groups and rows.
SHOWN = read_yaml(Path(__file__).with_name('report.yaml'), SuiteError)
IN_TERMINAL = 5
# What expressions say of results, which each table asks anew.
MAX_KEPT = 100_000
# Figures that are shown in milliseconds.
SECONDS = ('seconds', 'longest', 'planning_seconds')


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
        value, low, high = (round(100 * end, 2) if self.total else None for end in self.interval)
        return {'count': self.count, 'of': self.total, 'percent': value, 'from': low, 'to': high}


# Figures by name: shares, and numbers.
Figures = dict[str, Share | float]


def summarise(results: Sequence[InstructionResult]) -> Figures:
    """Return the figures of results, at least one.

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
    reads = [result.read for result in results if result.read is not None]
    times = [result.seconds for result in results]
    shares: Figures = {
        name: Share(*(sum(evaluated(text, result) for result in results) for text in texts))
        for name, texts in SHOWN['figures'].items()
    }
    return {
        'instructions': len(results),
        **shares,
        'seconds': statistics.median(times),
        'longest': max(times),
        'planning_seconds': statistics.median(result.planning_seconds for result in results),
        'prompt_tokens': sum(read.prompt_tokens for read in reads),
        'output_tokens': sum(read.output_tokens for read in reads),
    }


@lru_cache(MAX_KEPT)
def evaluated(text: str, result: InstructionResult) -> Any:  # noqa: ANN401 - as the text says
    """Return what an expression of `report.yaml` says of a result."""
    instruction, read, outcome = result.instruction, result.read, result.outcome
    named = {'result': result, 'instruction': instruction, 'read': read, 'outcome': outcome}
    return expression(text)(is_meetable=instruction.expect == OK, **named)


@cache
def expression(text: str) -> Any:  # noqa: ANN401 - a compiled expression of jinja
    """Return an expression that takes values by name."""
    return TEMPLATES.compile_expression(text)


def by_source(results: Iterable[InstructionResult]) -> dict[str, list[InstructionResult]]:
    """Return the results of each source, in the order of the sources."""
    return collected((result.source, result) for result in results)


def grouped(
    results: Iterable[InstructionResult], group: str
) -> dict[str, list[InstructionResult]]:
    """Return results by one of the groups, the names sorted; a result may be in several."""
    _, names = SHOWN['groups'][group]
    pairs = ((name, result) for result in results for name in evaluated(names, result))
    return dict(sorted(collected(pairs).items()))


def collected(
    pairs: Iterable[tuple[str, InstructionResult]],
) -> dict[str, list[InstructionResult]]:
    """Return results by name."""
    found: dict[str, list[InstructionResult]] = {}
    for name, result in pairs:
        found.setdefault(name, []).append(result)
    return found


def summary_to_json(results: Sequence[InstructionResult]) -> dict[str, Any]:
    """Return the figures of each source, all together and by each group."""

    def figures(part: Sequence[InstructionResult]) -> dict[str, Any]:
        found = summarise(part).items()
        return {name: one.to_json() if isinstance(one, Share) else one for name, one in found}

    def parts(own: Sequence[InstructionResult], group: str) -> dict[str, Any]:
        return {name: figures(part) for name, part in grouped(own, group).items()}

    return {
        source: {'all': figures(own)} | {group: parts(own, group) for group in SHOWN['groups']}
        for source, own in by_source(results).items()
    }


def text_summary(results: Sequence[InstructionResult]) -> str:
    """Return the tables for a terminal."""
    groups = [table_of(results, 'shares', group) for group in list(SHOWN['groups'])[:IN_TERMINAL]]
    several = [table for table in groups if len({row[1] for row in table[1]}) > 1]
    tables = [table_of(results, 'shares'), table_of(results, 'details'), *several]
    return '\n\n'.join(text_table(*table) for table in tables)


def markdown_summary(results: Sequence[InstructionResult], metadata: Mapping[str, Any]) -> str:
    """Return the report: tables, false claims, what was not met, provenance."""
    return render(
        'instruct_bench/report.md.j2',
        metadata=metadata,
        tables=[markdown_table(*table_of(results, which)) for which in ('shares', 'details')],
        groups={
            title: markdown_table(*table_of(results, 'shares', group))
            for group, (title, _) in SHOWN['groups'].items()
        },
        sources=by_source(results),
        lists=SHOWN['lists'],
        evaluated=evaluated,
        one_line=one_line,
    )


def table_of(
    results: Sequence[InstructionResult], which: str, group: str = ''
) -> tuple[tuple[str, ...], TextRows]:
    """Return the head of a table and a row for each source, or for each of its part in a group.

    `which` of the columns are shown, `shares` or `details`.
    """
    columns = SHOWN[which]
    rows = [
        (source, *([name] if group else []), *figure_texts(part, columns.values()))
        for source, own in by_source(results).items()
        for name, part in (grouped(own, group) if group else {'': own}).items()
    ]
    return ('Source', *([SHOWN['groups'][group][0]] if group else []), *columns), rows


def figure_texts(results: Sequence[InstructionResult], names: Iterable[str]) -> Iterator[str]:
    """Yield figures as they are read: shares, milliseconds, and counts."""
    figures = summarise(results)
    for name in names:
        value = figures[name]
        if isinstance(value, Share):
            yield str(value.count) if name == 'unanswered' else share_text(value)
        else:
            yield f'{1000.0 * value:.2f}' if name in SECONDS else str(value)


def share_text(share: Share) -> str:
    """Write a share as `92.9 (83.0-97.2) 54/58`."""
    if not share.total:
        return '-'
    value, low, high = (100.0 * end for end in share.interval)
    return f'{value:.1f} ({low:.1f}-{high:.1f}) {share.count}/{share.total}'


def one_line(text: str) -> str:
    """Return the beginning of a text as one line without Markdown."""
    return ' '.join(text.split())[:200].replace('`', "'").replace('|', '/')


def unanswered_lines(results: Sequence[InstructionResult]) -> list[str]:
    """Return a line for each source that left instructions unanswered."""
    return [
        f'{source}: {len(own)} instructions without an answer, the first {own[0].instruction.id}: '
        f'{own[0].read.detail if own[0].read else ""}'
        for source, own in by_source(one for one in results if one.unanswered).items()
    ]


def result_row(result: InstructionResult) -> dict[str, Any]:
    """Return a result as a row of results.csv."""
    return {name: evaluated(text, result) for name, text in SHOWN['row'].items()}


def chain_text(result: InstructionResult) -> str:
    """Return one instruction in full: text, what was understood, clauses, checks, path."""
    clauses = result.outcome.to_json()['clauses'] if result.outcome else ()
    lines = map(clause_line, clauses)
    return render('instruct_bench/chain.txt.j2', result=result, clauses=lines)
