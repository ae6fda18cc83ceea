"""Reads rosbag2 bags message by message: mcap and sqlite3, split, compressed, damaged.

A bag is a folder, with or without its metadata.yaml, or a single file. Messages come in the order
of their times, file by file. Where the times of one topic go back within a file, the recorder's
clock jumped, and that file is read in the order of recording. Memory does not grow with the bag.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import zstandard

from llm_astar_lab.bags.files import (
    JUMP,
    BagError,
    Channel,
    Problems,
    Record,
    Storage,
    bag_name,
    storage_files,
    unpack,
)
from llm_astar_lab.bags.mcap import McapReader
from llm_astar_lab.bags.sqlite import SqliteReader
from llm_astar_lab.bags.types import DecodeError, Decoder, UnknownTypeError


class BagMessage(NamedTuple):
    """A decoded message: its fields are attributes of `value`. `time` is the recorder's (ns)."""

    topic: str
    msgtype: str
    time: int
    value: Any


@dataclass
class RecordedTopic:
    """One topic of a bag: its message count, and the recorder's first and last times (ns)."""

    name: str
    msgtype: str
    count: int = 0
    first: int = 0
    last: int = 0


class Bag:
    """A bag that is open for reading. A context manager."""

    def __init__(self, path: str | Path) -> None:
        """Open a bag and read its index. Raises BagError where nothing can be read."""
        self.path = Path(path)
        self.name = bag_name(self.path)
        self.problems = Problems()
        self.topics: dict[str, RecordedTopic] = {}
        self._stack = ExitStack()
        unpacked = TemporaryDirectory(prefix='llm-astar-bag-')
        self._unpacked = Path(self._stack.enter_context(unpacked))
        # Each file, and whether it must be read in the order of recording.
        self._files: list[tuple[Storage, bool]] = []
        self._decoder = Decoder()
        self._unreadable: set[str] = set()
        try:
            for file in storage_files(self.path, self.problems):
                with self.problems.catch(BagError, OSError, zstandard.ZstdError, path=file):
                    self._open(file)
            if not self._files:
                raise BagError('\n'.join(self.problems.left_out) or f'{path}: holds no messages')
            self._note_unknown_types()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Bag:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close every file and remove unpacked ones."""
        self._stack.close()

    @cached_property
    def start(self) -> int:
        """The time of the first message (ns)."""
        return min((topic.first for topic in self.topics.values() if topic.count), default=0)

    @property
    def end(self) -> int:
        """The time of the last message (ns)."""
        return max((topic.last for topic in self.topics.values() if topic.count), default=0)

    def seconds(self, time: int) -> float:
        """Return a time (ns) as seconds since the first message."""
        return (time - self.start) / 1e9

    def messages(self, topics: Collection[str]) -> Iterator[BagMessage]:
        """Yield the messages of topics; what cannot be decoded is left out, as `problems` say."""
        for storage, as_recorded in self._files:
            for record in storage.records(topics, as_recorded=as_recorded):
                if record.topic in self._unreadable:
                    continue
                msgtype = self.topics[record.topic].msgtype
                try:
                    value = self._decoder.decode(msgtype, record.data)
                except (DecodeError, UnknownTypeError) as error:
                    self._leave_out(record, error)
                else:
                    yield BagMessage(record.topic, msgtype, record.time, value)
            if storage.damage:
                self.problems.leave_out(storage.damage)

    def _leave_out(self, record: Record, error: DecodeError | UnknownTypeError) -> None:
        """Leave out a message that does not decode, or a whole topic of unknown type."""
        topic = record.topic
        if isinstance(error, UnknownTypeError):
            self._unreadable.add(topic)
            self.problems.leave_out(f'{self.path}: {topic} is left out: {error}')
            return
        problem = f'a message at {self.seconds(record.time):.3f} s is left out: {error}'
        self.problems.leave_out(f'{self.path}: {topic}: {problem}', f'{topic}: damaged messages')

    def _open(self, path: Path) -> None:
        """Open a storage file and count its messages."""
        file = unpack(path, self._unpacked, self.problems)
        storage: Storage = McapReader(file) if file.suffix == '.mcap' else SqliteReader(file)
        self._stack.callback(storage.close)
        counts, jump = count_messages(storage)
        if jump:
            self.problems.note(
                f'{storage.path}: {jump}; the file is read in the order of recording'
            )
        self._files.append((storage, jump is not None))
        for channel in {channel.topic: channel for channel in storage.channels}.values():
            self._add(channel, counts.get(channel.topic, RecordedTopic(channel.topic, '')))
        for channel in storage.channels:
            self._decoder.learn(channel)
        if storage.damage:
            self.problems.leave_out(storage.damage)

    def _add(self, channel: Channel, found: RecordedTopic) -> None:
        """Add the messages of a topic in one file to those of the bag."""
        known = self.topics.get(channel.topic)
        if known is None or not known.count:
            found.msgtype = channel.msgtype
            self.topics[channel.topic] = found
        elif found.count:
            known.count += found.count
            known.first, known.last = min(known.first, found.first), max(known.last, found.last)
        if channel.encoding not in ('cdr', ''):
            self._unreadable.add(channel.topic)
            self.problems.note(
                f'{self.path}: {channel.topic} is written as {channel.encoding!r}, not as ROS 2 '
                'messages are (cdr)'
            )

    def _note_unknown_types(self) -> None:
        unknown = [
            f'{topic.name} ({topic.msgtype})'
            for topic in self.topics.values()
            if topic.name not in self._unreadable and not self._decoder.knows(topic.msgtype)
        ]
        if unknown:
            self.problems.note(
                f'{self.path}: of types that are unknown here and that the bag does not define, '
                f'so not readable: {", ".join(unknown)}'
            )


@contextmanager
def open_bags(paths: Sequence[str | Path]) -> Iterator[tuple[list[Bag], Problems]]:
    """Open bags, each once; the problems name those that cannot be opened."""
    problems = Problems()
    bags = []
    with ExitStack() as stack:
        for path in paths:
            with problems.catch(BagError, OSError):
                bags.append(stack.enter_context(Bag(path)))
        yield bags, problems


def count_messages(storage: Storage) -> tuple[dict[str, RecordedTopic], str | None]:
    """Count a file's messages by topic; the sentence says where the clock first jumps back."""
    topics: dict[str, RecordedTopic] = {}
    latest: dict[str, int] = {}
    jump = None
    for name, time in storage.stamps():
        topic = topics.setdefault(name, RecordedTopic(name, '', 0, time, time))
        topic.count += 1
        topic.first, topic.last = min(topic.first, time), max(topic.last, time)
        back = latest.get(name, time) - time
        if back > JUMP and not jump:
            where = f'message {topic.count} of {name}'
            jump = f'the clock jumps back by {back / 1e9:.3f} s at {where}'
        latest[name] = time
    return topics, jump
