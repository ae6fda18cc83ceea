# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""A table as data, columns and rows of cells, and as Markdown, LaTeX, CSV and text.

Markdown, LaTeX and text show numbers as they are read, CSV has all their digits.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import partial
from itertools import compress
from pathlib import Path
from typing import Any, NamedTuple

from llm_astar_msgs_adapter.errors import printable, shortened

from llm_astar_lab.analysis.statistics import NO_SPREAD, UNKNOWN, Interval, Ratio
from llm_astar_lab.results.folder import ResultsFolder

# A number that is NaN is unknown.
Cell = str | float | Interval
# What a column says of an item: a function, or attributes and keys with dots between them.
Value = str | Callable[[Any], Cell]
TextRows = list[tuple[str, ...]]
# Characters of a text in a table; CSV has all.
MAX_CELL = 300
# What has a meaning in LaTeX, or no glyph in its usual fonts.
LATEX = str.maketrans({
    '\\': r'\textbackslash{}', '{': r'\{', '}': r'\}', '$': r'\$', '&': r'\&', '#': r'\#',
    '%': r'\%', '_': r'\_', '^': r'\textasciicircum{}', '~': r'\textasciitilde{}',
    '<': r'\textless{}', '>': r'\textgreater{}', '|': r'\textbar{}',
    '↓': r'$\downarrow$', '↑': r'$\uparrow$',
})  # fmt: skip
NO_RATIO = Ratio(UNKNOWN, NO_SPREAD)


class Column(NamedTuple):
    """A column: its head with the unit, what numbers are multiplied by for it, and decimals."""

    head: str
    factor: float = 1.0
    digits: int = 2
    value: Value = ''

    def cell(self, item: object) -> Cell:
        """Return what the column says of an item; a ratio that is None is unknown."""
        if callable(self.value):
            return self.value(item)
        found: Any = item
        for name in self.value.split('.'):
            found = NO_RATIO if found is None else found
            found = found[name] if isinstance(found, Mapping) else getattr(found, name)
        cell: Cell = math.nan if found is None else found
        return cell


Columns = tuple[Column, ...]


def columns(*heads: str | Mapping[str, Value], factor: float = 1.0, digits: int = 2) -> Columns:
    """Return columns of one unit, by their heads or with what each says of an item."""
    named = [part if isinstance(part, Mapping) else {part: ''} for part in heads]
    return tuple(
        Column(head, factor, digits, value) for part in named for head, value in part.items()
    )


# Columns of texts, of whole numbers, of ratios in percent, and of seconds in milliseconds.
texts = columns
counts = partial(columns, digits=0)
percents = partial(columns, factor=100.0)
milliseconds = partial(columns, factor=1e3, digits=3)


@dataclass(frozen=True)
class Table:
    """A table of a report; `name` is that of its files, and every row has a cell a column."""

    name: str
    title: str
    columns: Columns
    rows: Sequence[tuple[Cell, ...]]
    note: str = ''

    @classmethod
    def of(
        cls, name: str, title: str, columns: Columns, items: Iterable[object], note: str = ''
    ) -> Table:
        """Return the table of what its columns say of each item."""
        rows = [tuple(column.cell(item) for column in columns) for item in items]
        return cls(name, title, columns, rows, note)

    def with_column(self, column: Column, cells: Sequence[Cell]) -> Table:
        """Return the table with one more column on the right, unless no cell of it is known."""
        if all(cell_text(cell, column) in ('', '-') for cell in cells):
            return self
        rows = [(*row, cell) for row, cell in zip(self.rows, cells)]
        return replace(self, columns=(*self.columns, column), rows=rows)

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
    ends = cell if isinstance(cell, Interval) else (cell, math.nan, math.nan)
    value, low, high = (column.factor * end for end in ends)
    if math.isnan(value):
        return '-'
    digits = column.digits
    if math.isnan(low) or math.isclose(low, high):
        return f'{value:.{digits}f}'
    return f'{value:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})'


def markdown(table: Table) -> str:
    """Return a table as Markdown, whatever its cells hold; empty without rows."""
    heads, rows = texts_of(table)
    return markdown_table(heads, [[cell.replace('|', r'\|') for cell in row] for row in rows])


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return texts as a Markdown table; empty without rows."""
    lines = [head, ['---'] * len(head), *rows] if rows else []
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in lines)


def text(table: Table) -> str:
    """Return a table for a terminal, its columns aligned."""
    return text_table(*texts_of(table))


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
    has_texts = [any(isinstance(cell, str) for cell in cells) for cells in zip(*shown.rows)]
    sides = ''.join('l' if is_text else 'r' for is_text in has_texts)
    lines = [r' & '.join(map(latex_text, line)) + r' \\' for line in (heads, *rows)]
    return '\n'.join([
        r'\begin{table}', r'\centering',
        rf'\caption{{{latex_text(f"{table.title}. {note}".strip())}}}',
        rf'\label{{tab:{table.name}}}', r'\begin{adjustbox}{max width=\textwidth}',
        rf'\begin{{tabular}}{{{sides}}}', r'\toprule', lines[0], r'\midrule', *lines[1:],
        r'\bottomrule', r'\end{tabular}', r'\end{adjustbox}', r'\end{table}', '',
    ])  # fmt: skip


def latex_text(words: str) -> str:
    r"""Return a text that LaTeX prints as it is, also at the beginning of a row.

    There `[` and `*` would belong to the `\\` of the row above.
    """
    quoted = printable(words).translate(LATEX)
    return f'{{}}{quoted}' if quoted.startswith(('[', '*')) else quoted


def csv_table(table: Table) -> str:
    """Return a table as CSV, with its columns' units and all digits.

    A column with intervals becomes three, the value and the limits of its interval; what is
    unknown is an empty cell.
    """
    found: list[list[str]] = []
    for column, cells in zip(table.columns, zip(*table.rows)):
        found.append([column.head, *(exact(cell, column) for cell in cells)])
        if any(isinstance(cell, Interval) for cell in cells):
            for name in ('low', 'high'):
                limits = (getattr(cell, name, math.nan) for cell in cells)
                found.append([f'{column.head}, {name}', *(exact(end, column) for end in limits)])
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator='\n').writerows(zip(*found))
    return buffer.getvalue()


def exact(cell: Cell, column: Column) -> str:
    """Return the value of a cell with all its digits, in the unit of its column."""
    if isinstance(cell, str):
        return '' if cell == '-' else cell
    value = cell.value if isinstance(cell, Interval) else cell
    if math.isnan(value):
        return ''
    return str(value) if isinstance(value, int) else repr(round(column.factor * value, 9))


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


def write_tables(
    folder: ResultsFolder, tables: Sequence[Table], *, as_latex: bool, as_csv: bool
) -> list[Path]:
    """Write each table to tables/NAME.tex and tables/NAME.csv of a folder; return the files.

    Raises ResultsError.
    """
    renderers = [('tex', latex)] * as_latex + [('csv', csv_table)] * as_csv
    return [
        folder.write_text(f'tables/{table.name}.{ending}', render(table))
        for table in tables
        for ending, render in renderers
    ]
