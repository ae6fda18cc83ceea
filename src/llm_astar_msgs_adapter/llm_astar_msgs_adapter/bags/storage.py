"""The files of bags for rosbags' writer, such that what was written outlives a power cut.

They stand beside the folder that rosbags makes, and not in it: readers find them there also when
they are never finished.
"""

from __future__ import annotations

import sqlite3
import time
from pathlib import Path
from types import MappingProxyType

from mcap.writer import Writer as McapFile
from rosbags.interfaces import Connection, MessageDefinitionFormat
from rosbags.rosbag2 import CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer

ENCODINGS = {MessageDefinitionFormat.MSG: 'ros2msg', MessageDefinitionFormat.IDL: 'ros2idl'}
# What a power cut may cost, before compression.
CHUNK_BYTES = 64 * 1024
COMMIT_SECONDS = 1.0


class McapStorage:
    """An mcap file written by mcap's own library: zstd chunks, indices, CRCs.

    The storage that comes with rosbags leaves the checksums out, so that damage goes unseen.
    """

    def __init__(self, path: Path, compression: CompressionMode) -> None:  # noqa: ARG002 - always
        """Create the file beside the folder `path`, named after it."""
        self.path = path.with_name(f'{path.name}.mcap')
        self._stream = self.path.open('xb')
        self._file = McapFile(
            self._stream, chunk_size=CHUNK_BYTES, enable_crcs=True, enable_data_crcs=True
        )
        self._file.start(profile='ros2')
        self._schemas: dict[str, int] = {}
        self._channels: dict[int, int] = {}
        self._written: dict[int, int] = {}

    def add_msgtype(self, connection: Connection) -> None:
        """Write a message type's definition."""
        self._schemas[connection.msgtype] = self._file.register_schema(
            connection.msgtype,
            ENCODINGS[connection.msgdef.format],
            connection.msgdef.data.encode(),
        )

    def add_connection(self, connection: Connection, offered_qos_profiles: str) -> None:
        """Write a topic with the QoS it is offered with."""
        self._written[connection.id] = 0
        self._channels[connection.id] = self._file.register_channel(
            connection.topic,
            'cdr',
            self._schemas[connection.msgtype],
            {'offered_qos_profiles': offered_qos_profiles},
        )

    def write(self, connection: Connection, timestamp: int, data: bytes | memoryview) -> None:
        """Write a message at its time in nanoseconds."""
        self._written[connection.id] += 1
        self._file.add_message(
            self._channels[connection.id],
            timestamp,
            bytes(data),
            timestamp,
            self._written[connection.id],
        )
        self._stream.flush()

    def close(self, version: int, metadata: str) -> None:  # noqa: ARG002 - rosbags' own
        """Finish the file, the bag's metadata in it."""
        self._file.add_metadata('rosbag2', {'serialized_metadata': metadata})
        self._file.finish()  # type: ignore[no-untyped-call]
        self._stream.close()

    def abort(self) -> None:
        """Leave the file as it is."""
        self._stream.close()


class SqliteStorage(Sqlite3Writer):
    """A database as rosbags writes it, committed every second into a write-ahead log.

    The storage that comes with rosbags commits at its end alone, and what a power cut leaves of it
    cannot be read.
    """

    def __init__(self, path: Path, compression: CompressionMode) -> None:  # noqa: ARG002 - none
        """Create the file beside the folder `path`, named after it."""
        self.path = path.with_name(f'{path.name}.db3')
        self.conn = sqlite3.connect(self.path)
        self.conn.executescript(f'PRAGMA journal_mode=WAL; {self.SQLITE_SCHEMA}')
        self.cursor = self.conn.cursor()
        self._committed = time.monotonic()

    def write(self, connection: Connection, timestamp: int, data: bytes | memoryview) -> None:
        """Write a message at its time in nanoseconds."""
        super().write(connection, timestamp, data)
        if time.monotonic() > self._committed + COMMIT_SECONDS:
            self.conn.commit()
            self._committed = time.monotonic()

    def close(self, version: int, metadata: str) -> None:
        """Finish the file, its log put into it: with one it could not be read without writing."""
        self.conn.commit()
        self.conn.execute('PRAGMA journal_mode=DELETE')
        super().close(version, metadata)


class BagFile(Writer):
    """rosbags' writer of one file, with these storages."""

    STORAGE_PLUGINS = MappingProxyType(
        {StoragePlugin.MCAP: McapStorage, StoragePlugin.SQLITE3: SqliteStorage}
    )
