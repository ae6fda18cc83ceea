"""Reads mcap files: by their index where they have one, else record by record.

A file that was cut off has no index; its complete records are read nevertheless.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator
from contextlib import suppress
from heapq import heapify, heappop, heappush
from io import SEEK_CUR, SEEK_END, BytesIO
from itertools import islice
from pathlib import Path
from typing import BinaryIO, NamedTuple

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import FOOTER_SIZE
from mcap.records import Channel as McapChannel
from mcap.records import (
    Chunk,
    ChunkIndex,
    Footer,
    McapRecord,
    Message,
    MessageIndex,
    Schema,
)
from mcap.stream_reader import StreamReader

from llm_astar_lab.bags.files import LARGEST, BagError, Channel, Record, unzstd

# Messages that are held until those of other chunks before them have been read, in bytes.
MOST_HELD = 80 * 2**20
# Of the index: chunks of the file, which take 1 kB each, and the bytes on one chunk's messages. A
# file with more is read record by record.
MOST_CHUNKS = 100_000
MOST_INDEX_BYTES = 8 * 2**20
# Of topics, types and the index at the end of a file.
MOST_SUMMARY = 24 * 2**20
# What a message takes besides its bytes while it is held.
MESSAGE_BYTES = 300
MAGIC = b'\x89MCAP0\r\n'
RECORD = struct.Struct('<BQ')
MESSAGE = struct.Struct('<HIQQ')
# The records that are read. Others are skipped, such as attachments of any size.
READ = (Opcode.CHUNK, Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL)
# What reading damaged bytes may raise.
DAMAGE = (
    McapError, ValueError, RuntimeError, OverflowError, MemoryError, OSError, struct.error,
    zstandard.ZstdError,
)  # fmt: skip


class StoredMessage(NamedTuple):
    """A message as stored: its channel's number, time (ns) and bytes."""

    channel: int
    time: int
    data: bytes


class McapReader:
    """One mcap file; a Storage."""

    def __init__(self, path: Path) -> None:
        """Open a file. Raises BagError where it is not an mcap file."""
        self.path = path
        self.damage: str | None = None
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, McapChannel] = {}
        self._chunks: list[ChunkIndex] = []
        self._described = 0
        self._size = path.stat().st_size
        self._file = path.open('rb')
        if self._file.read(len(MAGIC)) != MAGIC:
            self._file.close()
            raise BagError(f'{path}: does not begin as an mcap file does')
        with suppress(*DAMAGE):
            self._read_summary()

    def _read_summary(self) -> None:
        """Read the topics and the index of chunks from the end of the file, if they are there.

        The mcap library's own reader of it would open every chunk of a file that says that its
        summary begins before them. Raises one of DAMAGE.
        """
        self._file.seek(-(FOOTER_SIZE + len(MAGIC)), SEEK_END)
        footer = next(iter(summary_records(self._file)))
        if not isinstance(footer, Footer) or footer.summary_start == 0:
            return
        self._file.seek(footer.summary_start)
        schemas, channels, chunks = {}, {}, []
        for record in summary_records(self._file):
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, McapChannel):
                channels[record.id] = record
            elif isinstance(record, ChunkIndex):
                chunks.append(record)
            elif isinstance(record, (Chunk, Message)):
                raise McapError('its summary has messages')
            if (
                self._file.tell() - footer.summary_start > MOST_SUMMARY
                or len(chunks) > MOST_CHUNKS
            ):
                raise McapError('its summary is too large')
        self._schemas, self._channels = schemas, channels
        self._chunks = sorted(chunks, key=lambda chunk: chunk.chunk_start_offset)

    @property
    def channels(self) -> list[Channel]:
        """The topics of the file."""
        channels = []
        for channel in self._channels.values():
            schema = self._schemas.get(channel.schema_id)
            name, text, form = '', '', ''
            if schema is not None:
                name, form = schema.name, schema.encoding
                text = schema.data.decode(errors='replace')
            channels.append(Channel(channel.topic, name, text, form, channel.message_encoding))
        return channels

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def stamps(self) -> Iterator[tuple[str, int]]:
        """Yield topic and time (ns) of every message, in the order of recording."""
        found = self.indexed_stamps() if self._chunks else self.as_recorded()
        for channel, time, *_ in found:
            if channel in self._channels:
                yield self._channels[channel].topic, time

    def records(self, topics: Collection[str], *, as_recorded: bool) -> Iterator[Record]:
        """Yield the messages of topics; those of a file without index in order of recording."""
        wanted = {
            number: channel.topic
            for number, channel in self._channels.items()
            if channel.topic in topics
        }
        by_time = self._chunks and not as_recorded
        for message in self.in_order_of_time(wanted) if by_time else self.as_recorded():
            if message.channel in wanted:
                yield Record(wanted[message.channel], message.time, message.data)

    def indexed_stamps(self) -> Iterator[tuple[int, int]]:
        """Yield channel and time of every message from the index behind each chunk."""
        for chunk in self._chunks:
            try:
                found = self._index_of(chunk)
            except DAMAGE:
                found = []
            # A chunk without an index is opened.
            yield from found or (
                (message.channel, message.time)
                for message in self.chunk_messages(chunk.chunk_start_offset)
            )

    def _index_of(self, chunk: ChunkIndex) -> list[tuple[int, int]]:
        """Return channel and time of a chunk's messages in their order; empty without an index."""
        found: list[tuple[int, int, int]] = []
        left = MOST_INDEX_BYTES
        for place in chunk.message_index_offsets.values():
            self._file.seek(place)
            _, length = RECORD.unpack(self._file.read(RECORD.size))
            left -= length
            if left < 0:
                raise ValueError(f'its index has over {MOST_INDEX_BYTES} bytes')
            index = MessageIndex.read(ReadDataStream(BytesIO(self._file.read(length))))
            found += [(offset, index.channel_id, time) for time, offset in index.records]
        return [(channel, time) for _, channel, time in sorted(found)]

    def in_order_of_time(self, wanted: Collection[int]) -> Iterator[StoredMessage]:
        """Yield the messages of channels by time; a chunk is opened when its first one is due."""
        waiting: list[tuple[int, int, int, StoredMessage | None]] = [
            (chunk.message_start_time, chunk.chunk_start_offset, 0, None)
            for chunk in self._chunks
            if not chunk.message_index_offsets
            or not chunk.message_index_offsets.keys().isdisjoint(wanted)
        ]
        heapify(waiting)
        held = 0
        while waiting:
            _, offset, _, message = heappop(waiting)
            if message is not None:
                held -= len(message.data) + MESSAGE_BYTES
                yield message
                continue
            for place, inside in enumerate(self.chunk_messages(offset), start=1):
                if inside.channel not in wanted:
                    continue
                size = len(inside.data) + MESSAGE_BYTES
                if held + size > MOST_HELD:
                    self._note_damage(f'over {MOST_HELD} bytes of its chunks are of the same time')
                    break
                held += size
                heappush(waiting, (inside.time, offset, place, inside))

    def chunk_messages(self, offset: int) -> Iterator[StoredMessage]:
        """Yield the messages of the chunk at a byte of the file."""
        if not 0 <= offset < self._size:
            self._note_damage(f'its index names a chunk at byte {offset}, where there is none')
            return
        self._file.seek(offset)
        for opcode, payload, whole in islice(walk_records(self._file, self._size), 1):
            yield from self._messages(opcode, payload, offset, whole=whole)

    def as_recorded(self) -> Iterator[StoredMessage]:
        """Yield all messages in the order of recording, up to where the file is cut off."""
        self._file.seek(len(MAGIC))
        ended = False
        for opcode, payload, whole in walk_records(self._file, self._size):
            ended = ended or opcode in (Opcode.DATA_END, Opcode.FOOTER)
            place = self._file.tell() - len(payload)
            yield from self._messages(opcode, payload, place, whole=whole)
        if not ended:
            size = f'{self._size} bytes'
            self._note_damage(f'was cut off, at {size}; what was written whole before is read')

    def _messages(
        self, opcode: int, payload: bytes, place: int, *, whole: bool
    ) -> Iterator[StoredMessage]:
        """Yield the messages in one record of the file; of a cut chunk, those before the cut."""
        if opcode != Opcode.CHUNK:
            yield from self._read_record(opcode, payload, place) if whole else ()
            return
        try:
            data = chunk_contents(payload, whole=whole)
        except DAMAGE as why:
            self._note_damage(
                f'the chunk at byte {place} is left out: {str(why) or "it is cut off"}'
            )
            return
        for inner, content, complete in walk_records(BytesIO(data), len(data)):
            yield from self._read_record(inner, content, place) if complete else ()

    def _read_record(self, opcode: int, payload: bytes, place: int) -> Iterator[StoredMessage]:
        """Yield a message; remember a schema or a channel."""
        stream = ReadDataStream(BytesIO(payload))
        try:
            if opcode == Opcode.MESSAGE:
                channel, _, time, _ = MESSAGE.unpack_from(payload)
                yield StoredMessage(channel, time, payload[MESSAGE.size :])
            elif opcode == Opcode.SCHEMA:
                schema = Schema.read(stream)
                if self._describes(schema.id not in self._schemas, payload):
                    self._schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                channel = McapChannel.read(stream)
                if self._describes(channel.id not in self._channels, payload):
                    self._channels[channel.id] = channel
        except DAMAGE as why:
            self._note_damage(
                f'a record at byte {place} is left out: {str(why) or "it is cut off"}'
            )

    def _describes(self, is_new: bool, payload: bytes) -> bool:
        """Tell whether to keep a schema or a channel, which files repeat in each chunk.

        Raises ValueError where all that are kept would take more than MOST_SUMMARY bytes.
        """
        if is_new:
            self._described += len(payload)
            if self._described > MOST_SUMMARY:
                raise ValueError(f'topics and types take over {MOST_SUMMARY} bytes')
        return is_new

    def _note_damage(self, what: str) -> None:
        self.damage = self.damage or f'{self.path}: {what}'


def summary_records(stream: BinaryIO) -> Iterator[McapRecord]:
    """Yield the records of a summary up to its footer. Raises one of DAMAGE."""
    return StreamReader(
        stream, skip_magic=True, emit_chunks=True, record_size_limit=MOST_SUMMARY
    ).records


def walk_records(stream: BinaryIO, size: int) -> Iterator[tuple[int, bytes, bool]]:
    """Yield opcode and payload of each record from here on, and whether it is complete.

    The payload is empty for records that are not read and for those larger than LARGEST. Zeros,
    which a power cut may leave at the end of a file, end the records.
    """
    while len(head := stream.read(RECORD.size)) == RECORD.size and head[0]:
        opcode, length = RECORD.unpack(head)
        left = size - stream.tell()
        if opcode in READ and min(length, left) <= LARGEST:
            payload = stream.read(min(length, left))
            yield opcode, payload, len(payload) == length
        else:
            stream.seek(min(length, left), SEEK_CUR)
            yield opcode, b'', False


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
