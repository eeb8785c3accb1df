# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Smooth bodies of actors: lofts through ellipses and rounded rectangles, ellipsoids, and their materials."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.world.model import Material, Mesh, make_mesh, merge_meshes

TEXTURE, CLOTH, CHECKS = "actor", "actor cloth", "actor checks"
"""Plain white, folds of cloth, and the same with checks; colours are tints."""
_CLOTH: Final = 0.5
"""[m] of cloth along a limb that its texture covers."""
Colour = tuple[float, float, float]
"""Linear shares of red, green and blue."""
_CAP: Final = (0.45, 0.82)
"""Rings of a round end, as shares of a right angle."""


class Surface(NamedTuple):
    """What a part is made of: colour, reflectance of a LiDAR's light, gloss, and class."""

    colour: Colour
    reflectance: float
    gloss: float = 0.0
    label: int | None = None
    """None: that of the figure."""
    texture: str = TEXTURE


def materials_of(name: str, label: int, surfaces: Mapping[str, Surface]) -> dict[str, Material]:
    """Return the materials of an actor, by name: its own followed by that of the surface."""
    found = {}
    for key, (colour, reflectance, gloss, own, texture) in surfaces.items():
        full = f"{name} {key}"
        kind = label if own is None else own
        found[full] = Material(
            name=full, label=kind, texture=texture, tint=colour, gloss=gloss, reflectance=reflectance
        )
    return found


def make_textures() -> dict[str, NDArray[np.uint8]]:
    """Return the images (n, n, 3) of materials of actors by name; those of cloth repeat along limbs only."""
    u, v = np.meshgrid(np.linspace(0.0, 1.0, 128), np.arange(128) / 128)
    noise = np.random.default_rng(5).normal(size=(3, *u.shape))
    folds = gaussian_filter(noise[0], (5.0, 9.0), mode=("wrap", "nearest"))
    folds = folds / folds.std() + 0.5 * (broad := gaussian_filter(noise[1], 14.0, mode="wrap")) / broad.std()
    slope = np.roll(folds, -2, axis=0) - np.roll(folds, 2, axis=0)  # folds are lit from above
    cloth = np.clip(0.93 + 0.07 * slope / slope.std() + 0.025 * folds, 0.7, 1.0) - 0.015 * np.abs(noise[2])
    bands = [1.0 - 0.38 * (np.mod(6 * each, 1.0) < 0.4) for each in (u, v)]
    values = {TEXTURE: np.ones((1, 1)), CLOTH: cloth, CHECKS: cloth * bands[0] * bands[1]}
    return {
        name: np.repeat(np.rint(255 * np.minimum(each, 1.0)).astype(np.uint8)[..., None], 3, axis=2)
        for name, each in values.items()
    }


def make_loft(
    material: str, stations: ArrayLike, *, axis: int = 2, sides: int = 9, square: float = 2.0, bulge: float = 1.0
) -> Mesh:
    """Closed smooth body through sections at right angles to an axis, 0 to 2.

    ``stations`` (n, 5) [m] are rows of the place along the axis, the section's centre and half its widths, both along
    the two other axes in their order; up to three of them are made denser. ``square``: exponent of the section, 2 for
    an ellipse, 5 for a rectangle with round corners. ``bulge``: length of the round ends over their width, 0 for flat
    ones.
    """
    given = np.asarray(stations, np.float64)
    given = given[np.argsort(given[:, 0])]
    places = given[:, 0] if len(given) > 3 else _between(given[:, 0])
    rows = np.column_stack([places, PchipInterpolator(given[:, 0], given[:, 1:])(places)])
    ends = [_end(rows[0], -bulge)[::-1], rows, _end(rows[-1], bulge)]
    rings = np.concatenate(ends)
    turn = 2 * np.pi * np.arange(sides) / sides
    outline = np.stack([np.cos(turn), np.sin(turn)])
    outline = np.sign(outline) * np.abs(outline) ** (2 / square)
    others = [k for k in range(3) if k != axis]
    points = np.zeros((len(rings), sides, 3))
    points[..., axis] = rings[:, :1]
    for k, other in enumerate(others):
        points[..., other] = rings[:, 1 + k, None] + rings[:, 3 + k, None] * outline[k]
    tips = np.zeros((2, 3))
    for k, row in enumerate((rows[0], rows[-1])):
        tips[k, axis] = row[0] + (2 * k - 1) * bulge * min(row[3:])
        tips[k, others] = row[1:3]
    return _skinned(material, points, tips)


def _between(places: Array) -> Array:
    """Places and the middles between them."""
    return np.sort(np.concatenate([places, (places[1:] + places[:-1]) / 2]))


def _end(row: Array, bulge: float) -> Array:
    angle = np.pi / 2 * np.array(_CAP if bulge else ())
    ring = np.tile(row, (len(angle), 1))
    ring[:, 0] += bulge * min(row[3:]) * np.sin(angle)
    ring[:, 3:] *= np.cos(angle)[:, None]
    return ring


def _skinned(material: str, rings: Array, tips: Array) -> Mesh:
    """Closed surface through rings (r, s, 3) [m] from one tip (3,) to the other."""
    count, sides = rings.shape[:2]
    vertices = np.concatenate([rings.reshape(-1, 3), tips])
    here = np.arange(sides)
    after = (here + 1) % sides
    faces = [np.stack([here, after, np.full(sides, count * sides)], 1)[:, ::-1]]
    for k in range(count - 1):
        a, b, c, d = k * sides + here, k * sides + after, (k + 1) * sides + after, (k + 1) * sides + here
        faces += [np.stack([a, b, c], 1), np.stack([a, c, d], 1)]
    last = (count - 1) * sides
    faces.append(np.stack([last + here, last + after, np.full(sides, count * sides + 1)], 1))
    triangles = np.concatenate(faces)
    corners = vertices[triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if np.einsum("ij,ij->", corners[:, 0], across) < 0:  # six times the volume
        triangles, across = triangles[:, ::-1], -across
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, triangles[:, k], across)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    # Around a limb u goes to 1 and back, so that there is no seam.
    along = np.cumsum([0.0, *np.linalg.norm(np.diff(rings.mean(axis=1), axis=0), axis=1)]) / _CLOTH
    around = 1.0 - np.abs(2.0 * here / sides - 1.0)
    uv = np.concatenate(
        [
            np.stack([np.tile(around, count), np.repeat(along, sides)], axis=1),
            [(0.5, along[0]), (0.5, along[-1])],
        ]
    )
    return make_mesh("part", vertices, normals, uv, triangles, (material,), footprint=0.0)


def make_ball(material: str, centre: ArrayLike, radii: ArrayLike, *, sides: int = 10, rings: int = 6) -> Mesh:
    """Ellipsoid with half axes along x, y and z [m]."""
    polar = np.pi * np.arange(1, rings) / rings
    turn = 2 * np.pi * np.arange(sides) / sides
    around = np.stack([np.cos(turn), np.sin(turn)], 1)
    rows = np.zeros((rings - 1, sides, 3))
    rows[..., :2], rows[..., 2] = np.sin(polar)[:, None, None] * around, -np.cos(polar)[:, None]
    middle, size = np.asarray(centre, np.float64), np.asarray(radii, np.float64)
    return _skinned(material, middle + size * rows, middle + size * np.array([[0, 0, -1.0], [0, 0, 1.0]]))


def part(name: str, *meshes: Mesh) -> Mesh:
    """Return the meshes of a rigid part as one."""
    return merge_meshes(name, meshes, footprint=0.0)


def dappled(mesh: Mesh, material: str, where: Callable[[Array], Mask]) -> Mesh:
    """Return a mesh of one material whose faces have another where their middles (f, 3) [m] are in patches."""
    middles = mesh.vertices[mesh.faces].mean(axis=1).astype(np.float64)
    return replace(mesh, materials=(*mesh.materials, material), material=where(middles).astype(np.int32))
