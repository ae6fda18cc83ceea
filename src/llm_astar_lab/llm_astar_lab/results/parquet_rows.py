"""The rows of a large run in Parquet files that are written whole, by pyarrow (an extra)."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import llm_astar_planner
from llm_astar_lab.results.csv_rows import KEY_COLUMNS, drafted, is_header
from llm_astar_lab.results.row import COLUMNS, ResultsError, Row, RowKey, Variant

if TYPE_CHECKING:
    from pyarrow.parquet import ParquetFile

# Rows that are read and written at a time, and groups that are held while rows are read in order.
GROUP_ROWS, HELD_GROUPS = 2048, 4
# Of a file that somebody else wrote: rows and bytes of a group.
MAX_GROUP_ROWS, MAX_GROUP_BYTES = 2**17, 2**28


def has_pyarrow() -> bool:
    """Tell whether pyarrow is installed, without importing it."""
    return find_spec('pyarrow') is not None


class RowGroup(NamedTuple):
    """A group of `rows` rows of a part; `begin` is the position of the first over all parts."""

    part: Path
    number: int
    begin: int
    rows: int


class ParquetRows:
    """The parts in a folder; a position is the number of a row over all parts in their order."""

    def __init__(self, path: Path) -> None:
        """Name the folder; nothing is read yet."""
        self.path = path

    @property
    def parts(self) -> list[Path]:
        """The files, in the order in which they were written."""
        return sorted(self.path.glob(f'part-{6 * "[0-9]"}.parquet'))

    def add_part(self, rows: Sequence[Row]) -> None:
        """Write rows as a new part, which is there in full or not at all.

        Raises ResultsError without pyarrow, OSError as on a full disk.
        """
        parts = self.parts
        number = int(parts[-1].stem.removeprefix('part-')) + 1 if parts else 0
        write_part(self.path / f'part-{number:06d}.parquet', rows)

    def keep(self, wanted: Callable[[Row], bool]) -> None:
        """Drop rows that are not wanted, part by part. Raises ResultsError or OSError."""
        for part in self.parts:
            rows = [row for group in groups_of([part]) for row in read_group(group)]
            kept = [row for row in rows if wanted(row)]
            if not kept:
                part.unlink()
            elif len(kept) < len(rows):
                write_part(part, kept)

    def clear(self) -> None:
        """Remove all parts and the folder. Raises OSError."""
        for path in (*self.parts, *self.path.glob('.part-*.draft')):
            path.unlink()
        if self.path.is_dir():
            self.path.rmdir()

    def stored_keys(self) -> Iterator[tuple[int, RowKey]]:
        """Yield position and key of every row, part by part. Raises ResultsError."""
        for group in groups_of(self.parts):
            columns = read_columns(group, KEY_COLUMNS)
            keys = zip(*(columns[name] for name in KEY_COLUMNS))
            for position, (number, pair, scale, *names) in enumerate(keys, start=group.begin):
                yield position, (number, pair, scale, Variant(*names))

    def rows(self, positions: Iterable[int]) -> Iterator[Row]:
        """Yield the rows at some positions. Raises ResultsError."""
        groups = list(groups_of(self.parts))
        begins = [group.begin for group in groups]
        read = lru_cache(HELD_GROUPS)(read_group)
        for position in positions:
            group = groups[bisect_right(begins, position) - 1]
            yield read(group)[position - group.begin]


def write_part(path: Path, rows: Sequence[Row]) -> None:
    """Write rows to a file that takes its place when it is complete."""
    pyarrow, parquet = import_pyarrow()
    types = {'int': pyarrow.int64(), 'float': pyarrow.float64(), 'str': pyarrow.string()}
    table = pyarrow.table(
        {
            name: pyarrow.array([getattr(row, name) for row in rows], types[kind])
            for name, kind in COLUMNS.items()
        }
    )
    with drafted(path) as draft:
        parquet.write_table(table, draft, row_group_size=GROUP_ROWS, compression='zstd')


def groups_of(parts: Iterable[Path]) -> Iterator[RowGroup]:
    """Yield the groups of parts whose columns are those of a row. Raises ResultsError."""
    begin = 0
    for part in parts:
        with open_part(part) as file:
            if not is_header(file.schema_arrow.names):
                version = llm_astar_planner.__version__
                raise ResultsError(f'{part}: its columns are not those of version {version}')
            for number in range(file.metadata.num_row_groups):
                about = file.metadata.row_group(number)
                if about.num_rows > MAX_GROUP_ROWS or about.total_byte_size > MAX_GROUP_BYTES:
                    limit = f'{MAX_GROUP_ROWS} rows or {MAX_GROUP_BYTES / 1e6:.3g} MB'
                    raise ResultsError(f'{part}: row group {number} has over {limit}')
                yield RowGroup(part, number, begin, about.num_rows)
                begin += about.num_rows


def read_group(group: RowGroup) -> list[Row]:
    """Return the rows of a group. Raises ResultsError."""
    columns = read_columns(group)
    return [Row(**dict(zip(columns, values))) for values in zip(*columns.values())]


def read_columns(group: RowGroup, names: Sequence[str] | None = None) -> dict[str, list[Any]]:
    """Return columns of a group as lists by name, all by default; equal texts are one object."""
    with open_part(group.part) as file:
        table = file.read_row_group(group.number, columns=names, use_threads=False)
        # Texts of a damaged part may be numbers of texts that it does not have.
        table.validate(full=True)
        wanted = names or table.column_names
        found = {name: table.column(name).combine_chunks() for name in wanted}
        return {name: values_of(found[name], name, group.part) for name in wanted}


def values_of(array: Any, name: str, part: Path) -> list[Any]:  # noqa: ANN401 - of pyarrow
    """Return the values of a column. Raises ResultsError for another type or missing values."""
    pyarrow, _ = import_pyarrow()
    texts = pyarrow.dictionary(pyarrow.int32(), pyarrow.string())
    types = {'int': pyarrow.int64(), 'float': pyarrow.float64(), 'str': texts}
    if array.null_count or array.type != types[COLUMNS[name]]:
        kind = COLUMNS[name]
        raise ResultsError(f'{part}: column {name}: {kind} without missing values is expected')
    if COLUMNS[name] != 'str':
        return list(array.to_numpy().tolist())
    shared = array.dictionary.to_pylist()
    return [shared[index] for index in array.indices.to_numpy().tolist()]


@contextmanager
def open_part(path: Path) -> Iterator[ParquetFile]:
    """Open a part, its texts as numbers of distinct ones. Raises ResultsError."""
    pyarrow, parquet = import_pyarrow()
    try:
        names = parquet.read_schema(path).names
        texts = [name for name in names if COLUMNS.get(name) == 'str']
        with parquet.ParquetFile(path, read_dictionary=texts) as file:
            yield file
    except (pyarrow.ArrowException, OSError, UnicodeDecodeError) as error:
        raise ResultsError(f'{path}: {first_line(error)}') from None


def import_pyarrow() -> tuple[Any, Any]:
    """Return pyarrow and its parquet module. Raises ResultsError where they are missing."""
    try:
        import pyarrow  # noqa: PLC0415 - an extra
        from pyarrow import parquet  # noqa: PLC0415
    except ImportError:
        raise ResultsError('Parquet files need pyarrow: pip install pyarrow') from None
    return pyarrow, parquet


def first_line(error: Exception) -> str:
    """Return the first line of an error's text."""
    return str(error).partition('\n')[0]
