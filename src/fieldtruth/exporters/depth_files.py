# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Depth images as files: PNG of 16 bits in millimetres, and NumPy's format in metres."""

from io import BytesIO
from typing import Final

import numpy as np
from numpy.typing import NDArray

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
