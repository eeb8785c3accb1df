# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bag files of ROS 1 (version 2.0).

ROS's readers, and that of rosbags, first read the index of all messages. At 1000 Hz that index is larger than all
images in memory at once, and takes longer to read than a trajectory.
"""

import struct
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from rosbags.rosbag1 import Reader, ReaderError
from rosbags.rosbag1.reader import Chunk, Header, IndexData, RecordType

from fieldtruth.bag.file import ChunkInfo, Row, StoredFile

_OPERATION: Final = b"op="
_CONNECTION: Final = b"conn="
_TIME: Final = b"time="


class Ros1Layout:
    """Chunks of a bag of ROS 1."""

    def unpack(self, path: Path, position: int) -> bytes:
        """Read and decompress the chunk at a position in a file."""
        with path.open("rb") as source:
            reader = _LeanReader(path)
            reader.bio = source
            source.seek(position)
            return reader.unpack(reader.read_chunk())

    def rows(self, chunk: bytes, at: int = 0) -> Iterator[Row]:
        """Yield the messages in a decompressed chunk, from an offset on, where one begins."""
        while at < len(chunk):
            (size,) = struct.unpack_from("<L", chunk, at)
            fields, at = _fields(chunk, at + 4, size), at + 4 + size
            (size,) = struct.unpack_from("<L", chunk, at)
            at += 4
            if at + size > len(chunk):
                raise ReaderError("a message is truncated at the end of its chunk")
            if fields[_OPERATION] == bytes([RecordType.MSGDATA]):
                seconds, nanoseconds = struct.unpack("<LL", fields[_TIME])
                yield seconds * 10**9 + nanoseconds, int.from_bytes(fields[_CONNECTION], "little"), at, size
            at += size

    def ros1(self, connection: int, data: bytes) -> bytes:
        """Return a message as ROS 1 serialises it."""
        return data


class Ros1File(StoredFile):
    """An open bag of ROS 1; the list of its chunks is in memory, but not the index of messages."""

    def __init__(self, path: Path) -> None:
        self.layout = Ros1Layout()
        self._reader = _LeanReader(path)
        self._reader.open()
        self.chunks = [
            ChunkInfo(info.pos, info.start_time, info.end_time, info.connection_counts)
            for info in self._reader.chunk_infos
        ]
        counts: Counter[int] = Counter()
        for info in self.chunks:
            counts.update(info.counts)
        self.connections = [each._replace(msgcount=counts[each.id]) for each in self._reader.connections]
        self.start_ns, self.end_ns = self._reader.start_time, self._reader.end_time - 1

    def index(self, chunk: ChunkInfo) -> Iterator[tuple[int, int, int]]:
        """Yield connection, stamp [ns] and offset in its chunk of each message."""
        found, source = self._reader.chunks[chunk.pos], self._reader.bio
        assert source is not None
        source.seek(found.datapos + found.datasize)
        for _ in chunk.counts:
            number = Header.read(source, RecordType.IDXDATA).get_uint32("conn")
            data = source.read(int.from_bytes(source.read(4), "little"))
            for seconds, nanoseconds, offset in struct.iter_unpack("<LLL", data):
                yield number, seconds * 10**9 + nanoseconds, offset

    def close(self) -> None:
        """Close the file."""
        self._reader.close()


class _LeanReader(Reader):
    """Reads the list of chunks, but not the index of messages."""

    def read_index_data(self, pos: int, indexes: dict[int, list[IndexData]]) -> None:
        """Skip the index of messages."""

    def read_chunk(self) -> Chunk:
        """Read the position of a chunk's data, which must lie within the file."""
        chunk = super().read_chunk()
        if chunk.datapos + chunk.datasize > self.path.stat().st_size:
            raise ReaderError("it is truncated within a chunk")
        return chunk

    def unpack(self, chunk: Chunk) -> bytes:
        """Read and decompress a chunk."""
        assert self.bio is not None
        self.bio.seek(chunk.datapos)
        packed = self.bio.read(chunk.datasize)
        if len(packed) < chunk.datasize:
            raise ReaderError("it is truncated within a chunk")
        return chunk.decompressor(packed)


def _fields(data: bytes, at: int, size: int) -> dict[bytes, bytes]:
    """Return the fields of a record's header by ``name=``."""
    fields: dict[bytes, bytes] = {}
    end = at + size
    if end > len(data):
        raise ReaderError("a record's header is truncated")
    while at < end:
        (size,) = struct.unpack_from("<L", data, at)
        name, sign, value = data[at + 4 : at + 4 + size].partition(b"=")
        fields[name + sign] = value
        at += 4 + size
    return fields
