# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Encode depth as TIFF with samples of 32-bit floating point, which no PNG can hold (TIFF 6.0, sections 2 and 19)."""

import struct
from typing import Final

import numpy as np
from numpy.typing import NDArray

_SHORT, _LONG = 3, 4
_HEADER: Final = struct.Struct("<2sHL")
_ENTRY: Final = struct.Struct("<HHLL")


def encode_tiff(image: NDArray[np.float32]) -> bytes:
    """Encode an image (h, w), uncompressed: header, one directory, one strip; little-endian."""
    height, width = image.shape
    data = np.ascontiguousarray(image, "<f4").tobytes()
    entries = [
        (256, _LONG, width),
        (257, _LONG, height),
        (258, _SHORT, 32),  # bits per sample
        (259, _SHORT, 1),  # not compressed
        (262, _SHORT, 1),  # 0 is black
        (273, _LONG, 0),  # offset of the strip, see below
        (277, _SHORT, 1),  # samples per pixel
        (278, _LONG, height),  # rows of the strip
        (279, _LONG, len(data)),
        (339, _SHORT, 3),  # floating point
    ]
    start = _HEADER.size + 2 + len(entries) * _ENTRY.size + 4
    rows = [_ENTRY.pack(tag, kind, 1, start if tag == 273 else value) for tag, kind, value in entries]
    directory = struct.pack("<H", len(entries)) + b"".join(rows) + struct.pack("<L", 0)
    return _HEADER.pack(b"II", 42, _HEADER.size) + directory + data
