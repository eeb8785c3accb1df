# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What a file of meshes holds, whatever its format."""

from io import BytesIO
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fieldtruth.core.arrays import Array

UNREADABLE: Final = (OSError, SyntaxError, ValueError, Image.DecompressionBombError)
"""What Pillow raises on an image that is damaged, too large or of an unknown format."""


class TextureError(Exception):
    """An image of a file that cannot be read."""


class Look(NamedTuple):
    """Appearance of a surface by the file: its name, a linear colour, an image (h, w, 3) sRGB, and gloss 0 to 1."""

    name: str = ""
    rgb: tuple[float, float, float] = (0.5, 0.5, 0.5)
    image: NDArray[np.uint8] | None = None
    gloss: float = 0.0


class Part(NamedTuple):
    """Triangles of one look: name of their node, corners by ``faces``, and uv (v up) by vertex where the file has it.

    Vertices are in the file's unit and axes, with the poses of nodes applied.
    """

    name: str
    vertices: Array  # (n, 3)
    faces: NDArray[np.int64]  # (m, 3)
    uv: Array | None  # (n, 2)
    look: Look


class FileContent(NamedTuple):
    """Parts of a file, its unit [m] and axis that points up where the file says them, and what was left out."""

    parts: list[Part]
    unit: float | None
    up: str | None
    notes: list[str]


def shares(factor: Any) -> tuple[float, float, float]:
    """Return red, green and blue of numbers 0 to 1, or of bytes."""
    values = np.asarray(factor)
    red, green, blue = (values[:3] / (255.0 if values.dtype.kind in "ui" else 1.0)).clip(0.0, 1.0).tolist()
    return red, green, blue


def gloss_of(roughness: float) -> float:
    """Strength of the highlight of a surface of glTF's or USD's roughness; it is undone in ``interchange``."""
    return float(np.clip((1.0 - roughness) / 0.7, 0.0, 1.0))


def pixels(image: Any, name: str, notes: list[str]) -> NDArray[np.uint8] | None:
    """Return the colours (h, w, 3) of an image, in which what is transparent is solid, for a triangle is either."""
    if image is None:
        return None
    try:
        if not isinstance(image, Image.Image):
            image = Image.open(BytesIO(image) if isinstance(image, bytes) else image)
        rgba = np.asarray(image.convert("RGBA"))
    except UNREADABLE as error:
        raise TextureError(
            f"the texture of {name or 'a material'} cannot be read; or choose a material of ours"
        ) from error
    if rgba[..., 3].min() < 128:
        notes.append(f"transparent parts of the texture of {name or 'a material'} are solid")
    return np.ascontiguousarray(rgba[..., :3])
