# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Size of what is packed in a file of OpenStreetMap's PBF, without unpacking it (OSM wiki, "PBF Format").

A file is a row of blocks: the length of a header, the header with the length of a blob, and the blob, which says how
long it is unpacked. Readers refuse one that unpacks to another length.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

from fieldtruth.core.errors import ConfigurationError

_MOST_HEADER: Final = 64 << 10  # [byte], by the format
_DATA_SIZE: Final = 3  # field of a BlobHeader
_RAW: Final = 1  # fields of a Blob
_RAW_SIZE: Final = 2


def unpacked_size(path: Path) -> int:
    """Sum of the lengths of all blobs, unpacked [byte].

    Raises:
        ConfigurationError: the file is damaged, or none of the format.
    """
    total = 0
    try:
        with path.open("rb") as file:
            while length := file.read(4):
                bytes_ = int.from_bytes(length, "big")
                if len(length) < 4 or bytes_ > _MOST_HEADER:
                    raise ValueError("no length of a header")
                header = dict(_fields(file.read(bytes_)))
                blob = file.read(header[_DATA_SIZE])
                if len(blob) < header[_DATA_SIZE]:
                    raise ValueError("it ends within a blob")
                fields = dict(_fields(blob))
                total += fields.get(_RAW_SIZE, fields.get(_RAW, 0))
    except (ValueError, IndexError, KeyError) as error:
        raise ConfigurationError(f"{path}: not a file of OpenStreetMap's PBF, or a part of one: {error}") from error
    return total


def _fields(message: bytes) -> Iterator[tuple[int, int]]:
    """Number of each field of a message of Protocol Buffers, and its value, or its length if it is bytes."""
    at = 0
    while at < len(message):
        key, at = _varint(message, at)
        value, at = _varint(message, at)
        if key & 7 == 2:
            at += value
        elif key & 7 != 0:
            raise ValueError(f"a field of type {key & 7}")
        yield key >> 3, value


def _varint(message: bytes, at: int) -> tuple[int, int]:
    """A number at a place of a message, and the place after it."""
    value = shift = 0
    while True:
        value |= (message[at] & 127) << shift
        if message[at] < 128:
            return value, at + 1
        at, shift = at + 1, shift + 7
