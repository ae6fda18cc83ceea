"""Bags written as rosbag2 does: a folder of files split by size, under one metadata.yaml."""

from __future__ import annotations

import contextlib
import sqlite3
import sys
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import yaml
from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin

from llm_astar_msgs_adapter.bags.storage import BagFile
from llm_astar_msgs_adapter.bags.types import Definition, bag_types

STORAGES = {'mcap': StoragePlugin.MCAP, 'sqlite3': StoragePlugin.SQLITE3}
INFORMATION = 'rosbag2_bagfile_information'


class BagWriteError(ValueError):
    """A bag that cannot be written; the message names its folder and what to do."""


def qos(depth: int = 10, *, latched: bool = False, reliable: bool = True) -> Qos:
    """Return a QoS as bags hold it; `latched` is transient_local, for late joiners."""
    never = QosTime(9223372036, 854775807)
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=depth,
        reliability=QosReliability.RELIABLE if reliable else QosReliability.BEST_EFFORT,
        durability=QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        deadline=never,
        lifespan=never,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=never,
        avoid_ros_namespace_conventions=False,
    )


LATCHED = qos(1, latched=True)


class Topic(NamedTuple):
    """A topic of a bag: its full name, its type, the QoS its publishers offer."""

    name: str
    definition: Definition
    qos: tuple[Qos, ...] = ()


class BagWriter:
    """Writes messages into a new bag as they come; a context manager.

    `counts` has the messages written by topic. Whatever ends the block, the bag is closed: what
    was written until then can be read. Raises BagWriteError where the disk refuses it.
    """

    def __init__(self, folder: str | Path, storage: str = 'mcap', max_bytes: int = 0) -> None:
        """Prepare a bag in `folder`, `mcap` or `sqlite3`.

        A file that holds `max_bytes` of messages is closed and the next one begun; 0 keeps one
        file. Raises BagWriteError where the folder exists.
        """
        self.folder = Path(folder)
        if self.folder.exists():
            message = f'{folder}: exists already; name a new folder, or remove this one'
            raise BagWriteError(message)
        self.counts: dict[str, int] = {}
        self._storage = storage
        self._max_bytes = max_bytes or sys.maxsize
        self._topics: dict[str, Topic] = {}
        self._parts: list[dict[str, Any]] = []

    def __enter__(self) -> BagWriter:
        """Make the folder. Raises OSError where that cannot be."""
        self.folder.mkdir(parents=True)
        self._open_part()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is None:
            with self._refusals_said():
                self._close_part()
            return
        try:
            self._close_part()
        except Exception:  # noqa: BLE001 - the error that ended the block is the one to tell
            with contextlib.suppress(Exception):
                self._part.abort()
            with contextlib.suppress(OSError):
                self._part.path.rmdir()

    @property
    def total(self) -> int:
        """The number of messages written, of all topics."""
        return sum(self.counts.values())

    def add_topic(self, topic: Topic) -> None:
        """Make a topic known, once, before its first message."""
        self._topics[topic.name] = topic
        self.counts[topic.name] = 0
        with self._refusals_said():
            self._connect(topic)

    def write(self, topic: str, stamp: int, data: bytes | memoryview) -> None:
        """Write a serialized message of a known topic at its time in nanoseconds."""
        with self._refusals_said():
            if self._part_bytes >= self._max_bytes:
                self._close_part()
                self._open_part()
            self._part.write(self._connections[topic], stamp, data)
        self._part_bytes += len(data)
        self.counts[topic] += 1

    def write_message(self, topic: str, stamp: int, message: object) -> None:
        """Write a message of `bag_types()`."""
        msgtype = self._topics[topic].definition.msgtype
        self.write(topic, stamp, bag_types().serialize_cdr(message, msgtype))

    @contextlib.contextmanager
    def _refusals_said(self) -> Iterator[None]:
        try:
            yield
        except (OSError, sqlite3.Error) as error:
            why = getattr(error, 'strerror', None) or error
            message = f'{self.folder}: {why}; what was written before is kept'
            raise BagWriteError(message) from None

    def _connect(self, topic: Topic) -> None:
        self._connections[topic.name] = self._part.add_connection(
            topic.name,
            topic.definition.msgtype,
            msgdef=topic.definition.text,
            rihs01=topic.definition.digest,
            offered_qos_profiles=topic.qos,
        )

    def _open_part(self) -> None:
        folder = self.folder / f'{self.folder.name}_{len(self._parts)}'
        # 9 is rosbag2's format of Jazzy.
        self._part = BagFile(folder, version=9, storage_plugin=STORAGES[self._storage])
        self._part.open()
        self._part_bytes = 0
        self._connections: dict[str, Connection] = {}
        for topic in self._topics.values():
            self._connect(topic)

    def _close_part(self) -> None:
        """Finish a file, and list it with the others in metadata.yaml."""
        self._part.close()
        folder = self._part.path
        metadata = folder / 'metadata.yaml'
        self._parts.append(yaml.safe_load(metadata.read_text(encoding='utf-8'))[INFORMATION])
        metadata.unlink()
        folder.rmdir()
        text = yaml.safe_dump({INFORMATION: _merged(self._parts)}, sort_keys=False)
        draft = self.folder / 'metadata.yaml.tmp'
        draft.write_text(text, encoding='utf-8')
        draft.replace(self.folder / 'metadata.yaml')


def _merged(parts: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the metadata of a bag from that of each of its files."""
    filled = [part for part in parts if part['message_count']] or parts[:1]
    starts = [part['starting_time']['nanoseconds_since_epoch'] for part in filled]
    ends = [start + part['duration']['nanoseconds'] for start, part in zip(starts, filled)]
    counts: dict[str, int] = {}
    for part in parts:
        for item in part['topics_with_message_count']:
            name = item['topic_metadata']['name']
            counts[name] = counts.get(name, 0) + item['message_count']
    topics = [
        {'topic_metadata': item['topic_metadata'], 'message_count': counts[name]}
        for item in parts[-1]['topics_with_message_count']
        for name in [item['topic_metadata']['name']]
    ]
    return {
        **parts[0],
        'relative_file_paths': [path for part in parts for path in part['relative_file_paths']],
        'duration': {'nanoseconds': max(ends) - min(starts)},
        'starting_time': {'nanoseconds_since_epoch': min(starts)},
        'message_count': sum(part['message_count'] for part in parts),
        'topics_with_message_count': topics,
        'files': [file for part in parts for file in part['files']],
    }
