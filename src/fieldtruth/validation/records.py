# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The records that a ROS 1 bag (v2.0) is made of, read by the letter of the format: http://wiki.ros.org/Bags/Format/2.0.

Nothing here is shared with the readers that the rest of the package uses, so that their mistakes show.
"""

import bz2
import struct
from collections.abc import Mapping
from typing import BinaryIO, Final, NamedTuple

import lz4.frame

MAGIC: Final = b"#ROSBAG V2.0\n"
MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7

LARGEST_RECORD: Final = 1 << 31
"""[byte] Lengths from here on are damage, and are not tried."""


class StructureError(Exception):
    """From here on the file cannot be understood."""


class Record(NamedTuple):
    """A record: where it starts in its file or chunk, its header's fields, and where its data lies."""

    at: int
    fields: Mapping[str, bytes]
    data: bytes

    @property
    def kind(self) -> int:
        """Its ``op``."""
        return self.whole("op")

    def whole(self, name: str) -> int:
        """Field that is a number without a sign."""
        return int.from_bytes(self.field(name), "little")

    def time(self, name: str) -> int:
        """Field that is a time [ns]."""
        if len(value := self.field(name)) != 8:
            raise StructureError(f"the record at byte {self.at} has no time in its field {name!r}")
        seconds, nanoseconds = struct.unpack("<LL", value)
        return int(seconds) * 10**9 + int(nanoseconds)

    def word(self, name: str) -> str:
        """Field that is text."""
        return self.field(name).decode("utf-8", "replace")

    def field(self, name: str) -> bytes:
        """Return the bytes of a field."""
        if name not in self.fields:
            raise StructureError(f"the record at byte {self.at} lacks its field {name!r}")
        return self.fields[name]


def read_record(source: BinaryIO) -> Record:
    """Read the record at the file's position."""
    at = source.tell()
    header = _part(source, at, "header")
    return Record(at, fields_of(header, at), _part(source, at, "data"))


def record_at(data: bytes, at: int) -> tuple[Record, int]:
    """Record at an offset in an unpacked chunk, without its data; and where its data ends, which starts 4 + size on."""
    try:
        (size,) = struct.unpack_from("<L", data, at)
        (length,) = struct.unpack_from("<L", data, at + 4 + size)
    except struct.error as error:
        raise StructureError(f"a record at offset {at} of its chunk is cut off") from error
    start = at + 8 + size
    if start + length > len(data):
        raise StructureError(f"a record at offset {at} of its chunk reaches beyond the chunk's end")
    return Record(at, fields_of(data[at + 4 : at + 4 + size], at), b""), start + length


def fields_of(header: bytes, place: int) -> dict[str, bytes]:
    """Fields of a header, or of a connection's data, by name."""
    fields: dict[str, bytes] = {}
    at = 0
    while at < len(header):
        size = int.from_bytes(header[at : at + 4], "little")
        name, sign, value = header[at + 4 : at + 4 + size].partition(b"=")
        if at + 4 + size > len(header) or not sign:
            raise StructureError(f"the header of the record at byte {place} has a broken field")
        fields[name.decode("latin-1")] = value
        at += 4 + size
    return fields


def unpack(chunk: Record) -> bytes:
    """Return what a chunk holds; LZ4's own checksum, where there is one, is tested."""
    compression = chunk.word("compression")
    try:
        if compression == "none":
            data = chunk.data
        elif compression == "bz2":
            data = bz2.decompress(chunk.data)
        elif compression == "lz4":
            data, used = lz4.frame.decompress(chunk.data, return_bytes_read=True)
            if used != len(chunk.data):
                raise StructureError(f"the chunk at byte {chunk.at} goes on behind what is packed in it")
        else:
            raise StructureError(f"the chunk at byte {chunk.at} is packed as {compression!r}; known: none, bz2, lz4")
    except (RuntimeError, OSError, ValueError, EOFError) as error:
        raise StructureError(f"the chunk at byte {chunk.at} cannot be unpacked: {error}") from error
    if len(data) != chunk.whole("size"):
        raise StructureError(f"the chunk at byte {chunk.at} holds {len(data)} bytes and says {chunk.whole('size')}")
    return data


def _part(source: BinaryIO, at: int, what: str) -> bytes:
    size = int.from_bytes(source.read(4), "little")
    if size >= LARGEST_RECORD or len(part := source.read(size)) < size:
        raise StructureError(f"the {what} of the record at byte {at} reaches beyond the end of the file")
    return part
