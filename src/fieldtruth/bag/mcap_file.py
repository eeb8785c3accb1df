# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""MCAP files with messages of ROS 2 (CDR) or ROS 1, as ``ros2 bag record``, Foxglove and our own export write them.

A file without a summary, as an aborted recording leaves it, is read to its end once. Messages outside of chunks are
read in groups, each of which is a chunk for all who read it.
"""

import os
import re
import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, ChunkIndex, Schema
from rosbags.typesys import TypesysError

from fieldtruth.bag.file import MCAP, BagError, ChunkInfo, Row, StoredFile
from fieldtruth.bag.ros2 import Ros2Layout, Ros2Type, StoredTopic, connections_of

_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _INDEX, _FOOTER = 0x03, 0x04, 0x05, 0x06, 0x07, 0x02
_RECORD: Final = struct.Struct("<BQ")
"""Kind and size of a record."""
_HEAD: Final = struct.Struct("<HIQQ")
"""Channel, sequence number, log time and publish time [ns] of a message."""
_LATCHED: Final = re.compile(r"durability: *(1|transient_local)\b")
"""Of a channel's quality of service: late subscribers get its last message."""
_GROUP: Final = 2**22
"""Bytes after which a group of messages outside of chunks ends."""
_DAMAGE: Final = (McapError, zstandard.ZstdError, struct.error, RuntimeError, ValueError, IndexError, OverflowError)


class McapLayout(Ros2Layout):
    """Chunks of an MCAP file."""

    def unpack(self, path: Path, position: int) -> bytes:
        """Read and decompress the chunk, or the group of messages, at a position in a file."""
        with path.open("rb") as source:
            return unpacked(source, position)

    def rows(self, chunk: bytes, at: int = 0) -> Iterator[Row]:
        """Yield the messages in a decompressed chunk, from an offset on, where one begins."""
        while at < len(chunk):
            kind, size = _RECORD.unpack_from(chunk, at)
            at += _RECORD.size
            if at + size > len(chunk):
                raise ValueError("a record is truncated at the end of its chunk")
            if kind == _MESSAGE:
                number, _, stamp, _ = _HEAD.unpack_from(chunk, at)
                yield stamp, number, at + _HEAD.size, size - _HEAD.size
            at += size


class McapFile(StoredFile):
    """An open MCAP file."""

    def __init__(self, path: Path) -> None:
        self._path, self._source = path, path.open("rb")
        try:
            found = _summary(self._source) or _scan(self._source)
            channels = (_stored_topic(number, found) for number in found.channels)
            self.connections, encodings = connections_of(path, channels)
            self.layout = McapLayout(encodings)
        except _DAMAGE as error:
            self.close()
            raise BagError(
                f"cannot read {path}: {' '.join(str(error).split()) or 'it is damaged or truncated'}"
            ) from error
        known = self.layout.encodings.keys()
        self._index = {chunk.chunk_start_offset: chunk.message_index_offsets for chunk in found.indexes}
        self.chunks = [chunk for chunk in found.chunks if not known.isdisjoint(chunk.counts)]
        self.start_ns = min((chunk.start_ns for chunk in self.chunks), default=2**63 - 1)
        self.end_ns = max((chunk.end_ns for chunk in self.chunks), default=-1)

    def index(self, chunk: ChunkInfo) -> Iterator[tuple[int, int, int]]:
        """Yield connection, stamp [ns] and offset in its chunk of each message."""
        if chunk.pos not in self._index:
            rows = self.layout.rows(unpacked(self._source, chunk.pos))
            yield from ((number, stamp, at - _HEAD.size - _RECORD.size) for stamp, number, at, _ in rows)
            return
        for number, position in self._index[chunk.pos].items():
            self._source.seek(position)
            kind, size = _RECORD.unpack(self._source.read(_RECORD.size))
            data = _read(self._source, size)
            if kind != _INDEX or struct.unpack_from("<HI", data) != (number, size - 6):
                raise ValueError("the index of a chunk is damaged")
            yield from ((number, stamp, offset) for stamp, offset in struct.iter_unpack("<QQ", data[6:]))

    def close(self) -> None:
        """Close the file."""
        self._source.close()


class _Found(NamedTuple):
    """Contents of a file."""

    schemas: dict[int, Schema]
    channels: dict[int, Channel]
    counts: dict[int, int]
    """Messages by channel."""
    chunks: list[ChunkInfo]
    indexes: list[ChunkIndex]


def _summary(source: BinaryIO) -> _Found | None:
    """Read the summary at the end of the file; None without one, or if it is incomplete."""
    try:
        summary = make_reader(source).get_summary()
    except (*_DAMAGE, OSError):  # an unfinished file has none
        return None
    if summary is None or summary.statistics is None:
        return None
    counts, indexes = summary.statistics.channel_message_counts, summary.chunk_indexes
    listed = {number for index in indexes for number in index.message_index_offsets}
    # An index has 15 bytes before its entries of 16 bytes for each message.
    indexed = sum((i.message_index_length - 15 * len(i.message_index_offsets)) // 16 for i in indexes)
    used = {summary.channels[number].schema_id for number in listed & summary.channels.keys()}
    whole = listed <= summary.channels.keys() and used - {0} <= summary.schemas.keys()
    if not whole or indexed != summary.statistics.message_count or sum(counts.values()) != indexed:
        return None
    chunks = [
        ChunkInfo(
            i.chunk_start_offset, i.message_start_time, i.message_end_time, dict.fromkeys(i.message_index_offsets, 1)
        )
        for i in indexes
        if i.message_index_offsets
    ]
    return _Found(summary.schemas, summary.channels, counts, chunks, indexes)


def _scan(source: BinaryIO) -> _Found:
    """Read the file from front to back, as far as its records are whole."""
    size = source.seek(0, 2)
    found = _Found({}, {}, {}, [], [])
    layout, position = McapLayout({}), len(MCAP)

    def see(data: bytes, at: int) -> None:
        stamps, numbers = list[int](), Counter[int]()
        for kind, record in _records(data):
            if kind == _SCHEMA:
                schema = Schema.read(ReadDataStream(BytesIO(record)))
                found.schemas[schema.id] = schema
            elif kind == _CHANNEL:
                channel = Channel.read(ReadDataStream(BytesIO(record)))
                found.channels[channel.id] = channel
        for stamp, number, _, _ in layout.rows(data):
            stamps.append(stamp)
            numbers[number] += 1
        if stamps:
            for number, count in numbers.items():
                found.counts[number] = found.counts.get(number, 0) + count
            found.chunks.append(ChunkInfo(at, min(stamps), max(stamps), numbers))

    while position + _RECORD.size <= size:
        source.seek(position)
        kind, length = _RECORD.unpack(source.read(_RECORD.size))
        after = position + _RECORD.size + length
        if kind == _FOOTER or after > size:
            break
        if kind in (_CHUNK, _MESSAGE):
            see(unpacked(source, position), position)
            after = source.tell() if kind == _MESSAGE else after
        elif kind in (_SCHEMA, _CHANNEL):
            source.seek(position)
            see(source.read(after - position), position)
        position = after
    return found


def _records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield kind and content of each record but messages."""
    at = 0
    while at + _RECORD.size <= len(data):
        kind, size = _RECORD.unpack_from(data, at)
        at += _RECORD.size
        if kind != _MESSAGE:
            yield kind, data[at : at + size]
        at += size


def unpacked(source: BinaryIO, position: int) -> bytes:
    """Read and decompress the chunk, or the group of messages, at a position; the file is then behind it."""
    source.seek(position)
    kind, size = _RECORD.unpack(source.read(_RECORD.size))
    if kind == _MESSAGE:
        return _group(source, position)
    record = _read(source, size)
    if kind != _CHUNK:
        raise ValueError("its index points to a position without a chunk")
    _, _, length, crc, name = struct.unpack_from("<QQQII", record)
    compression, packed = record[32 : 32 + name], record[40 + name :]
    try:
        if compression == b"zstd":
            data = zstandard.ZstdDecompressor().decompress(packed, length)
        elif compression == b"lz4":
            data = bytes(lz4.frame.decompress(packed))
        elif compression == b"":
            data = packed
        else:
            raise ValueError(f"the compression of a chunk is {compression.decode()!r}, which is not known")
    except (zstandard.ZstdError, RuntimeError, MemoryError, OverflowError) as error:
        raise ValueError("a chunk is damaged") from error
    if len(data) != length or (crc and zlib.crc32(data) != crc):
        raise ValueError("a chunk does not fit its checksum")
    return data


def _read(source: BinaryIO, size: int) -> bytes:
    """Read ``size`` bytes, all of which must be there."""
    if size > os.fstat(source.fileno()).st_size - source.tell():
        raise ValueError("it is truncated within a chunk")
    return source.read(size)


def _group(source: BinaryIO, position: int) -> bytes:
    """Read messages that follow each other outside of chunks."""
    parts, size = list[bytes](), 0
    end = source.seek(0, 2)
    while size < _GROUP:
        source.seek(position + size)
        head = source.read(_RECORD.size)
        if len(head) < _RECORD.size or head[0] != _MESSAGE:
            break
        (length,) = struct.unpack_from("<Q", head, 1)
        if position + size + len(head) + length > end:
            break
        parts += [head, source.read(length)]
        size += len(head) + length
    source.seek(position + size)
    return b"".join(parts)


def _stored_topic(number: int, found: _Found) -> StoredTopic:
    channel = found.channels[number]
    qos = channel.metadata.get("offered_qos_profiles", "")
    latching = _LATCHED.search(qos) is not None or channel.metadata.get("latching") == "1"

    def described() -> tuple[Ros2Type, bool, str]:
        schema = found.schemas.get(channel.schema_id)
        if schema is None or channel.message_encoding not in ("cdr", "ros1"):
            raise TypesysError(f"messages are encoded as {channel.message_encoding or 'unknown'}")
        name = schema.name if "/msg/" in schema.name else schema.name.replace("/", "/msg/", 1)
        kind = Ros2Type(name, schema.data.decode(), "idl" in schema.encoding)
        return kind, channel.message_encoding == "cdr", channel.metadata.get("md5sum", "")

    count = found.counts.get(number, 0)
    return StoredTopic(number, channel.topic, count, latching, channel.metadata.get("callerid"), described)
