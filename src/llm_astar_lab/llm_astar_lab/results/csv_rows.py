"""The rows of a run in results.csv: appended as samples finish, read line by line."""

from __future__ import annotations

import csv
import io
import math
import stat
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, TextIO

from llm_astar_msgs_adapter.errors import shortened

import llm_astar_planner
from llm_astar_lab.results.row import (
    ADDED_COLUMNS,
    COLUMNS,
    METHOD_ALIASES,
    ResultsError,
    Row,
    RowKey,
    Variant,
)

# Bytes of one line.
MAX_LINE_BYTES = 16_000_000
MAX_INTEGER = 2**53
# Columns whose texts stand in many rows and are kept once: so many of them, of so many characters.
SHARED_COLUMNS = (
    'method', 'source', 'prompt', 'model', 'code', 'source_status', 'guided_by', 'verdicts', 'bag',
    'map_digest', 'family',
)  # fmt: skip
MAX_SHARED, MAX_SHARED_CHARS = 10_000, 200
KEY_COLUMNS = ('map', 'pair', 'scale', 'method', 'source', 'prompt', 'model')

# The turning points of a path through a maze exceed csv's default limit of 131072 characters.
csv.field_size_limit(2**31 - 1)


class RowParser:
    """Makes rows of the cells of CSV lines whose columns have these names."""

    def __init__(self, names: Sequence[str]) -> None:
        """Take the header. Raises ValueError for columns that are not those of a row."""
        if not is_header(names):
            version = llm_astar_planner.__version__
            raise ValueError(f'its columns are not those of version {version}')
        self._names = tuple(names)
        converters: dict[str, Callable[[str], Any]] = {'int': parse_integer, 'float': parse_number}
        converters |= dict.fromkeys(SHARED_COLUMNS, self._share)
        converters['method'] = lambda name: METHOD_ALIASES.get(name, self._share(name))
        kinds = [name if name in SHARED_COLUMNS else COLUMNS[name] for name in names]
        self._converters = [
            (index, converters[kind]) for index, kind in enumerate(kinds) if kind in converters
        ]
        self._key = [self._names.index(name) for name in KEY_COLUMNS]
        self._shared: dict[str, str] = {}
        self._variants: dict[tuple[str, ...], Variant] = {}

    def row(self, cells: Sequence[str]) -> Row:
        """Return the row of a line. Raises ValueError."""
        self._check(cells)
        values: list[Any] = list(cells)
        for index, convert in self._converters:
            values[index] = convert(values[index])
        return Row(**dict(zip(self._names, values)))

    def key(self, cells: Sequence[str]) -> RowKey:
        """Return what identifies the row of a line. Raises ValueError."""
        self._check(cells)
        number, pair, scale, *names = (cells[index] for index in self._key)
        variant = self._variants.get(tuple(names))
        if variant is None:
            method, source, prompt, model = names
            variant = Variant(METHOD_ALIASES.get(method, method), source, prompt, model)
            self._variants[tuple(names)] = variant
        return parse_integer(number), parse_integer(pair), parse_integer(scale), variant

    def _check(self, cells: Sequence[str]) -> None:
        if len(cells) != len(self._names):
            raise ValueError(f'{len(self._names)} values are expected')

    def _share(self, text: str) -> str:
        if len(text) > MAX_SHARED_CHARS or len(self._shared) >= MAX_SHARED:
            return text
        return self._shared.setdefault(text, text)


class CsvRows:
    """The rows of one CSV file; a position is the offset in bytes of the line of a row."""

    def __init__(self, path: Path) -> None:
        """Name the file; nothing is read yet."""
        self.path = path

    @property
    def has_rows(self) -> bool:
        """Whether there is anything below the header."""
        if not self.path.exists():
            return False
        with self.path.open('rb') as file:
            return bool(file.readline()) and bool(file.readline().endswith(b'\n'))

    def clear(self) -> None:
        """Replace the file by one without rows. Raises OSError."""
        with replacing(self.path) as file:
            file.write(format_csv([list(COLUMNS)]))

    def append(self, rows: Iterable[Row]) -> None:
        """Append rows. Raises OSError; the rows before are kept then."""
        text = format_csv([format_row(row) for row in rows])
        with self.path.open('a', encoding='utf-8', newline='') as file:
            file.write(text)

    def keep(self, wanted: Callable[[Row], bool]) -> None:
        """Drop rows that are not wanted, and a last line that was cut short; replace the file.

        Raises ResultsError or OSError; the file is as before then.
        """
        with replacing(self.path) as file:
            file.write(format_csv([list(COLUMNS)]))
            for _, row in self._read(RowParser.row):
                if wanted(row):
                    file.write(format_csv([format_row(row)]))

    def stored_keys(self) -> Iterator[tuple[int, RowKey]]:
        """Yield position and key of every complete line, in the order of the file."""
        return self._read(RowParser.key)

    def rows(self, positions: Iterable[int]) -> Iterator[Row]:
        """Yield the rows at some positions. Raises ResultsError."""
        with open_regular(self.path) as file:
            parser = RowParser(next(csv.reader(complete_lines(file)), []))
            for position in positions:
                if file.tell() != position:
                    file.seek(position)
                try:
                    yield parser.row(next(csv.reader(complete_lines(file))))
                except (csv.Error, ValueError) as error:
                    raise ResultsError(
                        f'{self.path}: byte {position}: {shortened(str(error))}'
                    ) from None

    def _read(self, parse: Callable[[RowParser, Sequence[str]], Any]) -> Iterator[tuple[int, Any]]:
        """Yield position and parsed line of every complete line. Raises ResultsError."""
        with open_regular(self.path) as file:
            reader = csv.reader(complete_lines(file))
            try:
                parser = RowParser(next(reader, []))
            except (csv.Error, ValueError) as error:
                raise ResultsError(f'{self.path}: {error}') from None
            position = file.tell()
            try:
                for cells in reader:
                    yield position, parse(parser, cells)
                    position = file.tell()
            except (csv.Error, ValueError) as error:
                raise ResultsError(
                    f'{self.path}: line {reader.line_num}: {shortened(str(error))}'
                ) from None


def is_header(names: Sequence[str]) -> bool:
    """Tell whether columns are those of a row, perhaps of an older version."""
    return list(names) == [name for name in COLUMNS if name in names or name not in ADDED_COLUMNS]


def parse_number(text: str) -> float:
    """Read a number; NaN is an empty cell. Raises ValueError."""
    return float(text) if text else math.nan


def parse_integer(text: str) -> int:
    """Read a whole number that a float can hold, as summaries do. Raises ValueError."""
    value = int(text)
    if abs(value) > MAX_INTEGER:
        raise ValueError(f'{shortened(text)} is above {MAX_INTEGER}')
    return value


def format_row(row: Row) -> list[str]:
    """Return the cells of a CSV line; NaN is an empty cell."""
    values = [getattr(row, name) for name in COLUMNS]
    return [
        ('' if math.isnan(value) else repr(round(value, 9)))
        if isinstance(value, float)
        else str(value)
        for value in values
    ]


def format_csv(lines: Iterable[Sequence[str]]) -> str:
    """Return lines of cells as CSV text."""
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator='\n').writerows(lines)
    return buffer.getvalue()


def complete_lines(file: BinaryIO) -> Iterator[str]:
    """Yield the lines of a file with their line ends, but for a last one without.

    Raises ValueError for a line of over MAX_LINE_BYTES bytes.
    """
    while line := file.readline(MAX_LINE_BYTES + 1):
        if len(line) > MAX_LINE_BYTES:
            raise ValueError(f'over {MAX_LINE_BYTES} bytes')
        if not line.endswith(b'\n'):
            return
        yield line.decode()


@contextmanager
def open_regular(path: Path) -> Iterator[BinaryIO]:
    """Open a regular file for reading. Raises ResultsError."""
    try:
        # Before it is opened: a FIFO would be waited for until somebody writes to it.
        if not stat.S_ISREG(path.stat().st_mode):
            raise ResultsError(f'{path}: is not a regular file')
        file = path.open('rb')
    except OSError as error:
        raise ResultsError(f'{path}: {error.strerror or error}') from None
    with file:
        yield file


@contextmanager
def replacing(path: Path) -> Iterator[TextIO]:
    """Open a text file that takes the place of `path` when it is complete. Raises OSError.

    After an error the file is as before.
    """
    with drafted(path) as draft, draft.open('w', encoding='utf-8', newline='') as file:
        yield file


@contextmanager
def drafted(path: Path) -> Iterator[Path]:
    """Name a file that takes the place of `path` when the block ends without error."""
    draft = path.with_name(f'.{path.name}.draft')
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        yield draft
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)
