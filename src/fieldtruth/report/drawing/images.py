# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Images with fewer pixels, and JPEGs below a given size."""

from typing import Final

import numpy as np
import simplejpeg
from numpy.typing import NDArray

_QUALITIES: Final = range(90, 20, -4)


def downscaled(image: NDArray[np.uint8], factor: int = 2) -> NDArray[np.uint8]:
    """Average blocks of ``factor`` x ``factor`` pixels of an image (h, w, 3); incomplete blocks are cut off."""
    h, w = (side // factor * factor for side in image.shape[:2])
    blocks = image[:h, :w].reshape(h // factor, factor, w // factor, factor, -1)
    means: NDArray[np.uint8] = np.rint(blocks.mean(axis=(1, 3), dtype=np.float32)).astype(np.uint8)
    return means


def jpeg_below(image: NDArray[np.uint8], limit: int) -> bytes:
    """Encode an image (h, w, 3) as JPEG below ``limit`` bytes, at the best quality, if necessary with fewer pixels."""
    while True:
        for quality in _QUALITIES:
            data = simplejpeg.encode_jpeg(np.ascontiguousarray(image), quality, "RGB", "420")
            if len(data) < limit:
                return bytes(data)
        image = downscaled(image)
