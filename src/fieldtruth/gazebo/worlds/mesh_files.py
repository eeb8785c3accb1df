# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Wavefront OBJ files of single surfaces, as Gazebo 11 reads them.

Gazebo's reader of OBJ is the only one of its readers that takes shared meshes of a million triangles in seconds. It
crashes on a file without a material library, so each file has one, which also shows the texture in other tools.
"""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.interchange.surfaces import Surface

FINE: Final = (5, 3, 2)
"""Decimals of positions [m], texture coordinates and normals: 10 um keep ranges at grazing incidence."""
COARSE: Final = (4, 3, 1)
"""For swarms and leaves, whose files are most of a package: normals turn by up to 4 deg."""
Decimals = tuple[int, int, int]


def obj_text(surface: Surface, library: str, decimals: Decimals = FINE) -> str:
    """Text of an OBJ file of a surface, whose material is in the file ``library`` beside it."""
    lines = [f"mtllib {library}\n"]
    rows = []
    for key, values, places in zip(
        ("v", "vt", "vn"), (surface.vertices, surface.uv, surface.normals), decimals, strict=True
    ):
        distinct, row = _distinct(values, places)
        line = f"{key}{f' %.{places}f' * values.shape[1]}\n"
        lines.append(line * len(distinct) % tuple(distinct.ravel().tolist()))
        rows.append(row + 1)
    lines.append(f"usemtl {surface.material}\n")
    corners = np.stack([row[surface.faces] for row in rows], axis=-1)
    lines.append("f %d/%d/%d %d/%d/%d %d/%d/%d\n" * len(corners) % tuple(corners.ravel().tolist()))
    return "".join(lines)


def mtl_text(material: str, texture: str) -> str:
    """Text of a material library with one material; ``texture`` is a path relative to it."""
    return f"newmtl {material}\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd {texture}\n"


def write_obj(path: Path, surface: Surface, texture: str, decimals: Decimals) -> None:
    """Write ``path`` and its material library beside it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    library = path.with_suffix(".mtl")
    path.write_text(obj_text(surface, library.name, decimals))
    library.write_text(mtl_text(surface.material, texture))


def _distinct(values: NDArray[np.float32], decimals: int) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Distinct rows of ``values`` (n, k) rounded to decimals, and the row (n,) of each."""
    scaled = np.rint(values.astype(np.float64) * 10**decimals).astype(np.int64)
    low = scaled.min(axis=0)
    spans = (scaled - low).max(axis=0) + 1
    key = np.zeros(len(values), np.int64)
    for column, span in zip((scaled - low).T, spans.tolist(), strict=True):
        key = key * span + column
    _, first, row = np.unique(key, return_index=True, return_inverse=True)
    return scaled[first] / 10**decimals + 0.0, row
