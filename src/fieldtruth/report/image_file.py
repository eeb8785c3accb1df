# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Images as files: PNG keeps every pixel; JPEG is for documents and stays below a size."""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.errors import OutputError
from fieldtruth.core.png import encode_png

KINDS: Final = (".png", ".jpg", ".jpeg")
LARGEST_JPEG: Final = 400_000  # [byte]; many pages show several
_QUALITIES: Final = range(90, 20, -4)


def check_image_path(path: Path, *, overwrite: bool = False) -> None:
    """Tell whether an image may be written to a path, before it is made.

    Raises:
        OutputError: the ending is none of ``KINDS``, the file is there and ``overwrite`` is off, or no folder holds it.
    """
    if path.suffix.lower() not in KINDS:
        raise OutputError(f"cannot write {path}: its name must end in {', '.join(KINDS[:-1])} or {KINDS[-1]}")
    if path.is_dir():
        raise OutputError(f"{path} is a folder; needed is the name of an image file")
    if path.exists() and not overwrite:
        raise OutputError(f"{path} is there already; choose another --out, or --overwrite replaces it")
    if not path.parent.is_dir():
        raise OutputError(f"cannot write {path}: there is no folder {path.parent}")


def is_jpeg(path: Path) -> bool:
    """Whether the path's ending asks for a JPEG."""
    return path.suffix.lower() in KINDS[1:]


def write_image(path: Path, image: NDArray[np.uint8], *, overwrite: bool = False) -> None:
    """Write an image (h, w, 3) as what the path's ending says; a JPEG as good as ``LARGEST_JPEG`` allows.

    Raises:
        OutputError: as ``check_image_path``, or the disk refuses.
    """
    check_image_path(path, overwrite=overwrite)
    data = _jpeg(image) if is_jpeg(path) else encode_png(image)
    partial = path.with_name(f".{path.name}.part")
    try:
        partial.write_bytes(data)
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise OutputError(f"cannot write {path}: {error.strerror}") from error


def _jpeg(image: NDArray[np.uint8]) -> bytes:
    import simplejpeg

    image, data = np.ascontiguousarray(image), b""
    for quality in _QUALITIES:
        data = simplejpeg.encode_jpeg(image, quality=quality, colorspace="RGB", colorsubsampling="420")
        if len(data) < LARGEST_JPEG:
            break
    return bytes(data)
