# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Image files: a PNG keeps every pixel; a JPEG is for documents and stays below a size. Checks of output paths."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.errors import OutputError
from fieldtruth.core.files import output_errors, write_atomically

IMAGE_ENDINGS: Final = (".png", ".jpg", ".jpeg")
LARGEST_JPEG: Final = 400_000
"""Size limit [byte] of a JPEG: many pages show several."""


def check_output_path(path: Path, endings: Sequence[str], *, overwrite: bool = False) -> None:
    """Check whether a file may be written, before the work that makes its content.

    Raises:
        OutputError: the name has another ending, the file exists and ``overwrite`` is off, it is a folder, or its
            folder does not exist.
    """
    if path.suffix.lower() not in endings:
        allowed = f"{', '.join(endings[:-1])} or {endings[-1]}"
        raise OutputError(f"cannot write {path}: its name must end in {allowed}")
    if path.is_dir():
        raise OutputError(f"cannot write {path}: it is a folder")
    if os.path.lexists(path) and not overwrite:
        raise OutputError(f"{path} already exists; choose another --out, or use --overwrite to replace it")
    if not path.parent.is_dir():
        raise OutputError(f"cannot write {path}: the folder {path.parent} does not exist")


def is_jpeg(path: Path) -> bool:
    """Whether the path has the ending of a JPEG."""
    return path.suffix.lower() in IMAGE_ENDINGS[1:]


def write_image(path: Path, image: NDArray[np.uint8], *, overwrite: bool = False) -> None:
    """Write an image (h, w, 3) as PNG or, below ``LARGEST_JPEG``, as JPEG, depending on the path's ending.

    Raises:
        OutputError: as ``check_output_path``, or the disk refuses.
    """
    from fieldtruth.core.png import encode_png
    from fieldtruth.report.drawing.images import jpeg_below

    check_output_path(path, IMAGE_ENDINGS, overwrite=overwrite)
    data = jpeg_below(image, LARGEST_JPEG) if is_jpeg(path) else encode_png(image)
    with output_errors(path):
        write_atomically(path, data)
