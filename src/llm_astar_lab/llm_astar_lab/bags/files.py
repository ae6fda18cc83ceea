"""Storage files of a bag: which there are, in which order, and what both formats share."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import NamedTuple

import zstandard
from llm_astar_msgs_adapter.errors import LlmAstarError
from llm_astar_msgs_adapter.files import read_yaml

FORMATS = ('.mcap', '.db3')
COMPRESSED = '.zstd'
METADATA = 'metadata.yaml'
# The clock jumped where the times of one topic go back by more than this (ns).
JUMP = 1_000_000_000
# No message and no chunk of messages has more bytes: a chunk is held up to three times while its
# messages are read. A map of 83 million cells fits.
LARGEST = 80 * 2**20
BLOCK = 1024 * 1024
# A file that is compressed as a whole is unpacked up to here.
MOST_UNPACKED = 4 * 1024**3


class BagError(LlmAstarError, ValueError):
    """A bag that cannot be read at all; the message names the file and what is wrong with it."""


class Channel(NamedTuple):
    """One topic of a file: its message type and that type's definition, '' where it has none.

    `encoding` is the format of the messages (cdr), `format` that of the definition (ros2msg,
    ros2idl).
    """

    topic: str
    msgtype: str
    definition: str
    format: str
    encoding: str


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
    def catch(self, *errors: type[Exception], path: Path | None = None) -> Iterator[None]:
        """Leave out what raises one of these errors in the block; `path` goes in front."""
        try:
            yield
        except errors as error:
            named = path is None or str(path) in str(error)
            self.leave_out(str(error) if named else f'{path}: {error}')

    def lines(self) -> list[str]:
        """Return every sentence on what was left out, and the number of those not kept."""
        more = {kind: count - self.limit for kind, count in self._counts.items()}
        return [*self.left_out, *(f'{kind}: {n} more' for kind, n in more.items() if n > 0)]


def storage_files(path: Path, problems: Problems) -> list[Path]:
    """Return the storage files of a bag in their order. Raises BagError."""
    if not path.exists():
        raise BagError(f'{path}: there is no such bag')
    if path.is_file():
        if not is_storage(path):
            known = ', '.join(FORMATS)
            raise BagError(f'{path}: a bag is a folder, or a file ending in one of {known}')
        return [path]
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
        problems.note(f'{file}: is read, though {METADATA} does not name it yet; the recording '
                      'goes on or was cut off')  # fmt: skip
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
    return [(int(part), '') if part.isdecimal() else (-1, part)
            for part in re.split(r'(\d+)', path.name)]  # fmt: skip


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


def unzstd(data: bytes, limit: int = LARGEST) -> bytes:
    """Decompress data; of data that are cut off, return what comes before the cut.

    Raises ZstdError for other damage, ValueError where the result is over `limit` bytes.
    """
    with zstandard.ZstdDecompressor().stream_reader(data) as stream:
        contents: bytes = stream.read(limit + 1)
    if len(contents) > limit:
        raise ValueError(f'it is compressed from more than {limit} bytes')
    return contents
