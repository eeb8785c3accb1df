# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bag files as they are stored: chunks of messages and their connections in any format, that of ROS 1, and errors.

Errors of the libraries below become one clear line. Of a bag of ROS 1 (version 2.0), only the list of chunks is read:
ROS's readers, and that of rosbags, first read the index of all messages, which at 1000 Hz is larger than all images in
memory at once, and takes longer to read than a trajectory.
"""

import stat
import struct
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final, NamedTuple, Protocol

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Reader, ReaderError
from rosbags.rosbag1.reader import Chunk, Header, IndexData, RecordType
from rosbags.typesys import TypesysError

from fieldtruth.core.errors import FieldtruthError

_DAMAGE: Final = (ReaderError, OSError, EOFError, RuntimeError, ValueError, KeyError, struct.error, TypesysError)
"""Errors that the libraries raise for invalid bytes."""
_BAG: Final = b"#ROSBAG V2.0"
MCAP: Final = b"\x89MCAP0\r\n"
"""First bytes of an MCAP file."""
_KINDS: Final = {
    b"PK\x03\x04": "it is a Zip file; unpack it and use the bag in it",
    b"\x89MCAP": "it is an MCAP file of another version",
    b"SQLite": "it is a database; one of ROS 2 has a name that ends in .db3",
    b"#ROSBAG": "its bag version is not 2.0",
}
"""Files that users confuse with bags, by their first bytes."""
_LONGEST: Final = 200
"""Characters of a library's message, which may quote what it read."""


class BagError(FieldtruthError):
    """A file that is not a readable bag, or a bag that lacks required topics or fields."""


@contextmanager
def read_errors(path: Path) -> Iterator[None]:
    """Turn any error while a bag is read into one clear line.

    Raises:
        BagError: the path and the reason.
    """
    try:
        yield
    except FieldtruthError:
        raise
    except _DAMAGE as error:
        raise BagError(f"cannot read {path}: {_other_kind(path) or _in_words(error)}") from error


def first_bytes(path: Path, size: int = len(_BAG)) -> bytes:
    """Return the first bytes of a file.

    Raises:
        BagError: it cannot be read, or is not a file: reading a named pipe would wait for a process that writes to it.
    """
    with read_errors(path):
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            kinds = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a named pipe", stat.S_IFSOCK: "a socket"}
            raise BagError(f"cannot read {path}: it is {kinds.get(stat.S_IFMT(mode), 'a device')}, not a file")
        with path.open("rb") as file:
            return file.read(size)


def is_ros1(path: Path) -> bool:
    """Whether a file begins as a bag of ROS 1; raises as ``first_bytes``."""
    return first_bytes(path) == _BAG


def _other_kind(path: Path) -> str:
    """Describe a file that is not a bag at all; empty for bags."""
    try:
        with path.open("rb") as file:
            start = file.read(len(_BAG))
    except OSError:
        return ""
    if start.startswith((_BAG, MCAP)):
        return ""
    kinds = [words for magic, words in _KINDS.items() if start.startswith(magic)] if start else ["it is empty"]
    return kinds[0] if kinds else f"it is neither an MCAP file nor a ROS 1 bag, which begins with {_BAG.decode()}"


def _in_words(error: BaseException) -> str:
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    if isinstance(error, KeyError):
        return f"a record lacks its field {error}"
    text = str(error)
    if "not indexed" in text:
        return "it has no index, as after an aborted recording; `rosbag reindex` may repair it"
    if text.startswith("Bag index looks damaged"):
        return "its index is damaged, as in a truncated file"
    return " ".join(text.split())[:_LONGEST] or type(error).__name__


class ChunkInfo(NamedTuple):
    """A chunk: its position in the file, first and last stamp [ns], and its connections."""

    pos: int
    start_ns: int
    end_ns: int
    counts: Mapping[int, int]
    """Messages by connection, 1 where the file does not state their number."""


Row = tuple[int, int, int, int]
"""Stamp [ns] of a message, its connection, start and size of its bytes in the chunk."""


class Layout(Protocol):
    """How chunks are stored; it holds no open file and can be pickled."""

    def unpack(self, path: Path, position: int) -> bytes:
        """Read and decompress the chunk at a position in a file."""
        ...

    def rows(self, chunk: bytes, at: int = 0) -> Iterator[Row]:
        """Yield the messages in a decompressed chunk, from an offset on, where one begins."""
        ...

    def ros1(self, connection: int, data: bytes) -> bytes:
        """Return a message as ROS 1 serialises it."""
        ...


class StoredFile(ABC):
    """An open bag file."""

    layout: Layout
    connections: Sequence[Connection]
    """With types as ROS 1 defines them and the number of their messages."""
    chunks: Sequence[ChunkInfo]
    start_ns: int
    end_ns: int
    """First and last stamp [ns]."""

    @abstractmethod
    def index(self, chunk: ChunkInfo) -> Iterator[tuple[int, int, int]]:
        """Yield connection, stamp [ns] and offset in its chunk of each message."""

    @abstractmethod
    def close(self) -> None:
        """Close the file."""


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
