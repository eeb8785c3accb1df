# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Interface of a bag file, whatever its format: chunks of messages, and the connections that these belong to."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

from rosbags.interfaces import Connection


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
