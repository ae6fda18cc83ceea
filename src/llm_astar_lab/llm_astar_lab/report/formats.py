"""Writes tables as Markdown, LaTeX, CSV and text for a terminal."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from llm_astar_msgs_adapter.errors import printable, shortened

from llm_astar_lab.analysis.statistics import Interval
from llm_astar_lab.report.table import Cell, Column, Table
from llm_astar_lab.results.folder import ResultsFolder

# Characters of a text in a table; CSV has all.
MAX_CELL = 300
TextRows = list[tuple[str, ...]]
# What has a meaning in LaTeX, or no glyph in its usual fonts.
LATEX = str.maketrans({
    '\\': r'\textbackslash{}', '{': r'\{', '}': r'\}', '$': r'\$', '&': r'\&', '#': r'\#',
    '%': r'\%', '_': r'\_', '^': r'\textasciicircum{}', '~': r'\textasciitilde{}',
    '<': r'\textless{}', '>': r'\textgreater{}', '|': r'\textbar{}',
    '↓': r'$\downarrow$', '↑': r'$\uparrow$',
})  # fmt: skip


def write_tables(
    folder: ResultsFolder, tables: Sequence[Table], *, as_latex: bool, as_csv: bool
) -> list[Path]:
    """Write each table to tables/NAME.tex and tables/NAME.csv of a folder; return the files.

    Raises ResultsError.
    """
    files = []
    for table in tables:
        if as_latex:
            files.append(folder.write_text(f'tables/{table.name}.tex', latex(table)))
        if as_csv:
            files.append(folder.write_text(f'tables/{table.name}.csv', csv_table(table)))
    return files


def markdown(table: Table) -> str:
    """Return a table as Markdown, whatever its cells hold; empty without rows."""
    heads, rows = texts_of(table)
    quoted = [[cell.replace('|', r'\|') for cell in row] for row in rows]
    return markdown_table(heads, quoted)


def text(table: Table) -> str:
    """Return a table for a terminal, its columns aligned."""
    return text_table(*texts_of(table))


def latex(table: Table) -> str:
    r"""Return a table as a LaTeX `table` for `\input`, without columns that say nothing.

    It takes the packages booktabs and adjustbox.
    """
    shown, common = without_constant_columns(table)
    heads, rows = texts_of(shown)
    note = f'{table.note} In all rows that have it: {common}.' if common else table.note
    sides = ''.join('l' if has_texts(column) else 'r' for column in zip(*shown.rows))
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
    heads: list[str] = []
    columns: list[list[str]] = []
    for column, cells in zip(table.columns, zip(*table.rows)):
        heads.append(column.head)
        columns.append([exact(cell, column) for cell in cells])
        if any(isinstance(cell, Interval) for cell in cells):
            for name in ('low', 'high'):
                heads.append(f'{column.head}, {name}')
                limits = [getattr(cell, name, math.nan) for cell in cells]
                columns.append([exact(limit, column) for limit in limits])
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator='\n').writerows([heads, *zip(*columns)])
    return buffer.getvalue()


def exact(cell: Cell, column: Column) -> str:
    """Return the value of a cell with all its digits, in the unit of its column."""
    if isinstance(cell, str):
        return '' if cell == '-' else cell
    value = cell.value if isinstance(cell, Interval) else cell
    if math.isnan(value):
        return ''
    return str(value) if isinstance(value, int) else repr(round(column.factor * value, 9))


def texts_of(table: Table) -> tuple[tuple[str, ...], TextRows]:
    """Return the heads of a table and its rows as they are read."""
    heads = tuple(column.head for column in table.columns)
    return heads, [
        tuple(cell_text(cell, column) for cell, column in zip(row, table.columns))
        for row in table.rows
    ]


def cell_text(cell: Cell, column: Column) -> str:
    """Write a cell in one line, a text of at most MAX_CELL characters.

    A number has its interval unless that is a point or unknown, and is `-` where it is NaN.
    """
    if isinstance(cell, str):
        return shortened(printable(cell), MAX_CELL)
    ends = cell if isinstance(cell, Interval) else Interval(cell, math.nan, math.nan)
    value, low, high = (column.factor * end for end in ends)
    if math.isnan(value):
        return '-'
    digits = column.digits
    if math.isnan(low) or math.isclose(low, high):
        return f'{value:.{digits}f}'
    return f'{value:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})'


def has_texts(cells: Sequence[Cell]) -> bool:
    """Tell whether cells of a column hold texts, not numbers."""
    return any(isinstance(cell, str) for cell in cells)


def without_constant_columns(table: Table) -> tuple[Table, str]:
    """Return a table without the columns that say the same in every row, and what they say.

    A cell with a dash has no value. The first column and those of a single row are kept.
    """
    heads, rows = texts_of(table)
    values = [sorted(set(column) - {'-'}) for column in zip(*rows)]
    kept = [
        number
        for number, found in enumerate(values)
        if number == 0 or len(found) > 1 or (found and len(rows) == 1)
    ]
    common = [
        f'{heads[number]} {found[0]}'
        for number, found in enumerate(values)
        if found and number not in kept
    ]
    columns = tuple(table.columns[number] for number in kept)
    shown = [tuple(row[number] for number in kept) for row in table.rows]
    return replace(table, columns=columns, rows=shown), ', '.join(common)


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table; empty without rows."""
    if not rows:
        return ''
    lines = [head, ['---'] * len(head), *rows]
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in lines)


def text_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table for a terminal, its columns aligned."""
    lines = [head, *rows]
    widths = [max(map(len, column)) for column in zip(*lines)]
    return '\n'.join(
        '  '.join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip()
        for line in lines
    )
