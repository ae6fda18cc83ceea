# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Writes bags as rosbag2 does: a folder of mcap files split by size, with one metadata.yaml.

Each file is complete up to the last chunk even if the process dies.
"""

from __future__ import annotations

import json
import os
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import indent
from typing import Any, NamedTuple

import yaml
from llm_astar_msgs_adapter.errors import LlmAstarError
from mcap.writer import Writer as McapWriter

from llm_astar_lab.bags.types import TypeDefinition, bag_types
from llm_astar_lab.templates import render

# How much a power cut may lose: bytes before compression.
CHUNK_BYTES = 64 * 1024
# The start (ns) of a file without messages, as rosbag2 writes it.
NEVER = 2**63 - 1


class BagWriteError(LlmAstarError, ValueError):
    """A bag that cannot be written; the message names its folder and what to do."""


def qos(depth: int = 10, *, latched: bool = False) -> dict[str, Any]:
    """Return a reliable QoS as a bag holds it; `latched` is for subscribers that join late."""
    forever = {'nsec': 854775807, 'sec': 9223372036}
    return {
        'avoid_ros_namespace_conventions': False, 'deadline': forever, 'depth': depth,
        'durability': 'transient_local' if latched else 'volatile', 'history': 'keep_last',
        'lifespan': forever, 'liveliness': 'automatic', 'liveliness_lease_duration': forever,
        'reliability': 'reliable',
    }  # fmt: skip


LATCHED = qos(1, latched=True)


class OfferedTopic(NamedTuple):
    """A topic to be written: its full name, its type, the QoS its publishers offer."""

    name: str
    definition: TypeDefinition
    qos: tuple[dict[str, Any], ...] = ()

    @property
    def profiles(self) -> str:
        """The QoS as YAML, where equal values are written out again."""
        text: str = yaml.safe_dump(json.loads(json.dumps(self.qos)))
        return text.strip()


@dataclass
class Written:
    """What was written: the number of messages by topic, their first and last times (ns)."""

    counts: Counter[str] = field(default_factory=Counter)
    first: int = NEVER
    last: int = 0

    def add(self, topic: str, stamp: int) -> None:
        """Count a message."""
        self.counts[topic] += 1
        self.first, self.last = min(self.first, stamp), max(self.last, stamp)

    @property
    def duration(self) -> int:
        """The time from the first message to the last (ns)."""
        return max(0, self.last - self.first)


class McapPart:
    """Writes an mcap file: zstd chunks, indices, checksums."""

    def __init__(self, path: Path) -> None:
        """Create the file."""
        self._stream = path.open('xb')
        self._file = McapWriter(self._stream, chunk_size=CHUNK_BYTES, enable_data_crcs=True)
        self._file.start(profile='ros2')
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._written: Counter[str] = Counter()

    def add_topic(self, topic: OfferedTopic) -> None:
        """Write a topic with the QoS that its publishers offer, and its type where it is new."""
        msgtype, text, encoding, digest = topic.definition
        if msgtype not in self._schemas:
            schema = self._file.register_schema(msgtype, encoding, text.encode())
            self._schemas[msgtype] = schema
        metadata = {'offered_qos_profiles': topic.profiles, 'topic_type_hash': digest}
        facts = topic.name, 'cdr', self._schemas[msgtype], metadata
        self._channels[topic.name] = self._file.register_channel(*facts)

    def write(self, topic: str, stamp: int, data: bytes | memoryview) -> None:
        """Write a message at its time in nanoseconds."""
        self._written[topic] += 1
        channel, number = self._channels[topic], self._written[topic]
        self._file.add_message(channel, stamp, bytes(data), stamp, number)
        self._stream.flush()

    def close(self, metadata: str) -> None:
        """Write the metadata of the bag into the file and finish it."""
        self._file.add_metadata('rosbag2', {'serialized_metadata': metadata})
        self._file.finish()  # type: ignore[no-untyped-call]
        self._stream.close()

    def abort(self) -> None:
        """Close the file unfinished."""
        self._stream.close()


class BagWriter:
    """Writes messages into a new bag as they come; a context manager.

    `counts` are the messages written, by topic. The bag is closed also where the block ends with
    an error, and what was written until then can be read. Raises BagWriteError where the disk is
    full or fails.
    """

    def __init__(self, folder: str | Path, max_bytes: int = 0) -> None:
        """Prepare a bag in `folder`.

        After `max_bytes` of messages a file is closed and the next one begun; 0 means one file.
        Raises BagWriteError where the folder exists.
        """
        self.folder = Path(folder)
        if self.folder.exists():
            raise BagWriteError(f'{folder}: exists already; name a new folder, or remove this one')
        self._max_bytes = max_bytes or sys.maxsize
        self._topics: dict[str, OfferedTopic] = {}
        self._files: list[tuple[str, Written]] = []
        self._written = Written()

    def __enter__(self) -> BagWriter:
        """Make the folder. Raises OSError where that fails."""
        self.folder.mkdir(parents=True)
        self._open_part()
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        try:
            with self._disk_errors():
                self._close_part()
        except Exception:
            if error is None:
                raise
            # The error that ended the block is reported.
            with suppress(Exception):
                self._part.abort()

    @property
    def counts(self) -> Counter[str]:
        """The number of messages written, by topic."""
        return self._written.counts

    @property
    def total(self) -> int:
        """The number of messages written."""
        return self.counts.total()

    def add_topic(self, topic: OfferedTopic) -> None:
        """Add a topic, once, before its first message."""
        self._topics[topic.name] = topic
        self._written.counts[topic.name] = 0
        with self._disk_errors():
            self._part.add_topic(topic)

    def write(self, topic: str, stamp: int, data: bytes | memoryview) -> None:
        """Write a serialized message of an added topic at its time in nanoseconds."""
        with self._disk_errors():
            if self._part_bytes >= self._max_bytes:
                self._close_part()
                self._open_part()
            self._part.write(topic, stamp, data)
        self._part_bytes += len(data)
        self._in_part.add(topic, stamp)
        self._written.add(topic, stamp)

    def write_message(self, topic: str, stamp: int, message: Any) -> None:  # noqa: ANN401 - of rosbags
        """Write a message whose type is one of `bag_types()`."""
        self.write(topic, stamp, bag_types().serialize_cdr(message, message.__msgtype__))

    @contextmanager
    def _disk_errors(self) -> Iterator[None]:
        """Raise BagWriteError for what the disk raises in the block."""
        try:
            yield
        except OSError as error:
            why = error.strerror or error
            raise BagWriteError(f'{self.folder}: {why}; what was written before is kept') from None

    def _open_part(self) -> None:
        self._path = self.folder / f'{self.folder.name}_{len(self._files)}.mcap'
        self._part = McapPart(self._path)
        self._part_bytes = 0
        self._in_part = Written()
        for topic in self._topics.values():
            self._part.add_topic(topic)

    def _close_part(self) -> None:
        """Finish a file and list it with the others in metadata.yaml."""
        file = self._path.name, self._in_part
        self._part.close(self._metadata([file], self._in_part))
        self._files.append(file)
        text = indent(self._metadata(self._files, self._written), '  ')
        draft = self.folder / 'metadata.yaml.tmp'
        draft.write_text(f'rosbag2_bagfile_information:\n{text}', encoding='utf-8')
        draft.replace(self.folder / 'metadata.yaml')

    def _metadata(self, files: list[tuple[str, Written]], written: Written) -> str:
        """Return the metadata of a bag of these files, in the format of Jazzy."""
        template, topics = 'bags/metadata.yaml.j2', self._topics.values()
        text = render(template, topics=topics, files=files, written=written, distro=ros_distro())
        return f'{text}\n'


def ros_distro() -> str:
    """Return the ROS distribution that a bag is of: the sourced one, else that of `bag_types`."""
    return os.environ.get('ROS_DISTRO') or 'jazzy'
