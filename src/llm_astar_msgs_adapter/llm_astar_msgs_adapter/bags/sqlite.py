"""sqlite3 files as storage, as rosbag2 has written them since its first version."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from llm_astar_msgs_adapter.bags.records import BagError, Channel, Record


class SqliteFile:
    """One db3 file, opened to be read only."""

    def __init__(self, path: Path) -> None:
        """Open a file. Raises BagError where it holds no bag."""
        self.path = path
        self.damage = ''
        # A write-ahead log beside it holds its last messages, and needs a real connection.
        log = path.with_name(path.name + '-wal')
        mode = 'ro' if log.exists() and log.stat().st_size else 'ro&immutable=1'
        uri = f'{path.resolve().as_uri()}?mode={mode}'
        try:
            self._connection = sqlite3.connect(uri, uri=True)
            # Without it a file shorter than its head says is not looked into at all.
            self._connection.execute('PRAGMA writable_schema=ON')
            self._channels = dict(self._read_channels())
        except sqlite3.Error as error:
            raise BagError(f'{path}: is no bag that sqlite3 can read: {error}') from None

    @property
    def channels(self) -> list[Channel]:
        """The topics of the file."""
        return list(self._channels.values())

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    def stamps(self) -> Iterator[tuple[str, int]]:
        """Yield topic and time of every message, in the order they were recorded."""
        for number, time in self._rows('SELECT topic_id, timestamp FROM messages ORDER BY id'):
            if number in self._channels and isinstance(time, int):
                yield self._channels[number].topic, time

    def records(self, topics: Collection[str], *, as_recorded: bool) -> Iterator[Record]:
        """Yield the messages of topics, in order of time or in that they were recorded in."""
        wanted = {n: c.topic for n, c in self._channels.items() if c.topic in topics}
        chosen = ','.join(str(number) for number in wanted)
        order = 'id' if as_recorded else 'timestamp, id'
        query = (
            'SELECT topic_id, timestamp, data FROM messages '  # noqa: S608 - numbers alone
            f'WHERE topic_id IN ({chosen}) ORDER BY {order}'
        )
        for number, time, data in self._rows(query):
            if isinstance(time, int) and isinstance(data, bytes):
                yield Record(wanted[number], time, data)

    def _rows(self, query: str) -> Iterator[tuple[Any, ...]]:
        """Yield what a query finds, up to where the file is damaged."""
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
        definitions = self._read_definitions()
        query = 'SELECT id, name, type, serialization_format FROM topics'
        for number, topic, msgtype, encoding in self._connection.execute(query):
            text, written = definitions.get(msgtype, ('', ''))
            if not all(
                isinstance(item, str) for item in (topic, msgtype, encoding, text, written)
            ):
                continue
            yield number, Channel(topic, msgtype, text, written, encoding)

    def _read_definitions(self) -> dict[str, tuple[str, str]]:
        """Return definition and its format by type; bags before Iron have none."""
        try:
            rows = self._connection.execute(
                'SELECT topic_type, encoded_message_definition, encoding FROM message_definitions'
            )
            return {msgtype: (text, written) for msgtype, text, written in rows}
        except sqlite3.OperationalError:
            return {}
