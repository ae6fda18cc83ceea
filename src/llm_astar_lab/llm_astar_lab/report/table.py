# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""A table as data, columns and rows of cells, and as Markdown, LaTeX and text.

`tables.yaml` says which columns the tables have.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from itertools import compress
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from jinja2 import ChainableUndefined, Environment, Undefined
from llm_astar_msgs_adapter.errors import printable, shortened

from llm_astar_lab.analysis.replies import reply_shares
from llm_astar_lab.analysis.statistics import UNKNOWN, Interval, Ratio
from llm_astar_lab.analysis.summary import Growth, RunSummary, VariantSummary
from llm_astar_lab.report import sentences
from llm_astar_lab.results.folder import ResultsFolder
from llm_astar_lab.templates import render

# A number that is NaN is unknown.
Cell = str | float | Interval
TextRows = list[tuple[str, ...]]
# What numbers of a unit are multiplied by, and their decimals.
UNITS = {
    'text': (1.0, 2), 'number': (1.0, 2), 'count': (1.0, 0), 'tenth': (1.0, 1), 'p': (1.0, 3),
    'seconds': (1.0, 6), 'percent': (100.0, 2), 'share': (100.0, 1),
    'whole percent': (100.0, 0), 'ms': (1e3, 3),
}  # fmt: skip
# The columns of each table.
DESCRIPTIONS = yaml.safe_load(Path(__file__).with_name('tables.yaml').read_text('utf-8'))
# The end of the unit of a column that is left out where nothing in it is known.
IF_KNOWN = ' if known'
# Characters of a text in a table.
MAX_CELL = 300
# What has a meaning in LaTeX, or no glyph in its usual fonts.
LATEX = str.maketrans({
    '\\': r'\textbackslash{}', '{': r'\{', '}': r'\}', '$': r'\$', '&': r'\&', '#': r'\#',
    '%': r'\%', '_': r'\_', '^': r'\textasciicircum{}', '~': r'\textasciitilde{}',
    '<': r'\textless{}', '>': r'\textgreater{}', '|': r'\textbar{}',
    '↓': r'$\downarrow$', '↑': r'$\uparrow$',
})  # fmt: skip
# A ratio that was not measured is None, and what it has unknown.
EXPRESSIONS = Environment(undefined=ChainableUndefined, autoescape=True)
EXPRESSIONS.filters.update(
    label=sentences.variant_label, method=sentences.method_label, model=sentences.model_label,
    effect=sentences.effect_on, shares=sentences.shares_text, counts=sentences.counts_text,
)  # fmt: skip
EXPRESSIONS.globals['unknown'] = UNKNOWN


class Column(NamedTuple):
    """A column: its head, and the unit of its numbers, of UNITS."""

    head: str
    unit: str = 'text'


@dataclass(frozen=True)
class Table:
    """A table of a report; `name` is that of its files, and every row has a cell a column."""

    name: str
    title: str
    columns: Sequence[Column]
    rows: Sequence[tuple[Cell, ...]]
    note: str = ''

    @classmethod
    def of(
        cls, name: str, items: Iterable[object] = (), each: Sequence[str] = (), **words: str
    ) -> Table:
        """Return the table that `tables.yaml` describes by this name, with a row for each item.

        `each` are the names of columns that are there several times. `words` are known to the
        expressions, fill the note and the names of units, and may be another `title` and `more`
        of the note.
        """
        found = DESCRIPTIONS[name]
        described = [
            (head.replace('{}', label), unit, text.replace('{}', str(number)))
            for head, (unit, text) in found['columns'].items()
            for number, label in enumerate(each if '{}' in head else ('',))
        ]
        say = expression(f'[{", ".join(text for *_, text in described)}]')
        rows = [tuple(map(known, say({**words, **values_of(item)}))) for item in items]
        units = [words.get(unit, unit.removesuffix(IF_KNOWN)) for _, unit, _ in described]
        columns = [Column(head, unit) for (head, *_), unit in zip(described, units)]
        is_kept = [
            not unit.endswith(IF_KNOWN)
            or any(cell_text(row[number], columns[number]) not in ('', '-') for row in rows)
            for number, (_, unit, _) in enumerate(described)
        ]
        title = words.get('title') or found['title']
        note = found.get('note', '').format(**words) + words.get('more', '')
        shown = [tuple(compress(row, is_kept)) for row in rows]
        return cls(name, title, [*compress(columns, is_kept)], shown, note)

    def without_constants(self) -> tuple[Table, str]:
        """Return it without the columns that say the same in every row, and what they say.

        A cell with a dash has no value. The first column and those of a single row are kept.
        """
        heads, rows = texts_of(self)
        values = [sorted(set(column) - {'-'}) for column in zip(*rows)]
        is_kept = [
            number == 0 or len(found) > 1 or (len(rows) == 1 and bool(found))
            for number, found in enumerate(values)
        ]
        said = zip(heads, values, is_kept)
        common = [f'{head} {found[0]}' for head, found, kept in said if found and not kept]
        columns = tuple(compress(self.columns, is_kept))
        shown = [tuple(compress(row, is_kept)) for row in self.rows]
        return replace(self, columns=columns, rows=shown), ', '.join(common)


@cache
def expression(text: str) -> Callable[[Mapping[str, Any]], Any]:
    """Return what evaluates an expression of jinja."""
    return EXPRESSIONS.compile_expression(text)


def values_of(item: Any) -> Mapping[str, Any]:  # noqa: ANN401 - of any type with names
    """Return the values of an object by name."""
    if isinstance(item, Mapping):
        return item
    found: Mapping[str, Any] = item._asdict() if hasattr(item, '_asdict') else vars(item)
    return found


def known(value: Cell | Undefined | None) -> Cell:
    """Return a cell; what is None or not there is unknown."""
    return math.nan if value is None or isinstance(value, Undefined) else value


def texts_of(table: Table) -> tuple[tuple[str, ...], TextRows]:
    """Return the heads of a table and its rows as they are read."""
    heads = tuple(column.head for column in table.columns)
    return heads, [tuple(map(cell_text, row, table.columns)) for row in table.rows]


def cell_text(cell: Cell, column: Column) -> str:
    """Write a cell in one line, a text of at most MAX_CELL characters.

    A number has its interval unless that is a point or unknown, and is `-` where it is NaN.
    """
    if isinstance(cell, str):
        return shortened(printable(cell), MAX_CELL)
    factor, digits = UNITS[column.unit]
    ends = cell if isinstance(cell, Interval) else (cell, math.nan, math.nan)
    value, low, high = (f'{factor * end:.{digits}f}' for end in ends)
    if math.isnan(ends[0]):
        return '-'
    if math.isnan(ends[1]) or math.isclose(factor * ends[1], factor * ends[2]):
        return value
    return f'{value} ({low} to {high})'


def markdown(table: Table) -> str:
    """Return a table as Markdown, whatever its cells hold; empty without rows."""
    heads, rows = texts_of(table)
    return markdown_table(heads, [[cell.replace('|', r'\|') for cell in row] for row in rows])


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return texts as a Markdown table; empty without rows."""
    lines = [head, ['---'] * len(head), *rows] if rows else []
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in lines)


def text_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return texts as a table for a terminal, its columns aligned."""
    lines = [head, *rows]
    widths = [max(map(len, column)) for column in zip(*lines)]
    return '\n'.join('  '.join(map(str.ljust, line, widths)).rstrip() for line in lines)


def latex(table: Table) -> str:
    r"""Return a table as a LaTeX `table` for `\input`, without columns that say nothing.

    It takes the packages booktabs and adjustbox.
    """
    shown, common = table.without_constants()
    heads, rows = texts_of(shown)
    note = f'{table.note} In all rows that have it: {common}.' if common else table.note
    caption = latex_text(f'{table.title}. {note}'.strip())
    has_texts = [any(isinstance(cell, str) for cell in cells) for cells in zip(*shown.rows)]
    return render(
        'report/table.tex.j2', name=table.name, caption=caption,
        sides=''.join('l' if is_text else 'r' for is_text in has_texts),
        lines=[' & '.join(map(latex_text, line)) for line in (heads, *rows)],
    )  # fmt: skip


def latex_text(words: str) -> str:
    r"""Return a text that LaTeX prints as it is, also at the beginning of a row.

    There `[` and `*` would belong to the `\\` of the row above.
    """
    quoted = printable(words).translate(LATEX)
    return f'{{}}{quoted}' if quoted.startswith(('[', '*')) else quoted


def json_of(value: Any) -> Any:  # noqa: ANN401 - any JSON value
    """Return figures as JSON values: dataclasses and named tuples become objects."""
    if isinstance(value, Ratio):
        return {**value.mean._asdict(), 'spread': value.spread._asdict()}
    if is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    elif hasattr(value, '_asdict'):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {name: json_of(item) for name, item in value.items()}
    return value


def write_tables(folder: ResultsFolder, tables: Sequence[Table]) -> list[Path]:
    """Write each table to tables/NAME.tex of a folder; return the files. Raises ResultsError."""
    return [folder.write_text(f'tables/{table.name}.tex', latex(table)) for table in tables]


# Families that the tables show; summary.json has all.
MAX_FAMILIES = 12


def report_tables(run: RunSummary) -> list[Table]:
    """Return the tables of a report that have rows, in its order."""
    guided = [item for item in run.variants if item.variant.source != 'none']
    every = [
        Table.of('main', run.variants),
        Table.of('over_none', [item for item in run.comparisons if item.samples]),
        Table.of('spread', run.variants), Table.of('waypoints', guided), reply_table(run.variants),
        Table.of('paths', run.variants), *family_tables(run.variants),
        growth_table(run.growths),
        Table.of('paper', () if run.metadata.get('bags') else DESCRIPTIONS['paper']['items']),
    ]  # fmt: skip
    return [table for table in every if table.rows]


def reply_table(summaries: Sequence[VariantSummary]) -> Table:
    """Return the table of what was wrong with each model's replies, once for all methods."""
    of_model = {item.variant[1:]: item for item in reversed(summaries) if item.replies}
    chosen = reversed(of_model.values())
    return Table.of(
        'replies', [vars(item) | {'reply_shares': reply_shares(item.replies)} for item in chosen]
    )


def family_tables(summaries: Sequence[VariantSummary]) -> Iterator[Table]:
    """Yield the tables by family of maps; without rows where there are no two families."""
    every = list(dict.fromkeys(name for item in summaries for name in item.families))
    names = every[:MAX_FAMILIES]
    note = f' The first {len(names)} of {len(every)} families.' if names != every else ''
    complete = [
        vars(item) | {'families': [item.families[name] for name in names]}
        for item in summaries
        if names and all(name in item.families for name in names)
    ]
    left_out = [
        vars(item) | {'without': [means.without[name] for name in names]}
        for item in summaries
        if (means := item.family_means).without
    ]
    shown = {
        'families': [
            item for item in complete if any(f.operation.value > 0 for f in item['families'])
        ],
        'families_valid': [
            item for item in complete if any(f.valid.value < 1.0 for f in item['families'])
        ],
        'families_left_out': left_out,
    }
    for name, items in shown.items():
        yield Table.of(name, items, [label or 'unknown' for label in names], more=note)


def growth_table(growths: Sequence[Growth]) -> Table:
    """Return the table of growth factors, with a column for each scale."""
    scales = sorted({scale for growth in growths for scale in growth.scales})
    items = []
    for growth in growths:
        factors = dict(zip(growth.scales, growth.factors))
        known = [factors.get(scale, math.nan) for scale in scales]
        items.append(vars(growth) | {'factors': known})
    return Table.of('growth', items, [str(scale) for scale in scales])
