"""What a bag's storage files have in common, whatever their format."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple, Protocol

import zstandard

# Time stamps of one topic that go back by more than this (ns) are a jump of the clock.
JUMP = 1_000_000_000
# Bytes that no message and no chunk of messages has; what claims more is damaged, or a trap.
LARGEST = 512 * 1024 * 1024
BLOCK = 1024 * 1024


class BagError(ValueError):
    """A bag that cannot be read at all; the message names the file and what is wrong with it."""


class Channel(NamedTuple):
    """One topic of a file: its message type and that type's definition, '' where it has none.

    `encoding` is how messages are written, `format` how the definition is (ros2msg, ros2idl).
    """

    topic: str
    msgtype: str
    definition: str
    format: str
    encoding: str


class Record(NamedTuple):
    """One message as it was stored, at a time of the recorder's clock (ns)."""

    topic: str
    time: int
    data: bytes


class Storage(Protocol):
    """One storage file. `stamps` must be read through before the rest is asked for.

    `damage` is then a sentence on what of the file cannot be read, '' for an intact one.
    """

    path: Path
    damage: str

    @property
    def channels(self) -> list[Channel]:
        """The topics of the file."""

    def stamps(self) -> Iterator[tuple[str, int]]:
        """Yield topic and time of every message, in the order they were recorded."""

    def records(self, topics: Collection[str], *, as_recorded: bool) -> Iterator[Record]:
        """Yield the messages of topics, in order of time or in that they were recorded in."""

    def close(self) -> None:
        """Let go of the file."""


def unzstd(data: bytes, limit: int = LARGEST) -> bytes:
    """Return what was compressed, of data that were cut off what comes before the cut.

    Raises ZstdError for other damage, ValueError where it is over `limit` bytes.
    """
    blocks, size = [], 0
    with zstandard.ZstdDecompressor().stream_reader(data) as stream:
        while block := stream.read(BLOCK):
            blocks.append(block)
            size += len(block)
            if size > limit:
                message = f'it is compressed from more than {limit} bytes'
                raise ValueError(message)
    return b''.join(blocks)
