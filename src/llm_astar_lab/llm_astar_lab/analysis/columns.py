"""The numbers of many rows by variant and column, kept in a temporary file instead of memory."""

from __future__ import annotations

import weakref
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator
from tempfile import SpooledTemporaryFile

import numpy as np
from numpy.typing import NDArray

from llm_astar_lab.analysis.replies import count_problems
from llm_astar_lab.results.row import Row, Variant

# The columns that summaries are made of: fields and properties of a row, and its family's number.
NUMBERS = (
    'map', 'pair', 'found', 'answered', 'operation', 'storage', 'length', 'seconds_source',
    'seconds_search', 'seconds_round_trip', 'prompt_tokens', 'completion_tokens', 'ratio',
    'clearance', 'turns', 'unknown_length', 'recorded_length', 'instruction_satisfied',
    'recorded_instruction_satisfied', 'seconds_reply', 'family',
)  # fmt: skip
# Rows of a variant that are held before they go into the file, and bytes of a file in memory.
BLOCK_ROWS, MAX_IN_MEMORY = 1024, 8 * 2**20


class BlockFile:
    """Bytes in a temporary file without a name, which goes with the last reference to it."""

    def __init__(self) -> None:
        """Hold bytes in memory as long as they are few."""
        self._file = SpooledTemporaryFile(MAX_IN_MEMORY)  # noqa: SIM115 - closed at the end
        weakref.finalize(self, self._file.close)

    def append(self, block: bytes) -> int:
        """Add bytes and return where they begin. Raises OSError, as where the disk is full."""
        begin = self._file.seek(0, 2)
        self._file.write(block)
        return begin

    def read(self, begin: int, size: int) -> bytes:
        """Return `size` bytes that begin there."""
        self._file.seek(begin)
        return self._file.read(size)


class VariantColumns:
    """The numbers of the rows of one variant at one scale; a sample is among them once.

    `waypoints` counts the waypoints of all rows, `verdicts` these by status, `replies` the replies
    of a model by what is wrong with them. The column `family` has the numbers of families in
    `families`.
    """

    def __init__(self, file: BlockFile, families: dict[str, int]) -> None:
        """Store full blocks in `file`; other variants use it and `families` too."""
        self._file = file
        self.families = families
        self._blocks: list[int] = []
        self._held = array('d')
        self.waypoints = 0
        self.verdicts: Counter[str] = Counter()
        self.replies: Counter[str] = Counter()

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self._blocks) * BLOCK_ROWS + len(self._held) // len(NUMBERS)

    def add(self, row: Row) -> None:
        """Add the numbers of a row."""
        self._held.extend([getattr(row, name) for name in NUMBERS[:-1]])
        self._held.append(self.families.setdefault(row.family, len(self.families)))
        self.waypoints += bool(row.waypoints) + row.waypoints.count(';')
        if row.verdicts:
            self.verdicts.update(name for name in row.verdicts.split(';') if name)
        if row.reply_problems:
            self.replies.update(count_problems(row.reply_problems))
        if len(self._held) == BLOCK_ROWS * len(NUMBERS):
            self._blocks.append(self._file.append(self._table().T.tobytes()))
            self._held = array('d')

    def column(self, name: str) -> NDArray[np.float64]:
        """Return one of NUMBERS, a number a row."""
        index, size = NUMBERS.index(name), BLOCK_ROWS * array('d').itemsize
        parts = [
            np.frombuffer(self._file.read(block + index * size, size)) for block in self._blocks
        ]
        return np.concatenate([*parts, self._table()[:, index]])

    def flags(self, name: str) -> NDArray[np.bool_]:
        """Return one of NUMBERS that is true or false."""
        return np.asarray(self.column(name) == 1.0)

    def samples(self) -> NDArray[np.complex128]:
        """Return a number for the sample of each row, which orders them by map and pair."""
        return self.column('map') + 1j * self.column('pair')

    def _table(self) -> NDArray[np.float64]:
        return np.frombuffer(self._held).reshape(-1, len(NUMBERS))


class RowColumns:
    """The numbers of the rows of a run; memory grows by a few bytes a block of 1024 rows."""

    def __init__(self, rows: Iterable[Row] = ()) -> None:
        """Read rows once, of which no two have the same key; `add` takes further ones."""
        self._file = BlockFile()
        self._families: dict[str, int] = {}
        self._columns: dict[tuple[int, Variant], VariantColumns] = {}
        self._count = 0
        for row in rows:
            self.add(row)

    def __len__(self) -> int:
        """Return the number of rows."""
        return self._count

    def add(self, row: Row) -> None:
        """Add the numbers of a row."""
        key = row.scale, row.variant
        if key not in self._columns:
            self._columns[key] = VariantColumns(self._file, self._families)
        self._columns[key].add(row)
        self._count += 1

    def passing(self, rows: Iterable[Row]) -> Iterator[Row]:
        """Yield rows unchanged and add their numbers, so that others can read them as well."""
        for row in rows:
            self.add(row)
            yield row

    def at_scale(self, scale: int = 1) -> dict[Variant, VariantColumns]:
        """Return the columns of each variant at a scale, in the order of appearance."""
        return {name: found for (at, name), found in self._columns.items() if at == scale}

    def by_variant(self) -> Iterator[tuple[Variant, dict[int, VariantColumns]]]:
        """Yield each variant with its columns at every scale."""
        for variant in dict.fromkeys(name for _, name in self._columns):
            yield (
                variant,
                {
                    scale: found
                    for (scale, name), found in self._columns.items()
                    if name == variant
                },
            )


def columns_of(rows: Iterable[Row] | RowColumns) -> RowColumns:
    """Return rows as columns, unless they are that already."""
    return rows if isinstance(rows, RowColumns) else RowColumns(rows)
