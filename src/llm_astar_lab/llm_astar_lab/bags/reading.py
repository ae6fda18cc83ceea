"""Reads rosbag2 bags message by message: mcap and sqlite3, split, compressed, damaged.

A bag is a folder, with or without its metadata.yaml, or a single file. Messages come in the order
of their times, file by file. Where the times of one topic go back within a file, the recorder's
clock jumped, and that file is read in the order of recording. Memory does not grow with the bag.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
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
    bag_name,
    storage_files,
    unpack,
)
from llm_astar_lab.bags.storage import McapFile, SqliteFile, Storage
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

    name: str = ''
    msgtype: str = ''
    count: int = 0
    first: int = 2**64
    last: int = -(2**63)


class Bag:
    """A bag that is open for reading. A context manager."""

    def __init__(self, path: str | Path) -> None:
        """Open a bag and read its index. Raises BagError where nothing can be read."""
        self.path = Path(path)
        self.name = bag_name(self.path)
        self.problems = Problems()
        self.topics: dict[str, RecordedTopic] = {}
        # Each file, and whether it must be read in the order of recording.
        self._files: list[tuple[Storage, bool]] = []
        self._decoder = Decoder()
        self._unreadable: set[str] = set()
        with ExitStack() as stack:
            folder = Path(stack.enter_context(TemporaryDirectory(prefix='llm-astar-bag-')))
            for found in storage_files(self.path, self.problems):
                with self.problems.catch(BagError, OSError, zstandard.ZstdError, path=found):
                    file = unpack(found, folder, self.problems)
                    make: type[Storage] = McapFile if file.suffix == '.mcap' else SqliteFile
                    self._count(stack.enter_context(closing(make(file))))
            if not self._files:
                raise BagError('\n'.join(self.problems.left_out) or f'{path}: holds no messages')
            self._note_unknown_types()
            self._stack = stack.pop_all()

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
            names = {n: found.topic for n, found in storage.channels.items()}
            wanted = {n for n, topic in names.items() if topic in topics}
            for channel, time, data in storage.records(wanted, as_recorded=as_recorded):
                topic = self.topics[names[channel]]
                try:
                    if topic.name not in self._unreadable:
                        value = self._decoder.decode(topic.msgtype, data)
                        yield BagMessage(topic.name, topic.msgtype, time, value)
                except UnknownTypeError as error:
                    self._unreadable.add(topic.name)
                    self.problems.leave_out(f'{self.path}: {topic.name} is left out: {error}')
                except DecodeError as error:
                    what = f'a message at {self.seconds(time):.3f} s is left out: {error}'
                    kind = f'{topic.name}: damaged messages'
                    self.problems.leave_out(f'{self.path}: {topic.name}: {what}', kind)
            if storage.damage:
                self.problems.leave_out(storage.damage)

    def _count(self, storage: Storage) -> None:
        """Add a storage file and count its messages."""
        counts, jump = count_messages(storage)
        if jump:
            what = f'{jump}; the file is read in the order of recording'
            self.problems.note(f'{storage.path}: {what}')
        self._files.append((storage, jump is not None))
        for number, channel in storage.channels.items():
            self._add(channel, counts.get(number, RecordedTopic()))
            self._decoder.learn(channel)
        if storage.damage:
            self.problems.leave_out(storage.damage)

    def _add(self, channel: Channel, found: RecordedTopic) -> None:
        """Add the messages of a topic in one file to those of the bag."""
        known = self.topics.get(channel.topic)
        if known is None or not known.count:
            found.name, found.msgtype = channel.topic, channel.msgtype
            self.topics[channel.topic] = found
        else:
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


def count_messages(storage: Storage) -> tuple[dict[int, RecordedTopic], str | None]:
    """Count a file's messages by channel; the sentence says where the clock first jumps back."""
    found: dict[int, RecordedTopic] = {}
    latest: dict[int, int] = {}
    jumps: dict[int, tuple[int, int]] = {}
    for channel, time in storage.stamps():
        topic = found.setdefault(channel, RecordedTopic())
        topic.count += 1
        topic.first, topic.last = min(topic.first, time), max(topic.last, time)
        back = latest.get(channel, time) - time
        if back > JUMP:
            jumps.setdefault(channel, (back, topic.count))
        latest[channel] = time
    for channel, (back, count) in jumps.items():
        if channel in storage.channels:
            where = f'message {count} of {storage.channels[channel].topic}'
            return found, f'the clock jumps back by {back / 1e9:.3f} s at {where}'
    return found, None
