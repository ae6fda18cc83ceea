"""Reads mcap files: by their index where they have one, else record by record.

A file that was cut off has no index; its complete records are read nevertheless.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator
from contextlib import suppress
from heapq import heapify, heappop, heappush
from io import SEEK_CUR, BytesIO
from itertools import islice
from pathlib import Path
from typing import BinaryIO, NamedTuple

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel as McapChannel
from mcap.records import Chunk, ChunkIndex, MessageIndex, Schema

from llm_astar_msgs_adapter.bags.files import LARGEST, BagError, Channel, Record, unzstd

# Messages that are held until those of other chunks before them have been read, in bytes.
MOST_HELD = 256 * 2**20
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
        self._size = path.stat().st_size
        self._file = path.open('rb')
        if self._file.read(len(MAGIC)) != MAGIC:
            self._file.close()
            raise BagError(f'{path}: does not begin as an mcap file does')
        # The index is in the summary at the end of the file, if that was written.
        self._file.seek(0)
        with suppress(*DAMAGE):
            summary = SeekingReader(self._file).get_summary()
            if summary is not None:
                self._schemas, self._channels = dict(summary.schemas), dict(summary.channels)
                self._chunks = sorted(summary.chunk_indexes, key=lambda c: c.chunk_start_offset)

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
        for place in chunk.message_index_offsets.values():
            self._file.seek(place + RECORD.size)
            index = MessageIndex.read(ReadDataStream(self._file))
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
                held -= len(message.data)
                yield message
                continue
            for place, inside in enumerate(self.chunk_messages(offset), start=1):
                if inside.channel not in wanted:
                    continue
                if held + len(inside.data) > MOST_HELD:
                    self._note_damage(f'over {MOST_HELD} bytes of its chunks are of the same time')
                    break
                held += len(inside.data)
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
                self._schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                known = McapChannel.read(stream)
                self._channels[known.id] = known
        except DAMAGE as why:
            self._note_damage(
                f'a record at byte {place} is left out: {str(why) or "it is cut off"}'
            )

    def _note_damage(self, what: str) -> None:
        self.damage = self.damage or f'{self.path}: {what}'


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
