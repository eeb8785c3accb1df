# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""PNG, the one lossless image format that everything reads, written fast.

Of what ``benchmarks/png_encoders.py`` compares, ISA-L on rows that hold differences to the pixel on the left is best: a
seventh of the time of Pillow and libpng at their fastest level for photographs that are 2 % larger, and tags that are
smaller. Choosing among PNG's five filters row by row, as libpng does, would cost three times as much and save 0.4 %.
All that takes time here releases Python's lock.
"""

import struct
from typing import Any, Final

import numpy as np
from isal import isal_zlib
from numpy.typing import NDArray

from fieldtruth.core.errors import OutputError

_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
_COLOUR_TYPES: Final = {((), "u1"): 0, ((), "u2"): 0, ((3,), "u1"): 2}
"""PNG's number for grey or RGB, by an array's shape beyond (h, w) and its kind of number."""
_LEFT: Final = 1
"""PNG's filter "Sub": a byte is stored as its difference to the same byte of the pixel on the left."""
_LEVEL: Final = 1
_HEADER: Final = struct.Struct(">2L5B")


def encode_png(image: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
    """PNG of an image: (h, w, 3) RGB of 8 bits, or (h, w) grey of 8 or 16 bits.

    Raises:
        OutputError: the image has no pixel.
    """
    height, width = image.shape[:2]
    if image.size == 0:
        raise OutputError(f"an image of {width} x {height} pixels cannot be a PNG, which has at least one")
    colour_type = _COLOUR_TYPES.get((image.shape[2:], image.dtype.str[1:]))
    if colour_type is None:
        raise ValueError(f"image is {image.shape} {image.dtype}; needed is (h, w, 3) u1, (h, w) u1 or (h, w) u2")
    header = _HEADER.pack(width, height, 8 * image.itemsize, colour_type, 0, 0, 0)
    data = isal_zlib.compress(_differences(image), _LEVEL)
    return b"".join((_SIGNATURE, *_chunk(b"IHDR", header), *_chunk(b"IDAT", data), *_chunk(b"IEND", b"")))


def _differences(image: NDArray[Any]) -> NDArray[np.uint8]:
    """(h, 1 + bytes of a row): the filter's number and the filtered row; samples of 16 bits are big-endian."""
    big_endian = np.ascontiguousarray(image, image.dtype.newbyteorder(">"))
    rows = big_endian.view(np.uint8).reshape(image.shape[0], -1)
    step = rows.shape[1] // image.shape[1]
    lines = np.empty((rows.shape[0], 1 + rows.shape[1]), np.uint8)
    lines[:, 0] = _LEFT
    lines[:, 1 : 1 + step] = rows[:, :step]
    np.subtract(rows[:, step:], rows[:, :-step], out=lines[:, 1 + step :])
    return lines


def _chunk(name: bytes, data: bytes) -> tuple[bytes, ...]:
    checksum = isal_zlib.crc32(data, isal_zlib.crc32(name))
    return struct.pack(">L", len(data)), name, data, struct.pack(">L", checksum)
