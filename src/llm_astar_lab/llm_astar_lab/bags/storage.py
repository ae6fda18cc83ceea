# Copyright 2026 The LLM-A* for ROS 2 contributors
# SPDX-License-Identifier: Apache-2.0

"""The storage files of bags: mcap, read record by record, and sqlite3, of every version.

The readers of mcap and rosbags are for files one trusts. They decompress a chunk to whatever size
it has, hold all messages of chunks whose times overlap, and run what a database computes: a file
of 20 kB fills a gigabyte. `mcap.reader` opens every chunk before it yields a message in the order
of recording, and neither reads on behind damage, or in a file that was cut off. So they are not
used here; the records of mcap are parsed by its library.
"""

import sqlite3
import struct
import zlib
from collections.abc import Collection, Iterator
from contextlib import suppress
from heapq import heappop, heappush
from io import BytesIO
from itertools import chain, pairwise, starmap
from pathlib import Path
from typing import Any, NamedTuple

import lz4.frame
import zstandard
from llm_astar_msgs_adapter.errors import LlmAstarError, raising
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel as McapChannel
from mcap.records import Chunk, Schema

# No message and no chunk of messages has more bytes: a chunk is held up to three times while its
# messages are read. A map of 83 million cells fits.
LARGEST = 80 * 2**20
# Messages that are held until those of other chunks before them have been read, in bytes.
MOST_HELD = 80 * 2**20
# What a message takes besides its bytes while it is held.
MESSAGE_BYTES = 300
# A file with more chunks, or messages outside of chunks, is read in the order of recording.
MOST_PARTS = 100_000
# Of topics and types in a file.
MOST_DESCRIPTIONS = 24 * 2**20
# A part after all others, without messages.
LAST = (2**64, 0, 0, 0, 0)
MAGIC = b'\x89MCAP0\r\n'
RECORD = struct.Struct('<BQ')
MESSAGE = struct.Struct('<HIQQ')
# The records that are read. Others are skipped, such as attachments of any size.
DESCRIPTIONS: dict[int, Any] = {Opcode.SCHEMA: Schema, Opcode.CHANNEL: McapChannel}
READ = (Opcode.CHUNK, Opcode.MESSAGE, *DESCRIPTIONS)
NO_SCHEMA = Schema(0, b'', '', '')
# What reading damaged bytes may raise.
DAMAGE = (
    McapError, ValueError, RuntimeError, OverflowError, MemoryError, OSError, struct.error,
    zstandard.ZstdError,
)  # fmt: skip
# Of the tables of a bag, one that is a view or virtual, or that has computed columns.
ODD_TABLE = """
    SELECT item.name FROM sqlite_master AS item LEFT JOIN pragma_table_xinfo(item.name) AS field
    WHERE lower(item.name) IN ('messages', 'topics', 'message_definitions')
    AND (item.type != 'table' OR item.sql LIKE '%VIRTUAL%' OR field.hidden)
"""
TIMED = "typeof(timestamp) = 'integer'"
FITS = f"typeof(data) = 'blob' AND length(data) <= {LARGEST}"
# Texts are only read where they are no longer; no definition that is used is.
SHORT = f'length({{}}) <= {2**20}'
MOST_TOPICS = 10_000


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


class Record(NamedTuple):
    """A message as stored: its channel's number, time (ns) and bytes."""

    channel: int
    time: int
    data: bytes


class McapFile:
    """One mcap file, complete or cut off.

    `channels` are its topics by number, known once `stamps` has been read to its end; `damage` is
    then a sentence on what cannot be read of the file, None for an intact one.
    """

    def __init__(self, path: Path) -> None:
        """Open a file. Raises BagError where it is not an mcap file."""
        self.path = path
        self.damage: str | None = None
        # Schemas and channels by opcode and number.
        self._known: dict[int, dict[int, Any]] = {Opcode.SCHEMA: {}, Opcode.CHANNEL: {}}
        # Of each chunk, or message outside of one: its first time (ns), its first byte, opcode and
        # length, and its channels as the bits of a number, which takes less than a set.
        self._parts: list[tuple[int, int, int, int, int]] = []
        self._has_index = False
        self._described = 0
        self._size = path.stat().st_size
        self._file = path.open('rb')
        if self._file.read(len(MAGIC)) != MAGIC:
            self._file.close()
            raise BagError(f'{path}: does not begin as an mcap file does')

    @property
    def channels(self) -> dict[int, Channel]:
        """The topics of the file."""
        found = {}
        for number, channel in self._known[Opcode.CHANNEL].items():
            schema = self._known[Opcode.SCHEMA].get(channel.schema_id, NO_SCHEMA)
            kind = schema.name, schema.data.decode(errors='replace'), schema.encoding
            found[number] = Channel(channel.topic, *kind, channel.message_encoding)
        return found

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def stamps(self) -> Iterator[tuple[int, int]]:
        """Yield channel and time (ns) of every message, in the order of recording."""
        for opcode, place, length in self._walk():
            self._has_index |= opcode == Opcode.CHUNK_INDEX
            first, channels = LAST[0], 0
            for channel, time, _ in self._messages(opcode, place, length):
                first = min(first, time)
                channels |= 1 << channel
                yield channel, time
            if channels and len(self._parts) <= MOST_PARTS:
                self._parts.append((first, place, opcode, length, channels))

    def records(self, wanted: Collection[int], *, as_recorded: bool) -> Iterator[Record]:
        """Yield the messages of channels by time; without an index in the order of recording."""
        if as_recorded or not self._has_index or len(self._parts) > MOST_PARTS:
            found = chain.from_iterable(starmap(self._messages, self._walk()))
            yield from (item for item in found if item.channel in wanted)
            return
        held: list[tuple[int, int, int, Record]] = []
        size = 0
        bits = sum(1 << channel for channel in wanted)
        parts = sorted(part for part in self._parts if part[-1] & bits)
        for (_, place, opcode, length, _), following in pairwise([*parts, LAST]):
            for number, message in enumerate(self._messages(opcode, place, length)):
                if message.channel not in wanted:
                    continue
                cost = len(message.data) + MESSAGE_BYTES
                if size + cost > MOST_HELD:
                    self._note_damage(f'over {MOST_HELD} bytes of its chunks are of the same time')
                    break
                size += cost
                heappush(held, (message.time, place, number, message))
            # The next part is opened when its first message is due.
            while held and held[0][:2] < following[:2]:
                message = heappop(held)[-1]
                size -= len(message.data) + MESSAGE_BYTES
                yield message

    def _walk(self) -> Iterator[tuple[int, int, int]]:
        """Yield opcode, first byte and length of each record, up to where the file is cut off.

        Zeros, which a power cut may leave at the end of a file, end the records.
        """
        place, is_complete = len(MAGIC), False
        while len(head := self._read(place, RECORD.size)) == RECORD.size and head[0]:
            opcode, length = RECORD.unpack(head)
            is_complete = is_complete or opcode in (Opcode.DATA_END, Opcode.FOOTER)
            yield opcode, place + RECORD.size, length
            place += RECORD.size + length
        if not is_complete:
            size = f'{self._size} bytes'
            self._note_damage(f'was cut off, at {size}; what was written whole before is read')

    def _messages(self, opcode: int, place: int, length: int) -> Iterator[Record]:
        """Yield the messages in one record of the file; of a cut chunk, those before the cut."""
        if opcode not in READ:
            return
        is_chunk = opcode == Opcode.CHUNK
        head = 0 if is_chunk else RECORD.size
        try:
            data = self._read(place - head, head + length)
            data = chunk_contents(data, whole=len(data) == length) if is_chunk else data
        except DAMAGE as why:
            what = 'the chunk' if is_chunk else 'a record'
            self._leave_out(f'{what} at byte {place - RECORD.size}', why)
            return
        for kind, payload in records_in(data):
            try:
                if kind == Opcode.MESSAGE:
                    channel, _, time, _ = MESSAGE.unpack_from(payload)
                    yield Record(channel, time, payload[MESSAGE.size :])
                elif kind in DESCRIPTIONS:
                    self._describe(kind, payload)
            except DAMAGE as why:  # noqa: PERF203 - the record alone is left out
                self._leave_out(f'a record at byte {place}', why)

    def _read(self, place: int, length: int) -> bytes:
        """Read from a byte on, as far as the file goes. Raises ValueError for over LARGEST."""
        length = max(0, min(length, self._size - place))
        if length > LARGEST:
            raise ValueError(f'it has {length} bytes')
        self._file.seek(min(place, self._size))
        return self._file.read(length)

    def _describe(self, opcode: int, payload: bytes) -> None:
        """Remember a schema or a channel. Raises one of DAMAGE, also where they take too much."""
        known = self._known[opcode]
        found = DESCRIPTIONS[opcode].read(ReadDataStream(BytesIO(payload)))
        # Files repeat them in each chunk.
        self._described += len(payload) if found.id not in known else 0
        if self._described > MOST_DESCRIPTIONS:
            raise ValueError(f'topics and types take over {MOST_DESCRIPTIONS} bytes')
        known.setdefault(found.id, found)

    def _leave_out(self, what: str, why: Exception) -> None:
        self._note_damage(f'{what} is left out: {str(why) or "it is cut off"}')

    def _note_damage(self, what: str) -> None:
        self.damage = self.damage or f'{self.path}: {what}'


def records_in(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and contents of each record that is whole."""
    end = 0
    while len(head := data[end : end + RECORD.size]) == RECORD.size and head[0]:
        opcode, length = RECORD.unpack(head)
        begin = end + RECORD.size
        end = begin + length
        if end <= len(data):
            yield opcode, data[begin:end]


def chunk_contents(payload: bytes, *, whole: bool) -> bytes:
    """Return the records in a chunk; of one that is not `whole`, those before the cut.

    Raises ValueError for a wrong checksum, an unknown compression, and more bytes than the chunk
    says it holds.
    """
    chunk = Chunk.read(ReadDataStream(BytesIO(payload)))
    size = chunk.uncompressed_size
    data: bytes = chunk.data
    if chunk.compression and size > LARGEST:
        raise ValueError(f'it would fill {size} bytes')
    if chunk.compression == 'zstd':
        data = unzstd(data, size)
    elif chunk.compression == 'lz4':
        data = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size)
    elif chunk.compression:
        raise ValueError(f'compression {chunk.compression!r} is unknown')
    if whole and chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError('its checksum is wrong')
    return data


def unzstd(data: bytes, limit: int = LARGEST) -> bytes:
    """Decompress data; of data that are cut off, return what comes before the cut.

    Raises ZstdError for other damage, ValueError where the result is over `limit` bytes.
    """
    with zstandard.ZstdDecompressor().stream_reader(data) as stream:
        contents: bytes = stream.read(limit + 1)
    if len(contents) > limit:
        raise ValueError(f'it is compressed from more than {limit} bytes')
    return contents


class SqliteFile:
    """One db3 file, opened read-only; `channels` and `damage` are those of an `McapFile`."""

    def __init__(self, path: Path) -> None:
        """Open a file. Raises BagError where it does not hold a bag."""
        self.path = path
        self.damage: str | None = None
        # A write-ahead log next to it holds its last messages and needs a real connection.
        log = path.with_name(path.name + '-wal')
        mode = 'ro' if log.exists() and log.stat().st_size else 'ro&immutable=1'
        what = f'{path}: is not a bag that sqlite3 can read: '
        with raising(BagError, what, sqlite3.Error, ValueError, OverflowError):
            self._database = sqlite3.connect(f'{path.resolve().as_uri()}?mode={mode}', uri=True)
            # Without this, sqlite refuses a file that is shorter than its header says.
            self._database.execute('PRAGMA writable_schema=ON')
            check_tables(self._database)
            self.channels = dict(self._read_channels())

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def stamps(self) -> Iterator[tuple[int, int]]:
        """Yield channel and time (ns) of every message, in the order of recording."""
        return self._rows('topic_id, timestamp', TIMED, 'id')

    def records(self, wanted: Collection[int], *, as_recorded: bool) -> Iterator[Record]:
        """Yield the messages of channels, in order of time or of recording."""
        condition = f'{TIMED} AND {FITS} AND topic_id IN ({",".join(map(str, wanted))})'
        order = 'id' if as_recorded else 'timestamp, id'
        return map(Record._make, self._rows('topic_id, timestamp, data', condition, order))

    def _rows(self, columns: str, condition: str, order: str) -> Iterator[Any]:
        """Yield the messages that meet a condition, up to where the file is damaged."""
        query = f'SELECT {columns} FROM messages WHERE {condition} ORDER BY {order}'  # noqa: S608
        count = 0
        try:
            for count, row in enumerate(self._database.execute(query), start=1):  # noqa: B007
                yield row
        except sqlite3.Error as error:
            read = f'the {count} messages before are read'
            self.damage = f'{self.path}: is damaged ({error}); {read}'

    def _read_channels(self) -> Iterator[tuple[int, Channel]]:
        """Yield the topics of the file with their numbers."""
        definitions = {}
        # Bags from before Iron have no definitions.
        with suppress(sqlite3.OperationalError):
            query = (
                'SELECT topic_type, encoded_message_definition, encoding '  # noqa: S608
                f'FROM message_definitions WHERE {SHORT.format("encoded_message_definition")}'
            )
            definitions = {name: found for name, *found in self._database.execute(query)}
        query = (
            'SELECT id, name, type, serialization_format FROM topics '  # noqa: S608 - constants
            f'WHERE {SHORT.format("name")} LIMIT {MOST_TOPICS}'
        )
        for number, topic, msgtype, encoding in self._database.execute(query):
            text, form = definitions.get(msgtype, ('', ''))
            channel = Channel(topic, msgtype, text, form, encoding)
            if all(isinstance(item, str) for item in channel):
                yield number, channel


def check_tables(database: sqlite3.Connection) -> None:
    """Raise ValueError where a bag's table is a view or has computed columns.

    What these yield takes as much time and memory as their author likes.
    """
    if found := database.execute(ODD_TABLE).fetchone():
        raise ValueError(f'{found[0]} is no plain table')


Storage = McapFile | SqliteFile
