# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Depth, normals and optical flow as files that other tools read: PNG of 16 bits, .npy, .flo and TIFF."""

import struct
from io import BytesIO
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fieldtruth.core.png import encode_png

_MAX_DEPTH: Final = 65535.0  # [mm]


def millimetres_png(metres: NDArray[np.float32]) -> bytes:
    """Encode depth (h, w) [m] as PNG of 16 bits [mm]; 0 is no depth, or more than 65.535 m."""
    millimetres = np.multiply(metres, 1000.0, dtype=np.float64)
    np.rint(millimetres, out=millimetres)
    np.copyto(millimetres, 0.0, where=~((millimetres > 0.0) & (millimetres <= _MAX_DEPTH)))
    return encode_png(millimetres.astype(np.uint16))


def metres_npy(metres: NDArray[np.float32]) -> bytes:
    """Encode depth (h, w) [m] with every bit."""
    raw = BytesIO()
    np.save(raw, metres.astype("<f4", copy=False), allow_pickle=False)
    return raw.getvalue()


_ZERO: Final = 1 << 15
"""Sample that stands for 0, of normals and of flow."""
_ONE: Final = (1 << 15) - 1
"""Steps of a component of a normal from 0 to 1."""
_PER_PIXEL: Final = 64.0
"""Steps of flow in a pixel (KITTI's devkit of flow and stereo, 2015)."""
_UNKNOWN: Final = np.float32(1e10)
"""Flow that is not known: above 1e9 (Baker et al., "A Database and Evaluation Methodology for Optical Flow", 2011)."""


def normals_png(normal: NDArray[np.float32]) -> bytes:
    """Encode normals (h, w, 3) as RGB of 16 bits: component = (sample - 32768) / 32767."""
    return encode_png((np.rint(normal.astype(np.float64) * _ONE) + _ZERO).astype(np.uint16))


def flow_png(flow: NDArray[np.float32]) -> bytes:
    """Encode flow (h, w, 2) [pixel] as KITTI does, RGB of 16 bits: u = (R - 32768) / 64, v likewise of G, B = known.

    Flow of 512 pixels or more does not fit, and is marked as not known.
    """
    steps = np.rint(flow.astype(np.float64) * _PER_PIXEL) + _ZERO
    with np.errstate(invalid="ignore"):
        known = ((steps >= 0.0) & (steps < 1 << 16)).all(axis=-1)
    samples = np.zeros((*known.shape, 3), np.uint16)
    samples[known, :2], samples[known, 2] = steps[known].astype(np.uint16), 1
    return encode_png(samples)


def flow_flo(flow: NDArray[np.float32]) -> bytes:
    """Encode flow (h, w, 2) [pixel] with every bit as Middlebury does; 1e10 where it is not known."""
    height, width = flow.shape[:2]
    known = np.where(np.isnan(flow), _UNKNOWN, flow).astype("<f4")
    return struct.pack("<4sii", b"PIEH", width, height) + known.tobytes()


def encode_tiff(image: NDArray[np.float32]) -> bytes:
    """Encode an image (h, w) with every bit as uncompressed TIFF."""
    raw = BytesIO()
    Image.fromarray(np.ascontiguousarray(image, np.float32)).save(raw, "TIFF")
    return raw.getvalue()
