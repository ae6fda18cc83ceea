# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""Reads rosbag2 bags message by message: mcap and sqlite3, split, compressed, damaged.

A bag is a folder, with or without its metadata.yaml, or a single file. Messages come in the order
of their times, file by file. Where the times of one topic go back within a file, the recorder's
clock jumped, and that file is read in the order of recording. Memory does not grow with the bag.
"""

import re
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import zstandard
from llm_astar_msgs_adapter.files import read_yaml

from llm_astar_lab.bags.storage import BagError, Channel, McapFile, SqliteFile, Storage
from llm_astar_lab.bags.types import DecodeError, Decoder, UnknownTypeError

FORMATS = ('.mcap', '.db3')
COMPRESSED = '.zstd'
METADATA = 'metadata.yaml'
# The clock jumped where the times of one topic go back by more than this (ns).
JUMP = 1_000_000_000
BLOCK = 1024 * 1024
# A file that is compressed as a whole is unpacked up to here.
MOST_UNPACKED = 4 * 1024**3


@dataclass
class Problems:
    """What was wrong with a bag, in sentences.

    `notes` are oddities without effect on the results; `left_out` is missing from the results.
    Of sentences of one kind only the first `limit` are kept; the others are counted.
    """

    limit: int = 20
    notes: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    _counts: Counter[str] = field(default_factory=Counter)

    def note(self, sentence: str) -> None:
        """Add an oddity, once."""
        if sentence not in self.notes and len(self.notes) < self.limit:
            self.notes.append(sentence)

    def leave_out(self, sentence: str, kind: str = '') -> None:
        """Add what is left out and why; `kind` names what such sentences have in common."""
        self._counts[kind] += bool(kind)
        if self._counts[kind] <= self.limit and sentence not in self.left_out:
            self.left_out.append(sentence)

    @contextmanager
    def catch(self, path: str | Path, *errors: type[Exception]) -> Iterator[None]:
        """Leave out what raises one of these errors in the block; they name the path."""
        try:
            yield
        except errors as error:
            self.leave_out(str(error) if str(path) in str(error) else f'{path}: {error}')

    def lines(self) -> list[str]:
        """Return every sentence on what was left out, and the number of those not kept."""
        more = {kind: count - self.limit for kind, count in self._counts.items()}
        return [*self.left_out, *(f'{kind}: {n} more' for kind, n in more.items() if n > 0)]


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
    # The time of the message before, and where the clock first jumps back within a file.
    before: int = -(2**63)
    jump: str = ''

    def add(self, time: int) -> None:
        """Count a message."""
        self.count += 1
        back, self.before = self.before - time, time
        if back > JUMP and not self.jump:
            self.jump = f'the clock jumps back by {back / 1e9:.3f} s at message {self.count}'
        self.first, self.last = min(self.first, time), max(self.last, time)


class Bag(AbstractContextManager['Bag']):
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
                with self.problems.catch(found, BagError, OSError, zstandard.ZstdError):
                    file = unpack(found, folder, self.problems)
                    make: type[Storage] = McapFile if file.suffix == '.mcap' else SqliteFile
                    self._count(stack.enter_context(closing(make(file))))
            if not self._files:
                raise BagError('\n'.join(self.problems.left_out) or f'{path}: holds no messages')
            self._note_unknown_types()
            self._stack = stack.pop_all()

    def __exit__(self, *error: object) -> None:
        # Every file is closed, and unpacked ones are removed.
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
        counts: defaultdict[int, RecordedTopic] = defaultdict(RecordedTopic)
        for number, time in storage.stamps():
            counts[number].add(time)
        channels = storage.channels
        jumps = [f'{counts[n].jump} of {channels[n].topic}' for n in channels if counts[n].jump]
        for jump in jumps[:1]:
            what = f'{jump}; the file is read in the order of recording'
            self.problems.note(f'{storage.path}: {what}')
        self._files.append((storage, bool(jumps)))
        for number, channel in channels.items():
            self._add(channel, counts[number])
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
            how = f'{channel.topic} is written as {channel.encoding!r}'
            self.problems.note(f'{self.path}: {how}, not as ROS 2 messages are (cdr)')

    def _note_unknown_types(self) -> None:
        if unknown := [
            f'{name} ({topic.msgtype})'
            for name, topic in self.topics.items()
            if name not in self._unreadable and not self._decoder.knows(topic.msgtype)
        ]:
            why = 'of types that are unknown here and that the bag does not define'
            self.problems.note(f'{self.path}: {why}, so not readable: {", ".join(unknown)}')


@contextmanager
def open_bags(paths: Sequence[str | Path]) -> Iterator[tuple[list[Bag], Problems]]:
    """Open bags, each once; the problems name those that cannot be opened."""
    problems = Problems()
    bags = []
    with ExitStack() as stack:
        for path in paths:
            with problems.catch(path, BagError, OSError):
                bags.append(stack.enter_context(Bag(path)))
        yield bags, problems


def storage_files(path: Path, problems: Problems) -> list[Path]:
    """Return the storage files of a bag in their order. Raises BagError."""
    if not path.exists():
        raise BagError(f'{path}: there is no such bag')
    if is_storage(path):
        return [path]
    if path.is_file():
        known = ', '.join(FORMATS)
        raise BagError(f'{path}: a bag is a folder, or a file ending in one of {known}')
    held = sorted(filter(is_storage, path.iterdir()), key=natural_order)
    named, problem = names_in_metadata(path / METADATA)
    if not held and not named:
        raise BagError(f'{path}: holds neither {METADATA} nor a file of {", ".join(FORMATS)}')
    found = {
        name: next((file for file in held if file.name in (name, name + COMPRESSED)), None)
        for name in named
    }
    if held and not any(found.values()):
        problem = problem or f'names {", ".join(named)}, and none of them is there'
        problems.note(f'{path / METADATA}: {problem}; the files are read in order of their names')
        return held
    for name, file in found.items():
        if file is None:
            problems.leave_out(f'{path / name}: is missing, though {METADATA} names it')
    later = [file for file in held if continues(file, path / named[-1])]
    for file in later:
        why = f'though {METADATA} does not name it yet; the recording goes on or was cut off'
        problems.note(f'{file}: is read, {why}')
    return [file for file in found.values() if file is not None] + later


def names_in_metadata(file: Path) -> tuple[list[str], str | None]:
    """Return the names of the storage files in a metadata.yaml, and why there are none."""
    if not file.exists():
        return [], 'is missing, as after a recording that was not ended'
    try:
        content = read_yaml(file, BagError)
        names = content['rosbag2_bagfile_information']['relative_file_paths']
        found = list(dict.fromkeys(PurePath(name).name for name in names))
    except (BagError, ValueError, KeyError, TypeError) as error:
        why = ' '.join(str(error).split())
        return [], f'cannot be used ({type(error).__name__}: {why})'
    return found, None if found else 'names no files'


def continues(file: Path, last: Path) -> bool:
    """Tell whether a file follows another one of the same split recording."""
    own, other = (re.split(r'(\d+)(?=\.)', path.name, maxsplit=1) for path in (file, last))
    same_bag = [own[0], *own[2:]] == [other[0], *other[2:]]
    return same_bag and natural_order(file) > natural_order(last)


def is_storage(path: Path) -> bool:
    """Tell whether a path is a storage file, compressed or not."""
    return path.is_file() and path.name.removesuffix(COMPRESSED).endswith(FORMATS)


def natural_order(path: Path) -> list[tuple[int, str]]:
    """Return a sort key that puts bag_10 behind bag_9."""
    parts = re.split(r'(\d+)', path.name)
    return [(int(part), '') if part.isdecimal() else (-1, part) for part in parts]


def bag_name(path: Path) -> str:
    """Return the name of a bag: that of its folder or file, without file endings."""
    path = path.resolve()
    return path.name if path.is_dir() else PurePath(path.name.removesuffix(COMPRESSED)).stem


def unpack(path: Path, folder: Path, problems: Problems) -> Path:
    """Unpack a file that is compressed as a whole into `folder`; return the file to read."""
    if path.suffix != COMPRESSED:
        return path
    target = folder / path.stem
    with path.open('rb') as packed, target.open('wb') as file:
        stream = zstandard.ZstdDecompressor().stream_reader(packed)
        try:
            while (block := stream.read(BLOCK)) and file.tell() < MOST_UNPACKED:
                file.write(block)
            if block:
                size = f'{MOST_UNPACKED // 1024**3} GiB'
                problems.leave_out(f'{path}: is read up to the first {size} of its contents')
        except zstandard.ZstdError as error:
            problems.leave_out(f'{path}: is damaged ({error}); the part before is read')
    return target
