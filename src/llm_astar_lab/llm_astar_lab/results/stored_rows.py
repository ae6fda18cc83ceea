# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The rows of a run in a temporary DuckDB database: read from CSV and Parquet files, and queried.

The database takes MEMORY at most and keeps the rest in a folder in TMPDIR. It loads no extension,
and nothing that a file contains becomes part of a query.
"""
# ruff: noqa: S608 - queries are put together from the names of columns and of tables alone

from __future__ import annotations

import csv
import os
import re
import shutil
import stat
import tempfile
import weakref
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from glob import escape
from itertools import count, groupby
from operator import itemgetter
from pathlib import Path
from typing import Any, BinaryIO

import duckdb
import numpy as np
from llm_astar_msgs_adapter.errors import shortened
from numpy.typing import NDArray

import llm_astar_planner
from llm_astar_lab.results import row as rows_of
from llm_astar_lab.results.row import COLUMNS, ResultsError, Row, Variant
from llm_astar_lab.templates import TEMPLATES

# What reading takes at most, and what queries about one variant do.
MEMORY, QUERY_MEMORY = '112MB', '32MB'
SETTINGS: dict[str, Any] = {
    'threads': 1, 'max_temp_directory_size': '32GB',
    'autoinstall_known_extensions': False, 'autoload_known_extensions': False,
}  # fmt: skip
# Bytes of one line of CSV, and of what is read at a time.
MAX_LINE_BYTES, BUFFER_BYTES = 16_000_000, 32_000_000
# Whole numbers from here on are no exact floats.
MAX_INTEGER = 2**53
# Rows and bytes of a group of a Parquet file that somebody else wrote.
MAX_GROUP_ROWS, MAX_GROUP_BYTES = 2**17, 2**28
SQL_TYPES = {'int': 'BIGINT', 'float': 'DOUBLE', 'str': 'VARCHAR'}
INTEGERS = [name for name, kind in COLUMNS.items() if kind == 'int']
KEY = 'map, pair, scale, method, source, prompt, model'
# Conditions of queries.
ANSWERED = f'source_status IN ({", ".join(map(repr, sorted(rows_of.FINAL_STATUSES)))})'
UNANSWERED = f'NOT {ANSWERED}'
QUERIES = TEMPLATES.get_template('results/queries.sql.j2', globals={'ANSWERED': ANSWERED}).module
# Rows that are fetched at a time, and of a group of a Parquet file.
FETCHED_ROWS, GROUP_ROWS = 1000, 2048
PARQUET = f'FORMAT parquet, COMPRESSION zstd, ROW_GROUP_SIZE {GROUP_ROWS}'
SCHEMAS = map('run{}'.format, count())

# The variants that each sample (map, pair, scale) was run with.
Finished = dict[tuple[int, int, int], frozenset[Variant]]


class StoredRows:
    """The rows of a run that count, in the order of map, pair and scale: the table `rows`.

    Of rows with the same key the last one counts. No value is NULL: a number that is missing is
    NaN, a text that is missing is empty. `schema` names the table in queries over two runs.
    """

    def __init__(self, files: Iterable[Path] = (), beside: StoredRows | None = None) -> None:
        """Read files in this order, into the database of the rows `beside` them, or a new one.

        Raises ResultsError, which names the file and the row.
        """
        self._beside, self.schema = beside, next(SCHEMAS)
        file: Path | str = 'the rows'
        try:
            self._connect()
            self._query(f"SET memory_limit = '{MEMORY}'")
            # Whole numbers are read as floats first: DuckDB would round others without a word.
            self._create('stored', SQL_TYPES | {'int': 'DOUBLE'})
            for file in files:
                self._load(file)
            self._create('rows', SQL_TYPES)
            last = f'SELECT max(rowid) FROM stored GROUP BY {KEY}'
            self._query(
                f'INSERT INTO rows FROM stored WHERE rowid IN ({last}) '
                'ORDER BY map, pair, scale, rowid; DROP TABLE stored'
            )
            self._query(f"CHECKPOINT; SET memory_limit = '{QUERY_MEMORY}'")
        except (duckdb.Error, csv.Error, ValueError, OSError) as error:
            raise ResultsError(f'{file}: {describe(error)}') from None

    @classmethod
    def of(cls, rows: Iterable[Row] | StoredRows) -> StoredRows:
        """Return rows as stored ones, in their own order; no two of them have the same key."""
        if isinstance(rows, StoredRows):
            return rows
        stored, listed = cls(), list(rows)
        types = {'int': np.int64, 'float': np.float64, 'str': np.object_}
        given: dict[str, NDArray[Any]] = {
            name: np.array([getattr(row, name) for row in listed], dtype=types[kind])
            for name, kind in COLUMNS.items()
        }
        stored._connection.register('given', given)
        stored._query(f'INSERT INTO rows {select(COLUMNS)} FROM given')
        return stored

    def __len__(self) -> int:
        """Return the number of rows."""
        return self._number('count(*) FROM rows')

    def rows(self, condition: str = 'true') -> Iterator[Row]:
        """Yield the rows for which an SQL condition holds, without holding them."""
        cursor = self._connection.cursor()
        cursor.execute(f'SET schema = {self.schema}; FROM rows WHERE {condition}')
        while some := cursor.fetchmany(FETCHED_ROWS):
            for values in some:
                yield Row(*values)

    def arrays(self, query: str, *values: object, **words: str) -> dict[str, NDArray[Any]]:
        """Return the columns of a query by name, `query` being its name in QUERIES.

        `values` are those of its question marks; `words` are names of columns and schemas.
        """
        return self._query(getattr(QUERIES, query)(**words), *values).fetchnumpy()

    def variants(self, condition: str = 'true') -> list[Variant]:
        """Return the variants of the rows for which a condition holds, in their order there."""
        names = ', '.join(Variant._fields)
        query = f'SELECT {names} FROM rows WHERE {condition} GROUP BY ALL ORDER BY min(rowid)'
        return [Variant(*found) for found in self._query(query).fetchall()]

    def finished(self, condition: str = 'true') -> Finished:
        """Return which variants each sample has; equal sets of variants are one object."""
        keys = iter(self._query(f'SELECT {KEY} FROM rows WHERE {condition}').fetchone, None)
        done: Finished = {}
        shared: dict[frozenset[Variant], frozenset[Variant]] = {}
        for sample, of_sample in groupby(keys, key=itemgetter(0, 1, 2)):
            variants = frozenset(Variant(*key[3:]) for key in of_sample)
            done[sample] = shared.setdefault(variants, variants)
        return done

    def write(self, path: Path, condition: str = 'true') -> None:
        """Write the rows for which a condition holds to a CSV or Parquet file, by its suffix.

        Raises OSError, as on a full disk.
        """
        empty = {'float': "nullif({}, 'nan') AS {}", 'str': "nullif({}, '') AS {}", 'int': '{}'}
        cells = ', '.join(empty[kind].format(name, name) for name, kind in COLUMNS.items())
        what, how = ('*', PARQUET) if path.suffix == '.parquet' else (cells, 'FORMAT csv, HEADER')
        rows = f'SELECT {what} FROM rows WHERE {condition}'
        try:
            self._query(f'COPY ({rows}) TO {quoted(path)} ({how}, USE_TMP_FILE false)')
        except duckdb.Error as error:
            raise OSError(0, describe(error)) from None

    def _connect(self) -> None:
        if self._beside is None:
            self._place = Path(tempfile.mkdtemp(prefix='llm_astar_rows_'))
            weakref.finalize(self, shutil.rmtree, self._place, ignore_errors=True)
            settings = SETTINGS | {'temp_directory': str(self._place / 'spilled')}
            self._connection = duckdb.connect(self._place / 'rows.duckdb', config=settings)
        else:
            self._place, self._connection = self._beside._place, self._beside._connection.cursor()
        self._query(f'CREATE SCHEMA {self.schema}; SET schema = {self.schema}')

    def _load(self, path: Path) -> None:
        """Append the rows of a file. Raises ValueError, OSError, csv.Error or duckdb.Error."""
        # Before it is opened: a FIFO would be waited for until somebody writes to it.
        if not stat.S_ISREG(path.stat().st_mode):
            raise ValueError('is not a regular file')
        begin = self._number('count(*) FROM stored')
        (self._load_part if path.suffix == '.parquet' else self._load_csv)(path)
        whole = ' AND '.join(f'{n} = trunc({n}) AND abs({n}) < {MAX_INTEGER}' for n in INTEGERS)
        query = f'coalesce(min(rowid), -1) FROM stored WHERE rowid >= {begin} AND NOT ({whole})'
        if (odd := self._number(query)) >= 0:
            what = f'{", ".join(INTEGERS)}: whole numbers below {MAX_INTEGER} are expected'
            raise ValueError(f'row {odd - begin + 1}: {what}')

    def _load_csv(self, path: Path) -> None:
        with path.open('rb') as file:
            header = file.readline(MAX_LINE_BYTES)
            names = next(csv.reader([header.decode(errors='replace')]), [])
            check_header(names if header.endswith(b'\n') else [])
            complete = complete_bytes(file)
        if complete < path.stat().st_size:
            path = Path(shutil.copyfile(path, self._place / 'complete.csv'))
            os.truncate(path, complete)
        types = {name: SQL_TYPES[COLUMNS[name]] for name in names}
        types |= dict.fromkeys(INTEGERS, 'DOUBLE')
        self._query(
            f'INSERT INTO stored {select(names)} FROM read_csv({quoted(escape(str(path)))}, '
            f'columns = {types}, force_not_null = {INTEGERS}, header = true, '
            "auto_detect = false, delim = ',', quote = '\"', escape = '\"', new_line = '\\n', "
            f"compression = 'none', max_line_size = {MAX_LINE_BYTES}, "
            f'buffer_size = {BUFFER_BYTES}, hive_partitioning = false)'
        )

    def _load_part(self, path: Path) -> None:
        name = quoted(escape(str(path)))
        groups = self._query(
            'SELECT row_group_id, max(row_group_num_rows), max(row_group_bytes) '
            f'FROM parquet_metadata({name}) GROUP BY ALL'
        ).fetchall()
        for number, rows, size in groups:
            if rows > MAX_GROUP_ROWS or size > MAX_GROUP_BYTES:
                limit = f'{MAX_GROUP_ROWS} rows or {MAX_GROUP_BYTES / 1e6:.3g} MB'
                raise ValueError(f'row group {number} has over {limit}')
        scan = f'read_parquet({name}, hive_partitioning = false)'
        described = self._query(f'SELECT column_name, column_type FROM (DESCRIBE FROM {scan})')
        types = dict(described.fetchall())
        check_header(list(types))
        for column, found in types.items():
            if found != SQL_TYPES[COLUMNS[column]]:
                raise ValueError(wrong_column(column))
        self._query(f'INSERT INTO stored {select(types)} FROM {scan}')

    def _create(self, table: str, types: Mapping[str, str]) -> None:
        columns = (f'{name} {types[kind]} NOT NULL' for name, kind in COLUMNS.items())
        self._query(f'CREATE TABLE {table} ({", ".join(columns)})')

    def _number(self, query: str) -> int:
        """Return the whole number that `SELECT` with this query finds."""
        return int(self._query(f'SELECT {query}').fetchall()[0][0])

    def _query(self, query: str, *values: object) -> duckdb.DuckDBPyConnection:
        return self._connection.execute(query, values)


def select(names: Collection[str]) -> str:
    """Return the SELECT of all columns from a table that has those of these names."""
    missing = {'float': "'nan'::DOUBLE", 'str': "''", 'int': 'NULL'}
    chosen = {
        name: f'coalesce({name}, {missing[kind]})' if name in names else missing[kind]
        for name, kind in COLUMNS.items()
    }
    aliases = ' '.join(f"WHEN '{old}' THEN '{new}'" for old, new in rows_of.METHOD_ALIASES.items())
    chosen['method'] = f'CASE method {aliases} ELSE {chosen["method"]} END'
    return f'SELECT {", ".join(chosen.values())}'


def check_header(names: Sequence[str]) -> None:
    """Raise ValueError where columns are not those of a row, perhaps of an older version."""
    if list(names) != [
        name for name in COLUMNS if name in names or name not in rows_of.ADDED_COLUMNS
    ]:
        version = llm_astar_planner.__version__
        raise ValueError(f'its columns are not those of version {version}')


def complete_bytes(file: BinaryIO) -> int:
    """Return where the last complete line of a file ends."""
    end = file.seek(0, os.SEEK_END)
    while end > 0:
        begin = file.seek(max(0, end - 65536))
        last = file.read(end - begin).rfind(b'\n')
        if last >= 0:
            return begin + last + 1
        end = begin
    return 0


def describe(error: Exception) -> str:
    """Say in one line what is wrong with a file, with the line of a CSV file."""
    text = str(error)
    if isinstance(error, OSError):
        return error.strerror or text
    if of_system := re.search(r'"errno":"(\d+)"', text):
        return os.strerror(int(of_system[1]))
    if missing := re.search(r'NOT NULL constraint failed: \w+\.(\w+)', text):
        return wrong_column(missing[1])
    known = re.search(r'(?m)^(Error when converting|Value with|Invalid uni|Maximum line).*', text)
    problem = shortened(known[0] if known else text.partition('\n')[0])
    if columns := re.search(r'Expected Number of Columns: (\d+)', text):
        problem = f'{columns[1]} values are expected'
    line = re.search(r'CSV Error on Line: (\d+)', text)
    return f'line {line[1]}: {problem}' if line else problem


def wrong_column(name: str) -> str:
    """Say of which type a column has to be."""
    return f'column {name}: {COLUMNS[name]} without missing values is expected'


def quoted(path: Path | str) -> str:
    """Return a path as a text of SQL."""
    return "'" + str(path).replace("'", "''") + "'"
