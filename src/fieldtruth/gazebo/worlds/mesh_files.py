# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Mesh files of single surfaces, Wavefront OBJ for Gazebo 11 and glTF for the newer Gazebo, and their textures.

Gazebo 11 reads OBJ fast (two million triangles in 5 s), but crashes on a file without a material library, so each file
has one, which also shows the texture in other tools.
"""

from collections.abc import Set
from itertools import product
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.interchange.gltf import INDICES, VERTICES, Glb
from fieldtruth.interchange.ground import ground_images, ground_tiles
from fieldtruth.interchange.surfaces import Surface, encode_image, material_image
from fieldtruth.world.model import World

FINE: Final = (5, 3, 2)
"""Decimals of positions [m], texture coordinates and normals: 10 um keep ranges at grazing incidence.

A ray that meets the ground at 0.24 deg is 240 times as far off as the ground is high: 23 um make 5.5 mm."""
SOLID: Final = (4, 3, 2)
"""For what else wheels touch, such as trunks and rocks."""
COARSE: Final = (4, 3, 1)
"""For swarms and leaves, whose files are most of a package: normals turn by up to 4 deg."""
Decimals = tuple[int, int, int]


def obj_text(surface: Surface, library: str, decimals: Decimals = FINE) -> str:
    """Text of an OBJ file of a surface, whose material is in the file ``library`` beside it."""
    lines = [f"mtllib {library}\n"]
    rows, points = [], np.empty(0)
    for key, values, digits in zip(
        ("v", "vt", "vn"), (surface.vertices, surface.uv, surface.normals), decimals, strict=True
    ):
        distinct, row = _distinct(values, digits, often_first=key != "v")
        line = f"{key}{' %.9g' * values.shape[1]}\n"
        lines.append(line * len(distinct) % tuple(distinct.ravel().tolist()))
        rows.append(row)
        points = distinct if key == "v" else points
    lines.append(f"usemtl {surface.material}\n")
    faces = surface.faces[np.argsort(surface.faces.min(axis=1), kind="stable")]  # neighbours follow one another
    corners = np.stack([row[faces] for row in rows], axis=-1)
    for polygons in _quads(corners, points):
        line = f"f{' %d/%d/%d' * polygons.shape[1]}\n"
        lines.append(line * len(polygons) % tuple((polygons + 1).ravel().tolist()))
    return "".join(lines)


def _quads(corners: NDArray[np.intp], points: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Quads (q, 4, 3) of faces (n, 3, 3) that follow one another and share an edge, and the faces that are left.

    The edge from the first corner to the third is the shorter diagonal, so that every tool divides a quad there again.
    """
    pairs = np.zeros((max(len(corners) - 1, 0), 4, corners.shape[2]), np.intp)
    fits = np.zeros(len(pairs), np.bool_)
    for i, j in product(range(3), range(3)):
        one, other = np.roll(corners[:-1], i, axis=1), np.roll(corners[1:], j, axis=1)
        same = (one[:, [0, 2]] == other[:, :2]).all(axis=(1, 2))
        pairs[same] = np.concatenate([one[same], other[same, 2:]], axis=1)
        fits |= same
    a, b, c, d = np.moveaxis(points[pairs[..., 0]], 1, 0)
    fits &= np.linalg.norm(a - c, axis=1) < 0.999 * np.linalg.norm(b - d, axis=1)
    at = np.arange(len(pairs))
    start = np.maximum.accumulate(np.where(fits, 0, at + 1))  # of the row of pairs that fit
    chosen = np.flatnonzero(fits & ((at - start) % 2 == 0))
    return pairs[chosen], np.delete(corners, [chosen, chosen + 1], axis=0)


def mtl_text(material: str, texture: str) -> str:
    """Text of a material library with one material; ``texture`` is a path relative to it."""
    return f"newmtl {material}\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd {texture}\n"


def write_obj(path: Path, surface: Surface, texture: str, decimals: Decimals) -> None:
    """Write ``path`` and its material library beside it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    library = path.with_suffix(".mtl")
    path.write_text(obj_text(surface, library.name, decimals))
    library.write_text(mtl_text(surface.material, texture))


def _distinct(
    values: NDArray[np.float32], decimals: int, *, often_first: bool
) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Distinct rows of ``values`` (n, k) rounded to decimals, and the row (n,) of each.

    With ``often_first`` those that are used most come first, so that faces refer to them by short numbers.
    """
    scaled = np.rint(values.astype(np.float64) * 10**decimals).astype(np.int64)
    low = scaled.min(axis=0)
    spans = (scaled - low).max(axis=0) + 1
    key = np.zeros(len(values), np.int64)
    for column, span in zip((scaled - low).T, spans.tolist(), strict=True):
        key = key * span + column
    _, first, row, count = np.unique(key, return_index=True, return_inverse=True, return_counts=True)
    order = np.argsort(-count * often_first, kind="stable")
    return scaled[first[order]] / 10**decimals + 0.0, np.argsort(order)[row]


def write_glb(path: Path, surface: Surface) -> None:
    """Write a surface as a GLB file with z up: Gazebo does not turn the y axis of glTF upwards.

    It has no texture: the material of the model has it, so that meshes share it.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    wide = np.uint32 if len(surface.vertices) > np.iinfo(np.uint16).max else np.uint16
    with Glb(path.parent, {"asset": {"version": "2.0", "generator": "fieldtruth"}, "scene": 0}) as glb:
        attributes = {
            "POSITION": glb.array(surface.vertices, target=VERTICES, bounds=True),
            "NORMAL": glb.array(surface.normals, target=VERTICES),
            "TEXCOORD_0": glb.array((surface.uv * (1, -1) + (0, 1)).astype(np.float32), target=VERTICES),
        }
        primitive = {
            "attributes": attributes,
            "indices": glb.array(surface.faces.ravel().astype(wide), target=INDICES),
            "material": glb.add("materials", {"name": surface.material, "doubleSided": True}),
        }
        mesh = glb.add("meshes", {"name": path.stem, "primitives": [primitive]})
        glb.add("scenes", {"nodes": [glb.add("nodes", {"name": path.stem, "mesh": mesh})]})
        glb.save(path)


def texture_file(world: World, material: str) -> str:
    """Name of the image of a material, or of a tile of the ground.

    It starts with the world's name, because Gazebo 11 finds textures by name in all folders of models.
    """
    return f"{world.name}_{material}.jpg"


def write_textures(folder: Path, world: World, materials: Set[str]) -> None:
    """Write the images of these materials; those that are not the world's are tiles of its ground."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in sorted(materials & world.materials.keys()):
        (folder / texture_file(world, name)).write_bytes(encode_image(material_image(world, name)))
    tiles = [tile for tile in ground_tiles(world) if tile.name in materials]
    for tile, jpeg in zip(tiles, ground_images(world, tiles), strict=True):
        (folder / texture_file(world, tile.name)).write_bytes(jpeg)
