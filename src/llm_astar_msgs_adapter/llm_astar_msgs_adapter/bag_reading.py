"""Bags as ROS 2 records them, read message by message: mcap and sqlite3, split, compressed.

A folder with or without its metadata.yaml, or a bare file. Messages come in the order of their
times, file by file; where a topic's own times go back within a file, the recorder's clock jumped,
and the file is read in the order it was written in. Nothing is held that grows with the bag.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, NamedTuple

import yaml
import zstandard
from rosbags.serde import SerdeError
from rosbags.typesys import (
    Stores,
    TypesysError,
    get_types_from_idl,
    get_types_from_msg,
    get_typestore,
)
from rosbags.typesys.store import Typestore

from llm_astar_msgs_adapter.bag_file import (
    JUMP,
    MCAP,
    SQLITE,
    BagError,
    Channel,
    Record,
    Storage,
)
from llm_astar_msgs_adapter.bag_mcap import McapFile
from llm_astar_msgs_adapter.bag_sqlite import SqliteFile
from llm_astar_msgs_adapter.bag_types import bag_types

COMPRESSED = '.zstd'
ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
METADATA = 'metadata.yaml'
FORMATS = (MCAP, SQLITE)
# What parsing a definition that somebody else wrote may raise.
DEFINITION_ERRORS = (TypesysError, KeyError, ValueError, TypeError, AssertionError, IndexError)


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


@dataclass
class Problems:
    """What was wrong with a bag: `notes` cost nothing, what was `left_out` is not in the results.

    Beyond `limit` sentences of a kind only their number is kept.
    """

    limit: int = 20
    notes: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    more: dict[str, int] = field(default_factory=dict)
    _seen: dict[str, int] = field(default_factory=dict)

    def note(self, sentence: str) -> None:
        """Say what is odd and costs nothing."""
        if sentence not in self.notes and len(self.notes) < self.limit:
            self.notes.append(sentence)

    def leave_out(self, sentence: str, kind: str = '') -> None:
        """Say what is left out and why; `kind` names what all such sentences are about."""
        count = self._seen[kind] = self._seen.get(kind, 0) + 1
        if kind and count > self.limit:
            self.more[kind] = count - self.limit
        elif sentence not in self.left_out:
            self.left_out.append(sentence)

    def lines(self) -> list[str]:
        """Return every sentence on what was left out, those of a kind too many as a number."""
        return [*self.left_out, *(f'{kind}: {count} more' for kind, count in self.more.items())]


class Bag:
    """A bag, opened for reading. A context manager."""

    def __init__(self, path: str | Path) -> None:
        """Open a bag and look through its index. Raises BagError where there is none to read."""
        self.path = Path(path)
        self.name = _bare_name(self.path)
        self.problems = Problems()
        self.topics: dict[str, Topic] = {}
        self._unpacked = TemporaryDirectory(prefix='llm-astar-bag-')
        self._files: list[tuple[Storage, bool]] = []
        self._embedded = get_typestore(Stores.EMPTY)
        self._aliases: dict[str, str] = {}
        self._refused: set[str] = set()
        try:
            for file in _storage_files(self.path, self.problems):
                self._open(file)
            if not self._files:
                raise BagError('\n'.join(self.problems.left_out) or f'{path}: holds no messages')
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

    @property
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
            storage = _open_storage(self._unpack(path))
        except (BagError, OSError, zstandard.ZstdError) as error:
            self.problems.leave_out(_sentence(error, path))
            return
        self._files.append((storage, self._survey(storage)))
        for channel in storage.channels:
            self._learn(channel)
        self._note_damage(storage)

    def _survey(self, storage: Storage) -> bool:
        """Count a file's messages; tell whether it must be read as recorded."""
        latest: dict[str, int] = {}
        jumped = False
        counts: dict[str, Topic] = {}
        for name, time in storage.stamps():
            topic = counts.setdefault(name, Topic(name, '', 0, time, time))
            topic.count += 1
            topic.first, topic.last = min(topic.first, time), max(topic.last, time)
            if time < latest.get(name, time) - JUMP and not jumped:
                jumped = True
                back = (latest[name] - time) / 1e9
                self.problems.note(
                    f'{storage.path}: the clock jumps back by {back:.3f} s at message '
                    f'{topic.count} of {name}; the file is read in the order it was written in'
                )
            latest[name] = time
        for channel in storage.channels:
            found = counts.get(channel.topic, Topic(channel.topic, ''))
            self._count(channel, found)
        return jumped

    def _count(self, channel: Channel, found: Topic) -> None:
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

    def _learn(self, channel: Channel) -> None:
        """Take up a type's definition from the bag; without a usable one, Jazzy's counts."""
        if not channel.definition or channel.msgtype in self._aliases:
            return
        with suppress(*DEFINITION_ERRORS):
            types = _parse(channel)
            fresh = {n: f for n, f in types.items() if n not in self._embedded.fielddefs}
            name = _own_name(channel.msgtype, types)
            self._embedded.register(fresh)
            self._aliases[channel.msgtype] = name

    def _decode(self, record: Record) -> Message | None:
        if record.topic in self._refused:
            return None
        msgtype = self.topics[record.topic].msgtype
        data = record.data
        try:
            if data[:4] == ZSTD_MAGIC:
                data = zstandard.ZstdDecompressor().decompressobj().decompress(data)
            name, store = self._type(msgtype)
            return Message(record.topic, msgtype, record.time, store.deserialize_cdr(data, name))
        except (SerdeError, zstandard.ZstdError) as error:
            problem = f'a message at {self.seconds(record.time):.3f} s is left out: {error}'
            self.problems.leave_out(
                f'{self.path}: {record.topic}: {problem}', f'{record.topic}: damaged messages'
            )
        except DEFINITION_ERRORS as error:
            self._refused.add(record.topic)
            self.problems.leave_out(
                f'{self.path}: {record.topic} is left out: its type {msgtype} is unknown here and '
                f'the bag does not define it ({error})'
            )
        return None

    def _type(self, msgtype: str) -> tuple[str, Typestore]:
        """Return the name of a type and the store that knows it. Raises KeyError."""
        if msgtype in self._aliases:
            return self._aliases[msgtype], self._embedded
        return msgtype, bag_types()

    def seconds(self, time: int) -> float:
        """Return a time as seconds since the first message."""
        return (time - self.start) / 1e9

    def _note_damage(self, storage: Storage) -> None:
        if storage.damage:
            self.problems.leave_out(storage.damage)

    def _unpack(self, path: Path) -> Path:
        """Return a file as it was before it was compressed as a whole."""
        if path.suffix != COMPRESSED:
            return path
        target = Path(self._unpacked.name, path.stem)
        with path.open('rb') as packed, target.open('wb') as file:
            try:
                shutil.copyfileobj(zstandard.ZstdDecompressor().stream_reader(packed), file)
            except zstandard.ZstdError as error:
                self.problems.leave_out(f'{path}: is damaged ({error}); the part before is read')
        return target


def _storage_files(path: Path, problems: Problems) -> list[Path]:
    """Return the storage files of a bag in their order. Raises BagError."""
    if not path.exists():
        raise BagError(f'{path}: there is no such bag')
    if path.is_file():
        if not _is_storage(path):
            known = ', '.join(FORMATS)
            raise BagError(f'{path}: a bag is a folder, or a file ending in one of {known}')
        return [path]
    held = sorted((item for item in path.iterdir() if _is_storage(item)), key=_natural)
    named = _named_files(path, problems)
    if named is None:
        if not held:
            raise BagError(f'{path}: holds neither {METADATA} nor a file of {", ".join(FORMATS)}')
        return held
    files = []
    for name in named:
        found = next((f for f in held if f.name in (name, name + COMPRESSED)), None)
        if found is None:
            problems.leave_out(f'{path / name}: is missing, though {METADATA} names it')
        else:
            files.append(found)
    return files


def _named_files(path: Path, problems: Problems) -> list[str] | None:
    """Return the names of the files in metadata.yaml, None without a usable one."""
    file = path / METADATA
    if not file.exists():
        problems.note(f'{file}: is missing, as after a recording that was not ended; the files '
                      'beside it are read in order of their names')  # fmt: skip
        return None
    try:
        content = yaml.safe_load(file.read_text(encoding='utf-8'))
        names = content['rosbag2_bagfile_information']['relative_file_paths']
        return [PurePath(str(name)).name for name in names]
    except (OSError, ValueError, yaml.YAMLError, KeyError, TypeError) as error:
        problems.note(f'{file}: cannot be used ({type(error).__name__}: {error}); the files '
                      'beside it are read in order of their names')  # fmt: skip
        return None


def _is_storage(path: Path) -> bool:
    name = path.name.removesuffix(COMPRESSED)
    return path.is_file() and name.endswith(FORMATS)


def _natural(path: Path) -> list[tuple[int, str]]:
    """Return a key that puts bag_10 behind bag_9."""
    return [(int(part), '') if part.isdecimal() else (-1, part)
            for part in re.split(r'(\d+)', path.name)]  # fmt: skip


def _bare_name(path: Path) -> str:
    """Return a bag's name: its folder's or its file's, without endings."""
    path = path.resolve()
    return path.name if path.is_dir() else PurePath(path.name.removesuffix(COMPRESSED)).stem


def _open_storage(path: Path) -> Storage:
    return McapFile(path) if path.suffix == MCAP else SqliteFile(path)


def _sentence(error: Exception, path: Path) -> str:
    return str(error) if str(path) in str(error) else f'{path}: {error}'


def _parse(channel: Channel) -> dict[str, Any]:
    """Return the types in a definition by name."""
    if channel.format != 'ros2idl':
        return dict(get_types_from_msg(channel.definition, channel.msgtype))
    types: dict[str, Any] = {}
    bar = '=' * 80 + '\n'
    for part in channel.definition.split(bar):
        text = part.split('\n', 1)[1] if part.startswith('IDL: ') else part
        if text.strip():
            types.update(get_types_from_idl(text))
    return types


def _own_name(msgtype: str, types: dict[str, Any]) -> str:
    """Return the name a type was parsed under: services' parts come out as messages.

    Raises KeyError where the definition is another's, or a service's events lack their fields.
    """
    package, _, name = msgtype.rpartition('/')
    own = next(n for n in (msgtype, f'{package}/msg/{name}') if n in types)
    fields = {field_name for field_name, _ in types[own][1]}
    if '/srv/' in msgtype and not {'info', 'request', 'response'} <= fields:
        raise KeyError(msgtype)
    return own
