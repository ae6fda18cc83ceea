# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Writes bags as rosbag2 does: a folder of an mcap file and metadata.yaml.

The file is complete up to the last chunk even if the process dies.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
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


class BagWriter:
    """Writes messages as they come into a new bag of one mcap file; a context manager.

    `counts` are the messages written, by topic. The bag is closed also where the block ends with
    an error, and what was written until then can be read. Raises BagWriteError where the disk is
    full or fails.
    """

    def __init__(self, folder: str | Path) -> None:
        """Prepare a bag in `folder`. Raises BagWriteError where it exists."""
        self.folder = Path(folder)
        if self.folder.exists():
            raise BagWriteError(f'{folder}: exists already; name a new folder, or remove this one')
        self.counts: Counter[str] = Counter()
        self._topics: dict[str, OfferedTopic] = {}
        # Numbers of types and of topics in the file, and the times (ns) of its messages.
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._first, self._last = NEVER, 0

    def __enter__(self) -> BagWriter:
        """Make the folder and the file. Raises OSError where that fails."""
        self.folder.mkdir(parents=True)
        self._stream = (self.folder / self._name).open('xb')
        self._file = McapWriter(self._stream, chunk_size=CHUNK_BYTES, enable_data_crcs=True)
        self._file.start(profile='ros2')
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        try:
            with self._disk_errors():
                self._finish()
        except Exception:
            if error is None:
                raise
            # The error that ended the block is reported.
            with suppress(Exception):
                self._stream.close()

    @property
    def total(self) -> int:
        """The number of messages written."""
        return self.counts.total()

    @property
    def _name(self) -> str:
        return f'{self.folder.name}_0.mcap'

    def add_topic(self, topic: OfferedTopic) -> None:
        """Add a topic, once, before its first message, and its type where it is new."""
        self._topics[topic.name] = topic
        self.counts[topic.name] = 0
        msgtype, text, encoding, digest = topic.definition
        metadata = {'offered_qos_profiles': topic.profiles, 'topic_type_hash': digest}
        with self._disk_errors():
            if msgtype not in self._schemas:
                schema = self._file.register_schema(msgtype, encoding, text.encode())
                self._schemas[msgtype] = schema
            facts = topic.name, 'cdr', self._schemas[msgtype], metadata
            self._channels[topic.name] = self._file.register_channel(*facts)

    def write(self, topic: str, stamp: int, data: bytes | memoryview) -> None:
        """Write a serialized message of an added topic at its time in nanoseconds."""
        channel, number = self._channels[topic], self.counts[topic] + 1
        with self._disk_errors():
            self._file.add_message(channel, stamp, bytes(data), stamp, number)
            self._stream.flush()
        self.counts[topic] = number
        self._first, self._last = min(self._first, stamp), max(self._last, stamp)

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

    def _finish(self) -> None:
        """Finish the file; the metadata, in the format of Jazzy, are in it and beside it."""
        duration = max(0, self._last - self._first)
        times: dict[str, Any] = {'first': self._first, 'duration': duration}
        names: dict[str, Any] = {'name': self._name, 'distro': ros_distro()}
        topics = {'topics': self._topics.values(), 'counts': self.counts}
        metadata = render('bags/metadata.yaml.j2', **names, **times, **topics) + '\n'
        self._file.add_metadata('rosbag2', {'serialized_metadata': metadata})
        self._file.finish()  # type: ignore[no-untyped-call]
        self._stream.close()
        draft = self.folder / 'metadata.yaml.tmp'
        text = indent(metadata, '  ')
        draft.write_text(f'rosbag2_bagfile_information:\n{text}', encoding='utf-8')
        draft.replace(self.folder / 'metadata.yaml')


def ros_distro() -> str:
    """Return the ROS distribution that a bag is of: the sourced one, else that of `bag_types`."""
    return os.environ.get('ROS_DISTRO') or 'jazzy'
