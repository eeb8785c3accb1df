# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Write bags (ROS 1, v2.0) that ROS's own tools read, and join them without decompression.

A bag is written under a temporary name, synced and renamed when complete, so an aborted recording never looks like a
bag. One that grows by whole bags (``GrowingBag``) stays in its own file and goes on after a crash with the same bytes.
Beside it is a journal with a line for each bag that was added: where its copy ends, the CRC-32 of the copy, and its
chunks, behind the CRC-32 of the line itself. A line is written after the copy is on the disk. Whatever follows the last
copy that agrees with its line is cut off when the file is opened again.
"""

import json
import os
import zlib
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final, NamedTuple, Self, cast
from uuid import uuid4

import lz4.frame
from rosbags.interfaces import Connection, ConnectionExtRosbag1
from rosbags.rosbag1 import Reader, Writer
from rosbags.rosbag1.reader import Header, RecordType
from rosbags.rosbag1.writer import MAXSIZE, WriteChunk

from fieldtruth.bag.file import ChunkInfo
from fieldtruth.bag.messages import STORE
from fieldtruth.core.cache import add_seal
from fieldtruth.core.errors import OutputError
from fieldtruth.core.files import replace_synced, sync, write_atomically
from fieldtruth.experiment.sensor_config import Topic

CHUNK_SIZE: Final = 4 * 2**20  # [byte]; also LZ4's block size; larger blocks compress model states better
COPY_SIZE: Final = 8 * 2**20  # [byte]
_MAGIC: Final = b"#ROSBAG V2.0\n"
_PADDING: Final = 8  # [byte]


class BagWriter:
    """Context manager that writes messages in time order; the same messages give the same bytes.

    Args:
        path: the bag.
        topics: what may be written.
        seal: with this name, the bag is sealed, and several processes may write it at once; see ``core.cache``.

    Raises:
        OutputError: the bag already exists.
    """

    def __init__(self, path: Path, topics: Sequence[Topic], seal: str | None = None) -> None:
        if path.exists():
            raise OutputError(f"{path} already exists; remove it, or choose another path")
        self.path = path
        own = f".{uuid4().hex[:8]}" if seal else ""
        self._part = path.with_name(f"{path.name}{own}.part")
        self._part.unlink(missing_ok=True)
        self._seal = seal
        self._prepare(self._part, topics)

    def _prepare(self, file: Path, topics: Sequence[Topic]) -> None:
        self._topics = topics
        self._connections: dict[str, Connection] = {}
        self._writer = Writer(file)
        self._writer.set_compression(Writer.CompressionFormat.LZ4)
        self._writer.compressor = compressed
        self._writer.chunk_threshold = CHUNK_SIZE

    def __enter__(self) -> Self:
        self._writer.open()
        assert self._writer.bio is not None
        self._writer.bio.write(b" " * _PADDING)
        self._add_topics()
        return self

    def _add_topics(self) -> None:
        for topic in self._topics:
            self._connections[topic.name] = self._writer.add_connection(
                topic.name, topic.msgtype, typestore=STORE, latching=1 if topic.latched else None
            )

    def carry(self, connection: Connection) -> Connection:
        """Add a connection of another bag with its definition, checksum, publisher and latching."""
        for known in self._writer.connections:
            if _metadata(known) == _metadata(connection):
                return known
        publisher = connection.ext
        assert isinstance(publisher, ConnectionExtRosbag1)
        return self._writer.add_connection(
            connection.topic,
            connection.msgtype,
            msgdef=connection.msgdef.data,
            md5sum=connection.digest,
            callerid=publisher.callerid,
            latching=publisher.latching,
        )

    def write(self, topic: str | Connection, stamp_ns: int, data: bytes) -> None:
        """Add a serialised message to a topic of the table, or to a connection from ``carry``."""
        chunks = self._writer.chunks
        before = len(chunks)
        self._writer.write(self._connections[topic] if isinstance(topic, str) else topic, stamp_ns, data)
        if len(chunks) > before:  # the index needs only the number of messages in a chunk
            full = chunks[-2]
            full.connections = _counts({number: len(rows) for number, rows in full.connections.items()})

    def append(self, path: Path) -> list[ChunkInfo]:
        """Add a bag that was written for the same topics: its chunks are copied unchanged, and returned.

        Chunks and their message indices hold no absolute positions; only the index at the end does, and is rebuilt.
        """
        writer = self._writer
        assert writer.bio is not None
        if writer.chunks[-1].connections:
            writer.write_chunk(writer.chunks[-1])
        with path.open("rb") as source, Reader(path) as reader:
            first = min(info.pos for info in reader.chunk_infos)
            shift = writer.bio.tell() - first
            _copy(source, writer.bio, first, _index_position(source))
            copied = [
                ChunkInfo(info.pos + shift, info.start_time, info.end_time - 1, dict(info.connection_counts))
                for info in reader.chunk_infos
            ]
        self._enter(copied)
        return copied

    def _enter(self, chunks: Sequence[ChunkInfo]) -> None:
        """Add chunks that are in the file to its index."""
        known = self._writer.chunks
        known.pop()  # it is empty, or holds only the list of topics, which each bag has
        known += [WriteChunk(BytesIO(), c.pos, c.start_ns, c.end_ns, _counts(c.counts)) for c in chunks]
        known.append(WriteChunk(BytesIO(), -1, MAXSIZE, 0, defaultdict(list)))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self._finish(self._part)
                replace_synced(self._part, self.path)
        finally:
            with suppress(OSError):
                self._writer.abort()
            self._part.unlink(missing_ok=True)

    def _finish(self, file: Path) -> None:
        """Write the index, and the seal."""
        self._writer.close()
        with file.open("r+b") as whole:
            _pad_header(whole)
            if self._seal is not None:
                add_seal(whole, self._seal)


def _metadata(connection: Connection) -> tuple[object, ...]:
    """Return a connection without its number."""
    return connection.topic, connection.msgtype, connection.msgdef, connection.digest, connection.ext


def _counts(messages: Mapping[int, int]) -> dict[int, list[tuple[int, int]]]:
    """Return sequences with the length of the message counts by connection, as rosbags keeps them for a chunk."""
    return {number: cast(list[tuple[int, int]], range(count)) for number, count in messages.items()}


def compressed(data: bytes) -> bytes:
    """Compress with LZ4 as ROS's reader expects it: independent blocks, a checksum of the content, no stored size."""
    packed: bytes = lz4.frame.compress(
        data, block_linked=False, content_checksum=True, store_size=False, block_size=lz4.frame.BLOCKSIZE_MAX4MB
    )
    return packed


def _pad_header(bag: BinaryIO) -> None:
    """Pad the file header to ROS's length, or ROS's append and reindex overwrite the first chunk.

    ROS pads header and padding to 4096 bytes without their two lengths, rosbags with them.
    """
    bag.seek(len(_MAGIC))
    size = int.from_bytes(bag.read(4), "little")
    bag.seek(size, os.SEEK_CUR)
    bag.write((4096 - size).to_bytes(4, "little"))


def _index_position(bag: BinaryIO) -> int:
    """Return the position of a bag's index, which is the end of its chunks."""
    bag.seek(len(_MAGIC))
    return Header.read(bag, RecordType.BAGHEADER).get_uint64("index_pos")


def _copy(source: BinaryIO, target: BinaryIO, start: int, end: int) -> None:
    source.seek(start)
    while (left := end - source.tell()) > 0:
        target.write(source.read(min(left, COPY_SIZE)))


JOURNAL: Final = ".journal"
"""Ending of the journal's name, behind the name of the bag."""


class _Copy(NamedTuple):
    """A line of the journal: where the copy of a bag is, its CRC-32, and its chunks."""

    start: int
    end: int
    crc: int
    chunks: list[ChunkInfo]


class GrowingBag(BagWriter):
    """Context manager that adds bags to a file; the index is written at the end, if there is no error.

    Args:
        path: the bag; without its index it is not complete, and whatever happens, it stays.
        topics: those of the bags that are added.
    """

    def __init__(self, path: Path, topics: Sequence[Topic]) -> None:
        self.path = path
        self.added = 0
        """Number of bags that are in the file, and safe there."""
        self._journal = path.with_name(path.name + JOURNAL)
        self._fresh = path.with_name(path.name + ".new")
        self._fresh.unlink(missing_ok=True)
        self._seal = None
        self._prepare(self._fresh, topics)

    def __enter__(self) -> Self:
        copies = list(_intact_copies(self.path, self._journal))
        super().__enter__()
        if copies:
            self._resume(copies)
        else:
            self._fresh.replace(self.path)
        write_atomically(self._journal, b"".join(map(_line, copies)))
        self.added = len(copies)
        return self

    def _resume(self, copies: Sequence[_Copy]) -> None:
        self._writer.abort()
        bio = self._writer.bio = self.path.open("r+b")
        bio.write(self._fresh.read_bytes())  # a former end may have written the header
        self._fresh.unlink()
        bio.truncate(copies[-1].end)
        bio.seek(copies[-1].end)
        self._enter([chunk for copy in copies for chunk in copy.chunks])

    def add(self, path: Path) -> None:
        """Add a bag; when this returns, its copy is on the disk."""
        bio = self._writer.bio
        assert bio is not None
        start = bio.tell()
        chunks = self.append(path)
        end = bio.tell()
        bio.flush()
        sync(self.path)
        with self.path.open("rb") as file, self._journal.open("ab") as journal:
            journal.write(_line(_Copy(start, end, _crc(file, start, end), chunks)))
        sync(self._journal)
        self.added += 1

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self._finish(self.path)
                sync(self.path)
        finally:
            with suppress(OSError):
                self._writer.abort()


def _line(copy: _Copy) -> bytes:
    text = json.dumps(copy).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def _intact_copies(path: Path, journal: Path) -> Iterator[_Copy]:
    """Yield the copies in a file that agree with the journal, up to the first one that does not."""
    if not (path.exists() and journal.exists()):
        return
    with path.open("rb") as file, journal.open("rb") as lines:
        for line in lines:
            crc, _, text = line.rstrip(b"\n").partition(b" ")
            if crc != b"%08x" % zlib.crc32(text):
                return
            start, end, content, chunks = json.loads(text)
            if _crc(file, start, end) != content:
                return
            yield _Copy(start, end, content, [_chunk(*chunk) for chunk in chunks])


def _chunk(position: int, start_ns: int, end_ns: int, counts: dict[str, int]) -> ChunkInfo:
    return ChunkInfo(position, start_ns, end_ns, {int(number): count for number, count in counts.items()})


def _crc(file: BinaryIO, start: int, end: int) -> int:
    """CRC-32 of a part of a file, or of what there is of it."""
    file.seek(start)
    crc, left = 0, end - start
    while left > 0 and (block := file.read(min(left, COPY_SIZE))):
        crc = zlib.crc32(block, crc)
        left -= len(block)
    return crc
