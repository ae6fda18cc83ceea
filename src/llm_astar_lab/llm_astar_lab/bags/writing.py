"""Writes bags as rosbag2 does: a folder of files split by size, with one metadata.yaml.

Each file is complete up to the last chunk or second even if the process dies. The files lie next
to the folder that rosbags makes for each of them, so that readers find unfinished ones too.
"""

from __future__ import annotations

import contextlib
import os
import sqlite3
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import yaml
from llm_astar_msgs_adapter.errors import LlmAstarError
from mcap.writer import Writer as McapWriter
from rosbags.interfaces import (
    Connection,
    MessageDefinitionFormat,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer

from llm_astar_lab.bags.types import TypeDefinition, bag_types

STORAGES = {'mcap': StoragePlugin.MCAP, 'sqlite3': StoragePlugin.SQLITE3}
INFORMATION = 'rosbag2_bagfile_information'
ENCODINGS = {MessageDefinitionFormat.MSG: 'ros2msg', MessageDefinitionFormat.IDL: 'ros2idl'}
# How much a power cut may lose: bytes before compression, and seconds.
CHUNK_BYTES = 64 * 1024
COMMIT_SECONDS = 1.0


class BagWriteError(LlmAstarError, ValueError):
    """A bag that cannot be written; the message names its folder and what to do."""


def qos(depth: int = 10, *, latched: bool = False) -> Qos:
    """Return a reliable QoS; `latched` means transient_local, for subscribers that join late."""
    never = QosTime(9223372036, 854775807)
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=depth,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        deadline=never,
        lifespan=never,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=never,
        avoid_ros_namespace_conventions=False,
    )


LATCHED = qos(1, latched=True)


class OfferedTopic(NamedTuple):
    """A topic to be written: its full name, its type, the QoS its publishers offer."""

    name: str
    definition: TypeDefinition
    qos: tuple[Qos, ...] = ()


class McapStorageWriter:
    """Writes an mcap file by mcap's own library: zstd chunks, indices, checksums.

    The one that comes with rosbags writes no checksums, so that damage goes unseen.
    """

    def __init__(self, path: Path, compression: CompressionMode) -> None:  # noqa: ARG002 - always zstd
        """Create the file next to the folder `path`, with its name."""
        self.path = path.with_name(f'{path.name}.mcap')
        self._stream = self.path.open('xb')
        self._file = McapWriter(
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
        """Write a topic with the QoS that its publishers offer."""
        self._written[connection.id] = 0
        self._channels[connection.id] = self._file.register_channel(
            connection.topic,
            'cdr',
            self._schemas[connection.msgtype],
            {
                'offered_qos_profiles': offered_qos_profiles,
                'topic_type_hash': connection.digest,
            },
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
        """Write the bag's metadata into the file and finish it."""
        own = yaml.safe_dump(with_distro(yaml.safe_load(metadata)), sort_keys=False)
        self._file.add_metadata('rosbag2', {'serialized_metadata': own})
        self._file.finish()  # type: ignore[no-untyped-call]
        self._stream.close()

    def abort(self) -> None:
        """Close the file unfinished."""
        self._stream.close()


class SqliteStorageWriter(Sqlite3Writer):
    """Writes a database as rosbags does, but commits every second into a write-ahead log.

    The one that comes with rosbags commits only at its end, and what a power cut leaves of it
    cannot be read.
    """

    def __init__(self, path: Path, compression: CompressionMode) -> None:  # noqa: ARG002 - none
        """Create the file next to the folder `path`, with its name."""
        self.path = path.with_name(f'{path.name}.db3')
        self.conn = sqlite3.connect(self.path)
        self.conn.executescript(f'PRAGMA journal_mode=WAL; {self.SQLITE_SCHEMA}')
        self.cursor = self.conn.cursor()
        self.cursor.execute('UPDATE schema SET ros_distro = ?', (ros_distro(),))
        self._committed = time.monotonic()

    def write(self, connection: Connection, timestamp: int, data: bytes | memoryview) -> None:
        """Write a message at its time in nanoseconds."""
        super().write(connection, timestamp, data)
        if time.monotonic() > self._committed + COMMIT_SECONDS:
            self.conn.commit()
            self._committed = time.monotonic()

    def close(self, version: int, metadata: str) -> None:
        """Finish the file and merge its log: with a log it could not be opened read-only."""
        self.conn.commit()
        self.conn.execute('PRAGMA journal_mode=DELETE')
        own = yaml.safe_dump(with_distro(yaml.safe_load(metadata)), sort_keys=False)
        super().close(version, own)


class BagFileWriter(Writer):
    """rosbags' writer of one file, with the storages above."""

    STORAGE_PLUGINS = MappingProxyType(
        {StoragePlugin.MCAP: McapStorageWriter, StoragePlugin.SQLITE3: SqliteStorageWriter}
    )


class BagWriter:
    """Writes messages into a new bag as they come; a context manager.

    `counts` are the messages written, by topic. The bag is closed also where the block ends with
    an error, and what was written until then can be read. Raises BagWriteError where the disk is
    full or fails.
    """

    def __init__(self, folder: str | Path, storage: str = 'mcap', max_bytes: int = 0) -> None:
        """Prepare a bag in `folder`, `mcap` or `sqlite3`.

        After `max_bytes` of messages a file is closed and the next one begun; 0 means one file.
        Raises BagWriteError where the folder exists.
        """
        self.folder = Path(folder)
        if self.folder.exists():
            raise BagWriteError(f'{folder}: exists already; name a new folder, or remove this one')
        self.counts: dict[str, int] = {}
        self._storage = storage
        self._max_bytes = max_bytes or sys.maxsize
        self._topics: dict[str, OfferedTopic] = {}
        self._parts: list[dict[str, Any]] = []

    def __enter__(self) -> BagWriter:
        """Make the folder. Raises OSError where that fails."""
        self.folder.mkdir(parents=True)
        self._open_part()
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is None:
            with self._disk_errors():
                self._close_part()
            return
        try:
            self._close_part()
        except Exception:  # noqa: BLE001 - the error that ended the block is reported
            with contextlib.suppress(Exception):
                self._part.abort()
            with contextlib.suppress(OSError):
                self._part.path.rmdir()

    @property
    def total(self) -> int:
        """The number of messages written."""
        return sum(self.counts.values())

    def add_topic(self, topic: OfferedTopic) -> None:
        """Add a topic, once, before its first message."""
        self._topics[topic.name] = topic
        self.counts[topic.name] = 0
        with self._disk_errors():
            self._connect(topic)

    def write(self, topic: str, stamp: int, data: bytes | memoryview) -> None:
        """Write a serialized message of an added topic at its time in nanoseconds."""
        with self._disk_errors():
            if self._part_bytes >= self._max_bytes:
                self._close_part()
                self._open_part()
            self._part.write(self._connections[topic], stamp, data)
        self._part_bytes += len(data)
        self.counts[topic] += 1

    def write_message(self, topic: str, stamp: int, message: object) -> None:
        """Write a message whose type is one of `bag_types()`."""
        msgtype = self._topics[topic].definition.msgtype
        self.write(topic, stamp, bag_types().serialize_cdr(message, msgtype))

    @contextlib.contextmanager
    def _disk_errors(self) -> Iterator[None]:
        """Raise BagWriteError for what the disk raises in the block."""
        try:
            yield
        except (OSError, sqlite3.Error) as error:
            why = getattr(error, 'strerror', None) or error
            raise BagWriteError(f'{self.folder}: {why}; what was written before is kept') from None

    def _connect(self, topic: OfferedTopic) -> None:
        self._connections[topic.name] = self._part.add_connection(
            topic.name,
            topic.definition.msgtype,
            msgdef=topic.definition.text,
            rihs01=topic.definition.digest,
            offered_qos_profiles=topic.qos,
        )

    def _open_part(self) -> None:
        folder = self.folder / f'{self.folder.name}_{len(self._parts)}'
        # 9 is the format of Jazzy.
        self._part = BagFileWriter(folder, version=9, storage_plugin=STORAGES[self._storage])
        self._part.open()
        self._part_bytes = 0
        self._connections: dict[str, Connection] = {}
        for topic in self._topics.values():
            self._connect(topic)

    def _close_part(self) -> None:
        """Finish a file and list it with the others in metadata.yaml."""
        self._part.close()
        folder = self._part.path
        metadata = folder / 'metadata.yaml'
        self._parts.append(yaml.safe_load(metadata.read_text(encoding='utf-8'))[INFORMATION])
        metadata.unlink()
        folder.rmdir()
        text = yaml.safe_dump({INFORMATION: merge_metadata(self._parts)}, sort_keys=False)
        draft = self.folder / 'metadata.yaml.tmp'
        draft.write_text(text, encoding='utf-8')
        draft.replace(self.folder / 'metadata.yaml')


def ros_distro() -> str:
    """Return the ROS distribution that a bag is of: the sourced one, else that of `bag_types`."""
    return os.environ.get('ROS_DISTRO') or 'jazzy'


def with_distro(information: dict[str, Any]) -> dict[str, Any]:
    """Return the metadata of a bag with its ROS distribution, where rosbags has its own name."""
    return {**information, 'ros_distro': ros_distro()}


def merge_metadata(parts: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the metadata of a bag, made from that of each of its files."""
    filled = [part for part in parts if part['message_count']] or parts[:1]
    starts = [part['starting_time']['nanoseconds_since_epoch'] for part in filled]
    ends = [start + part['duration']['nanoseconds'] for start, part in zip(starts, filled)]
    counts: Counter[str] = Counter()
    for part in parts:
        for item in part['topics_with_message_count']:
            counts[item['topic_metadata']['name']] += item['message_count']
    # The last file knows all topics.
    last = [item['topic_metadata'] for item in parts[-1]['topics_with_message_count']]
    topics = [{'topic_metadata': item, 'message_count': counts[item['name']]} for item in last]
    return {
        **with_distro(parts[0]),
        'relative_file_paths': [path for part in parts for path in part['relative_file_paths']],
        'duration': {'nanoseconds': max(ends) - min(starts)},
        'starting_time': {'nanoseconds_since_epoch': min(starts)},
        'message_count': sum(part['message_count'] for part in parts),
        'topics_with_message_count': topics,
        'files': [file for part in parts for file in part['files']],
    }
