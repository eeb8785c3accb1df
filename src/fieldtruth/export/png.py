# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""PNG, the one lossless image format that everything reads."""

from io import BytesIO

import numpy as np
from numpy.typing import NDArray


def encode_png(image: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
    """PNG of an image: (h, w, 3) RGB of 8 bits, or (h, w) grey of 8 or 16 bits."""
    from PIL import Image

    stream = BytesIO()
    Image.fromarray(image).save(stream, "png", compress_level=1)
    return stream.getvalue()
