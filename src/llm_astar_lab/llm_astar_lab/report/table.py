"""A table of a report as data: columns, and rows of texts, numbers and intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from llm_astar_lab.analysis.statistics import Interval

# A number that is NaN is unknown.
Cell = str | float | Interval


class Column(NamedTuple):
    """A column: its head with the unit, what numbers are multiplied by for it, and decimals."""

    head: str
    factor: float = 1.0
    digits: int = 2


@dataclass(frozen=True)
class Table:
    """A table of a report; `name` is that of its files, and every row has a cell a column."""

    name: str
    title: str
    columns: tuple[Column, ...]
    rows: Sequence[tuple[Cell, ...]]
    note: str = ''

    def with_column(self, column: Column, cells: Sequence[Cell]) -> Table:
        """Return the table with one more column on the right, unless no cell of it is known."""
        if all(is_unknown(cell) for cell in cells):
            return self
        rows = [(*row, cell) for row, cell in zip(self.rows, cells)]
        return replace(self, columns=(*self.columns, column), rows=rows)


def is_unknown(cell: Cell) -> bool:
    """Tell whether a cell holds no value."""
    if isinstance(cell, str):
        return cell in ('', '-')
    return math.isnan(cell.value if isinstance(cell, Interval) else cell)


def texts(*heads: str) -> tuple[Column, ...]:
    """Return columns of texts."""
    return tuple(Column(head) for head in heads)


def percents(*heads: str) -> tuple[Column, ...]:
    """Return columns of ratios that are written in percent."""
    return tuple(Column(head, 100.0) for head in heads)


def milliseconds(*heads: str) -> tuple[Column, ...]:
    """Return columns of seconds that are written in milliseconds."""
    return tuple(Column(head, 1e3, 3) for head in heads)
