# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Small images: fewer pixels, JPEGs below a size, PNGs with every pixel, and colours of normals and of optical flow."""

from pathlib import Path
from typing import Final

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from fieldtruth.core.files import output_errors, output_path, write_atomically

_QUALITIES: Final = range(90, 20, -4)
_LARGE: Final = 0.98  # quantile of the lengths of flow that is drawn in full colour
IMAGE_ENDINGS: Final = (".png", ".jpg", ".jpeg")
LARGEST_JPEG: Final = 400_000
"""Size limit [byte] of a JPEG: many pages show several."""


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


def normal_colours(normal: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Colours (h, w, 3) of unit normals (h, w, 3): red grows with x, green with y, blue with z; the sky is black."""
    colours = np.rint((normal + 1.0) * 127.5)
    colours[~normal.any(axis=-1)] = 0.0
    return np.asarray(colours, np.uint8)


def flow_colours(flow: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Colours (h, w, 3) of flow (h, w, 2): the hue is its direction, the saturation its length; black where unknown."""
    length = np.hypot(flow[..., 0], flow[..., 1])
    known = np.isfinite(length)
    most = float(np.quantile(length[known], _LARGE)) if known.any() else 0.0
    saturation = np.clip(np.nan_to_num(length) / max(most, 1e-6), 0.0, 1.0)[..., None]
    turn = np.nan_to_num(np.arctan2(flow[..., 1], flow[..., 0]))[..., None] * (3.0 / np.pi)
    pure = np.clip(np.abs((turn + np.array([0.0, 4.0, 2.0])) % 6.0 - 3.0) - 1.0, 0.0, 1.0)
    return np.asarray(np.rint(255.0 * known[..., None] * (1.0 - saturation * (1.0 - pure))), np.uint8)


def is_jpeg(path: Path) -> bool:
    """Return True if the path has the ending of a JPEG."""
    return path.suffix.lower() in IMAGE_ENDINGS[1:]


def write_image(path: Path, image: NDArray[np.uint8], *, overwrite: bool = False) -> None:
    """Write an image (h, w, 3) as PNG or, below ``LARGEST_JPEG``, as JPEG, depending on the path's ending.

    Raises:
        OutputError: as ``output_path``, or the disk refuses.
    """
    from fieldtruth.core.png import encode_png  # late: the command line checks its arguments first

    output_path(path, endings=IMAGE_ENDINGS, parents=False, overwrite=overwrite)
    data = jpeg_below(image, LARGEST_JPEG) if is_jpeg(path) else encode_png(image)
    with output_errors(path):
        write_atomically(path, data)
