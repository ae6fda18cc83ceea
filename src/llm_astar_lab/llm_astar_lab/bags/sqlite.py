"""Reads sqlite3 files of rosbag2, of every version."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from llm_astar_lab.bags.files import LARGEST, BagError, Channel, Record

TABLES = ('messages', 'topics', 'message_definitions')
# Texts are only read where they are no longer; no definition that is used is.
SHORT = f'length({{}}) <= {2**20}'
MOST_TOPICS = 10_000


class SqliteReader:
    """One db3 file, opened read-only; a Storage."""

    def __init__(self, path: Path) -> None:
        """Open a file. Raises BagError where it does not hold a bag."""
        self.path = path
        self.damage: str | None = None
        # A write-ahead log next to it holds its last messages and needs a real connection.
        log = path.with_name(path.name + '-wal')
        mode = 'ro' if log.exists() and log.stat().st_size else 'ro&immutable=1'
        uri = f'{path.resolve().as_uri()}?mode={mode}'
        try:
            self._connection = sqlite3.connect(uri, uri=True)
            # Without this, sqlite refuses a file that is shorter than its header says.
            self._connection.execute('PRAGMA writable_schema=ON')
            check_tables(self._connection)
            self._channels = dict(self._read_channels())
        except (sqlite3.Error, ValueError, OverflowError) as error:
            raise BagError(f'{path}: is not a bag that sqlite3 can read: {error}') from None

    @property
    def channels(self) -> list[Channel]:
        """The topics of the file."""
        return list(self._channels.values())

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    def stamps(self) -> Iterator[tuple[str, int]]:
        """Yield topic and time (ns) of every message, in the order of recording."""
        for number, time in self.rows('SELECT topic_id, timestamp FROM messages ORDER BY id'):
            if number in self._channels and isinstance(time, int):
                yield self._channels[number].topic, time

    def records(self, topics: Collection[str], *, as_recorded: bool) -> Iterator[Record]:
        """Yield the messages of topics, in order of time or of recording."""
        wanted = {n: c.topic for n, c in self._channels.items() if c.topic in topics}
        chosen = ','.join(str(number) for number in wanted)
        order = 'id' if as_recorded else 'timestamp, id'
        query = (
            'SELECT topic_id, timestamp, data FROM messages '  # noqa: S608 - numbers alone
            f'WHERE topic_id IN ({chosen}) AND length(data) <= {LARGEST} ORDER BY {order}'
        )
        for number, time, data in self.rows(query):
            if isinstance(time, int) and isinstance(data, bytes):
                yield Record(wanted[number], time, data)

    def rows(self, query: str) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of a query, up to where the file is damaged."""
        count = 0
        try:
            for row in self._connection.execute(query):
                yield row
                count += 1
        except sqlite3.Error as error:
            self.damage = (
                f'{self.path}: is damaged ({error}); the {count} messages before are read'
            )

    def _read_channels(self) -> Iterator[tuple[int, Channel]]:
        """Yield the topics of the file with their numbers."""
        definitions = {}
        # Bags from before Iron have no definitions.
        with suppress(sqlite3.OperationalError):
            definitions = {
                msgtype: (text, form)
                for msgtype, text, form in self._connection.execute(
                    'SELECT topic_type, encoded_message_definition, encoding '  # noqa: S608
                    f'FROM message_definitions WHERE {SHORT.format("encoded_message_definition")}'
                )
            }
        query = (
            'SELECT id, name, type, serialization_format FROM topics '  # noqa: S608 - constants
            f'WHERE {SHORT.format("name")} LIMIT {MOST_TOPICS}'
        )
        for number, topic, msgtype, encoding in self._connection.execute(query):
            text, form = definitions.get(msgtype, ('', ''))
            channel = Channel(topic, msgtype, text, form, encoding)
            if all(isinstance(item, str) for item in channel):
                yield number, channel


def check_tables(connection: sqlite3.Connection) -> None:
    """Raise ValueError where a bag's table is a view or has computed columns.

    What these yield takes as much time and memory as their author likes.
    """
    for name in TABLES:
        found = connection.execute(
            'SELECT type, sql FROM sqlite_master WHERE lower(name) = ?', (name,)
        ).fetchall()
        plain = all(kind == 'table' and 'VIRTUAL' not in str(sql).upper() for kind, sql in found)
        columns = connection.execute('SELECT hidden FROM pragma_table_xinfo(?)', (name,))
        if not plain or any(hidden for (hidden,) in columns):
            raise ValueError(f'{name} is no plain table')
