"""Bags as ROS 2 records them, read message by message: mcap and sqlite3, split, compressed.

A folder with or without its metadata.yaml, or a bare file. Messages come in the order of their
times, file by file; where a topic's own times go back within a file, the recorder's clock jumped,
and the file is read in the order it was written in. Nothing is held that grows with the bag.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, NamedTuple

import zstandard

from llm_astar_msgs_adapter.bags.decoding import DecodeError, Decoder, UnknownTypeError
from llm_astar_msgs_adapter.bags.files import bare_name, storage_files, unpack
from llm_astar_msgs_adapter.bags.mcap import McapFile
from llm_astar_msgs_adapter.bags.problems import Problems
from llm_astar_msgs_adapter.bags.records import (
    JUMP,
    BagError,
    Channel,
    Record,
    Storage,
)
from llm_astar_msgs_adapter.bags.sqlite import SqliteFile

MCAP = '.mcap'


class Message(NamedTuple):
    """A message, decoded: its fields are attributes. `time` is the recorder's (ns)."""

    topic: str
    msgtype: str
    time: int
    value: Any


@dataclass
class Topic:
    """What a bag holds of one topic; `first` and `last` are the recorder's times (ns)."""

    name: str
    msgtype: str
    count: int = 0
    first: int = 0
    last: int = 0


class Bag:
    """A bag, opened for reading. A context manager."""

    def __init__(self, path: str | Path) -> None:
        """Open a bag and look through its index. Raises BagError where there is none to read."""
        self.path = Path(path)
        self.name = bare_name(self.path)
        self.problems = Problems()
        self.topics: dict[str, Topic] = {}
        self._unpacked = TemporaryDirectory(prefix='llm-astar-bag-')
        self._files: list[tuple[Storage, bool]] = []
        self._decoder = Decoder()
        self._refused: set[str] = set()
        try:
            for file in storage_files(self.path, self.problems):
                self._open(file)
            if not self._files:
                raise BagError('\n'.join(self.problems.left_out) or f'{path}: holds no messages')
            self._note_unknown_types()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Bag:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close every file and remove what was unpacked."""
        for storage, _ in self._files:
            storage.close()
        self._files.clear()
        self._unpacked.cleanup()

    @cached_property
    def start(self) -> int:
        """The time of the first message (ns)."""
        return min((topic.first for topic in self.topics.values() if topic.count), default=0)

    @property
    def end(self) -> int:
        """The time of the last message (ns)."""
        return max((topic.last for topic in self.topics.values() if topic.count), default=0)

    def messages(self, topics: Collection[str]) -> Iterator[Message]:
        """Yield the messages of topics, decoded; what cannot be is left out, and said once."""
        for storage, as_recorded in self._files:
            for record in storage.records(topics, as_recorded=as_recorded):
                message = self._decode(record)
                if message is not None:
                    yield message
            self._note_damage(storage)

    def _open(self, path: Path) -> None:
        """Open a storage file and count its messages."""
        try:
            file = unpack(path, Path(self._unpacked.name), self.problems)
            storage: Storage = McapFile(file) if file.suffix == MCAP else SqliteFile(file)
        except (BagError, OSError, zstandard.ZstdError) as error:
            self.problems.leave_out(_sentence(error, path))
            return
        self._files.append((storage, self._survey(storage)))
        for channel in storage.channels:
            self._decoder.learn(channel)
        self._note_damage(storage)

    def _survey(self, storage: Storage) -> bool:
        """Count a file's messages; tell whether it must be read as recorded."""
        counts, jump = _count(storage)
        if jump:
            order = 'the file is read in the order it was written in'
            self.problems.note(f'{storage.path}: {jump}; {order}')
        for channel in {channel.topic: channel for channel in storage.channels}.values():
            self._add(channel, counts.get(channel.topic, Topic(channel.topic, '')))
        return bool(jump)

    def _add(self, channel: Channel, found: Topic) -> None:
        """Add what a file holds of a topic to what the bag does."""
        known = self.topics.get(channel.topic)
        if known is None or not known.count:
            found.msgtype = channel.msgtype
            self.topics[channel.topic] = found
        elif found.count:
            known.count += found.count
            known.first, known.last = min(known.first, found.first), max(known.last, found.last)
        if channel.encoding not in ('cdr', ''):
            self._refused.add(channel.topic)
            self.problems.note(
                f'{self.path}: {channel.topic} is written as {channel.encoding!r}, not as ROS 2 '
                'messages are (cdr)'
            )

    def _decode(self, record: Record) -> Message | None:
        if record.topic in self._refused:
            return None
        msgtype = self.topics[record.topic].msgtype
        try:
            value = self._decoder.decode(msgtype, record.data)
        except DecodeError as error:
            problem = f'a message at {self.seconds(record.time):.3f} s is left out: {error}'
            self.problems.leave_out(
                f'{self.path}: {record.topic}: {problem}', f'{record.topic}: damaged messages'
            )
        except UnknownTypeError as error:
            self._refused.add(record.topic)
            self.problems.leave_out(f'{self.path}: {record.topic} is left out: {error}')
        else:
            return Message(record.topic, msgtype, record.time, value)
        return None

    def seconds(self, time: int) -> float:
        """Return a time as seconds since the first message."""
        return (time - self.start) / 1e9

    def _note_unknown_types(self) -> None:
        strange = [
            f'{topic.name} ({topic.msgtype})'
            for topic in self.topics.values()
            if topic.name not in self._refused and not self._decoder.knows(topic.msgtype)
        ]
        if strange:
            self.problems.note(
                f'{self.path}: of types that are unknown here and that the bag does not define, '
                f'so not readable: {", ".join(strange)}'
            )

    def _note_damage(self, storage: Storage) -> None:
        if storage.damage:
            self.problems.leave_out(storage.damage)


@contextmanager
def open_bags(paths: Sequence[str | Path]) -> Iterator[tuple[list[Bag], Problems]]:
    """Open bags, each once; those that cannot be opened are left out, as the problems say."""
    unopened = Problems()
    bags = []
    with ExitStack() as stack:
        for path in paths:
            bag = _bag_or_why_not(path)
            if isinstance(bag, str):
                unopened.leave_out(bag)
            else:
                bags.append(stack.enter_context(bag))
        yield bags, unopened


def _bag_or_why_not(path: str | Path) -> Bag | str:
    try:
        return Bag(path)
    except (BagError, OSError) as error:
        return str(error)


def _count(storage: Storage) -> tuple[dict[str, Topic], str]:
    """Count the messages of a file by topic; say where a topic's times first go back, or ''."""
    topics: dict[str, Topic] = {}
    latest: dict[str, int] = {}
    jump = ''
    for name, time in storage.stamps():
        topic = topics.setdefault(name, Topic(name, '', 0, time, time))
        topic.count += 1
        topic.first, topic.last = min(topic.first, time), max(topic.last, time)
        back = latest.get(name, time) - time
        if back > JUMP and not jump:
            where = f'message {topic.count} of {name}'
            jump = f'the clock jumps back by {back / 1e9:.3f} s at {where}'
        latest[name] = time
    return topics, jump


def _sentence(error: Exception, path: Path) -> str:
    return str(error) if str(path) in str(error) else f'{path}: {error}'
