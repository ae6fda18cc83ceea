"""mcap files as storage: by their index where they have one, else record by record.

A file that was cut off has no index; what was written whole is read all the same.
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

from llm_astar_msgs_adapter.bags.records import LARGEST, BagError, Channel, Record, unzstd

MAGIC = b'\x89MCAP0\r\n'
RECORD = struct.Struct('<BQ')
MESSAGE = struct.Struct('<HIQQ')
# The records that are read; others, attachments of any size among them, are passed over.
READ = (Opcode.CHUNK, Opcode.MESSAGE, Opcode.SCHEMA, Opcode.CHANNEL)
# What reading bytes that are not as they were written may raise.
DAMAGE = (
    McapError, ValueError, RuntimeError, OverflowError, MemoryError, OSError, struct.error,
    zstandard.ZstdError,
)  # fmt: skip


class _Written(NamedTuple):
    """A message as it stands in the file."""

    channel: int
    time: int
    data: bytes


class McapFile:
    """One mcap file."""

    def __init__(self, path: Path) -> None:
        """Open a file. Raises BagError where it is no mcap file."""
        self.path = path
        self.damage = ''
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, McapChannel] = {}
        self._chunks: list[ChunkIndex] = []
        self._size = path.stat().st_size
        self._file = path.open('rb')
        if self._file.read(len(MAGIC)) != MAGIC:
            self._file.close()
            raise BagError(f'{path}: does not begin as an mcap file does')
        self._read_index()

    @property
    def channels(self) -> list[Channel]:
        """The topics of the file."""
        return [self._channel(channel) for channel in self._channels.values()]

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def stamps(self) -> Iterator[tuple[str, int]]:
        """Yield topic and time of every message, in the order they were recorded."""
        for channel, time in self._indexed() if self._chunks else self._scanned():
            if channel in self._channels:
                yield self._channels[channel].topic, time

    def records(self, topics: Collection[str], *, as_recorded: bool) -> Iterator[Record]:
        """Yield the messages of topics; a file without an index as they were recorded."""
        wanted = {
            number: channel.topic
            for number, channel in self._channels.items()
            if channel.topic in topics
        }
        ordered = self._as_recorded() if as_recorded or not self._chunks else self._timely(wanted)
        for message in ordered:
            if message.channel in wanted:
                yield Record(wanted[message.channel], message.time, message.data)

    def _read_index(self) -> None:
        """Take the summary at the end of the file, where it is there and whole."""
        with suppress(*DAMAGE):
            summary = SeekingReader(self._file).get_summary() if self._rewind() else None
            if summary is not None:
                self._schemas, self._channels = dict(summary.schemas), dict(summary.channels)
                self._chunks = sorted(summary.chunk_indexes, key=lambda c: c.chunk_start_offset)

    def _rewind(self) -> bool:
        return self._file.seek(0) == 0

    def _indexed(self) -> Iterator[tuple[int, int]]:
        """Yield channel and time of every message from the index behind each chunk."""
        for chunk in self._chunks:
            try:
                found = self._index_of(chunk)
            except DAMAGE:
                found = []
            if not found:
                found = [(m.channel, m.time) for m in self._chunk_at(chunk.chunk_start_offset)]
            yield from found

    def _index_of(self, chunk: ChunkIndex) -> list[tuple[int, int]]:
        """Return channel and time of a chunk's messages in their order, none without an index."""
        found: list[tuple[int, int, int]] = []
        for place in chunk.message_index_offsets.values():
            self._file.seek(place + RECORD.size)
            index = MessageIndex.read(ReadDataStream(self._file))
            found += [(offset, index.channel_id, time) for time, offset in index.records]
        return [(channel, time) for _, channel, time in sorted(found)]

    def _scanned(self) -> Iterator[tuple[int, int]]:
        for message in self._as_recorded():
            yield message.channel, message.time

    def _timely(self, wanted: Collection[int]) -> Iterator[_Written]:
        """Yield messages in order of time; chunks are opened as their time comes."""
        waiting: list[tuple[int, int, int, _Written | None]] = [
            (chunk.message_start_time, chunk.chunk_start_offset, 0, None)
            for chunk in self._chunks
            if not chunk.message_index_offsets
            or not chunk.message_index_offsets.keys().isdisjoint(wanted)
        ]
        heapify(waiting)
        while waiting:
            _, offset, _, message = heappop(waiting)
            if message is not None:
                yield message
                continue
            for place, inside in enumerate(self._chunk_at(offset), start=1):
                if inside.channel in wanted:
                    heappush(waiting, (inside.time, offset, place, inside))

    def _chunk_at(self, offset: int) -> Iterator[_Written]:
        if not 0 <= offset < self._size:
            self._complain(f'its index names a chunk at byte {offset}, where there is none')
            return
        self._file.seek(offset)
        for opcode, payload, whole in islice(_walk(self._file, self._size), 1):
            yield from self._messages(opcode, payload, offset, whole=whole)

    def _as_recorded(self) -> Iterator[_Written]:
        """Yield messages as they stand in the file, as far as it goes."""
        self._file.seek(len(MAGIC))
        ended = False
        for opcode, payload, whole in _walk(self._file, self._size):
            ended = ended or opcode in (Opcode.DATA_END, Opcode.FOOTER)
            place = self._file.tell() - len(payload)
            yield from self._messages(opcode, payload, place, whole=whole)
        if not ended:
            size = f'{self._size} bytes'
            self._complain(f'was cut off, at {size}; what was written whole before is read')

    def _messages(
        self, opcode: int, payload: bytes, place: int, *, whole: bool
    ) -> Iterator[_Written]:
        """Yield the messages in one record of the file, of an unfinished chunk those before."""
        if opcode != Opcode.CHUNK:
            yield from self._read_record(opcode, payload, place) if whole else ()
            return
        try:
            data = _contents(payload, whole=whole)
        except DAMAGE as why:
            self._complain(f'the chunk at byte {place} is left out: {str(why) or "it is cut off"}')
            return
        for inner, content, complete in _walk(BytesIO(data), len(data)):
            yield from self._read_record(inner, content, place) if complete else ()

    def _read_record(self, opcode: int, payload: bytes, place: int) -> Iterator[_Written]:
        """Yield the message a record is, if it is one; keep what a schema or a channel tells."""
        stream = ReadDataStream(BytesIO(payload))
        try:
            if opcode == Opcode.MESSAGE:
                channel, _, time, _ = MESSAGE.unpack_from(payload)
                yield _Written(channel, time, payload[MESSAGE.size :])
            elif opcode == Opcode.SCHEMA:
                schema = Schema.read(stream)
                self._schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                told = McapChannel.read(stream)
                self._channels[told.id] = told
        except DAMAGE as why:
            self._complain(f'a record at byte {place} is left out: {str(why) or "it is cut off"}')

    def _channel(self, channel: McapChannel) -> Channel:
        schema = self._schemas.get(channel.schema_id)
        if schema is None:
            return Channel(channel.topic, '', '', '', channel.message_encoding)
        text = schema.data.decode(errors='replace')
        return Channel(channel.topic, schema.name, text, schema.encoding, channel.message_encoding)

    def _complain(self, what: str) -> None:
        self.damage = self.damage or f'{self.path}: {what}'


def _walk(stream: BinaryIO, size: int) -> Iterator[tuple[int, bytes, bool]]:
    """Yield opcode and payload of each record from here on, and whether it is all there.

    Payloads that nobody reads, and those too large to be any, come empty. Zeros, as a power cut
    leaves them at the end of a file, are no record.
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


def _contents(payload: bytes, *, whole: bool) -> bytes:
    """Return the records in a chunk; of one that is cut off, those before the cut.

    Raises ValueError where a whole one is not what was written.
    """
    chunk = Chunk.read(ReadDataStream(BytesIO(payload)))
    data = _decompress(chunk)
    if whole and chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError('its checksum is wrong')
    return data


def _decompress(chunk: Chunk) -> bytes:
    """Return what a chunk holds, and no more than it says it does."""
    if chunk.compression == '':
        return chunk.data
    if chunk.uncompressed_size > LARGEST:
        raise ValueError(f'it would fill {chunk.uncompressed_size} bytes')
    if chunk.compression == 'zstd':
        return unzstd(chunk.data, chunk.uncompressed_size)
    if chunk.compression == 'lz4':
        decompress = lz4.frame.LZ4FrameDecompressor().decompress
        data: bytes = decompress(chunk.data, max_length=chunk.uncompressed_size)
        return data
    raise ValueError(f'compression {chunk.compression!r} is unknown')
