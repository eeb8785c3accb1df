# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Image files: a PNG keeps every pixel; a JPEG is for documents and stays below a size."""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.files import output_errors, write_atomically
from fieldtruth.core.outputs import output_path

IMAGE_ENDINGS: Final = (".png", ".jpg", ".jpeg")
LARGEST_JPEG: Final = 400_000
"""Size limit [byte] of a JPEG: many pages show several."""


def is_jpeg(path: Path) -> bool:
    """Whether the path has the ending of a JPEG."""
    return path.suffix.lower() in IMAGE_ENDINGS[1:]


def write_image(path: Path, image: NDArray[np.uint8], *, overwrite: bool = False) -> None:
    """Write an image (h, w, 3) as PNG or, below ``LARGEST_JPEG``, as JPEG, depending on the path's ending.

    Raises:
        OutputError: as ``output_path``, or the disk refuses.
    """
    from fieldtruth.core.png import encode_png
    from fieldtruth.report.drawing.images import jpeg_below

    output_path(path, endings=IMAGE_ENDINGS, parents=False, overwrite=overwrite)
    data = jpeg_below(image, LARGEST_JPEG) if is_jpeg(path) else encode_png(image)
    with output_errors(path):
        write_atomically(path, data)
