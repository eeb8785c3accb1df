# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Kinds of rock, and one rock of a kind as a mesh that lies in the soil, with its collider and the room it needs."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Collider, Mesh
from fieldtruth.world.noise import solid_noise
from fieldtruth.world.rocks.meshing import box_uv, corner_normals, welded
from fieldtruth.world.rocks.shape import fracture_planes, geodesic, snapped, worn_radius

TEXTURE_LENGTH: Final = 1.2
"""Length [m] that one repeat of a rock's texture covers."""


class RockType(NamedTuple):
    """How rocks of a kind break and wear."""

    name: str
    material: str
    proportions: tuple[float, float, float]
    """Length, width, height before they vary by ``variety``."""
    cuts: int
    """Random planes of fracture; fewer leave larger facets."""
    joints: float
    """Share of the block that three families of joints shape, 0 (none) to 1."""
    sharpness: float
    """Of the edges: about 5 is river-worn, 40 freshly broken."""
    roughness: float
    """Deviation of the fractal noise on the surface, in radii."""
    layers: float = 0.0
    """Depth of the joints between layers, in radii: bedding or cleavage."""
    buried: tuple[float, float] = (0.2, 0.4)
    """Share of the height that lies below the soil line, from and to."""
    variety: float = 0.16


ROCK_TYPES: Final[Mapping[str, RockType]] = MappingProxyType(
    {
        kind.name: kind
        for kind in (
            RockType("granite", "rock_granite", (1.0, 0.85, 0.8), 11, 0.75, 15, 0.020),
            RockType("limestone", "rock_limestone", (1.0, 0.8, 0.72), 13, 0.9, 30, 0.030, layers=0.05),
            RockType("crag", "rock_limestone", (1.0, 0.6, 0.62), 15, 0.55, 34, 0.045, layers=0.10, buried=(0.3, 0.4)),
            RockType("fieldstone", "rock_fieldstone", (1.0, 0.82, 0.68), 12, 0.0, 5.5, 0.016),
            RockType("slab", "rock_schist", (1.0, 0.74, 0.26), 9, 0.85, 34, 0.012, layers=0.05),
            RockType("scree", "rock_limestone", (1.0, 0.72, 0.45), 10, 0.2, 45, 0.012),
        )
    }
)
"""Kinds by name: granite and limestone (jointed blocks), crag (a layered outcrop), fieldstone (rounded), slab (flat
schist), scree (sharp splinters of limestone)."""


def make_rock(
    kind: RockType, *, name: str, size: float, rng: np.random.Generator, triangles: int = 720, solid: bool = True
) -> Mesh:
    """A rock whose largest horizontal extent is ``size`` [m], of at most ``triangles`` (80 to 3,000).

    z = 0 is the soil line; 20 to 40 % of the height lie below it, so that the rock lies in the ground. The collider, a
    box or an upright cylinder, whichever is smaller, encloses what may stick out (none if not ``solid``, for pebbles of
    a swarm). The footprint [m] is the radius about the origin that encloses the same.
    """
    if not 80 <= triangles <= 3000:
        raise ValueError(f"triangles of a rock = {triangles}: must be from 80 to 3000")
    if not size > 0:
        raise ValueError(f"size of a rock = {size} m: must be above 0")
    frequency = int(np.sqrt(triangles / 20))
    vertices, faces = _body(kind, frequency, rng)
    vertices *= size / max(np.ptp(vertices[:, 0]), np.ptp(vertices[:, 1]))
    height = float(np.ptp(vertices[:, 2]))
    depth = float(rng.uniform(*kind.buried)) * height
    vertices[:, 2] -= vertices[:, 2].min() + depth
    visible = vertices[vertices[:, 2] > -depth / 2]
    vertices[:, :2] -= (visible[:, :2].max(0) + visible[:, :2].min(0)) / 2
    visible = vertices[vertices[:, 2] > -depth / 2]
    crease = 30.0 if kind.sharpness > 10 else 60.0
    normals = corner_normals(vertices, faces, crease)
    smooth = corner_normals(vertices, faces, 89.0).mean(axis=1)
    uv, axis = box_uv(vertices, faces, smooth, rng.uniform(0, 8, (3, 2)))
    skin = welded(vertices, faces, normals, uv / TEXTURE_LENGTH, axis)
    return Mesh(
        name=name,
        vertices=skin[0].astype(np.float32),
        normals=skin[1].astype(np.float32),
        uv=skin[2].astype(np.float32),
        faces=skin[3],
        material=np.zeros(len(faces), np.int32),
        materials=(kind.material,),
        colliders=(_collider(visible, -depth / 2),) if solid else (),
        footprint=float(np.hypot(visible[:, 0], visible[:, 1]).max()),
    )


def _body(kind: RockType, frequency: int, rng: np.random.Generator) -> tuple[Array, NDArray[np.intp]]:
    """Vertices (v, 3) of about unit radius and faces: fractured, worn, layered, roughened, drawn to proportions."""
    directions, faces = geodesic(frequency)
    directions = directions @ _random_turn(rng).T
    planes = fracture_planes(rng, kind.cuts, kind.joints)
    sharpness = kind.sharpness * float(np.exp(rng.normal(0, 0.2)))
    if sharpness > 10:
        directions = snapped(directions, planes, 1.1 / frequency)
    radius = worn_radius(directions, planes, sharpness)
    body = directions * radius[:, None]
    swell = solid_noise(body, wavelength=1.6, octaves=2, rng=rng)
    grain = solid_noise(body, wavelength=0.7, octaves=max(1, int(np.log2(frequency))), rng=rng, gain=0.55)
    scale = 1 + 0.045 * swell.clip(-2, 2) + kind.roughness * grain.clip(-3, 3)
    if kind.layers:
        tilted = body @ _random_turn(rng, 0.15)[2]
        layer = 4.2 * tilted + 0.5 * swell
        # Weaker beds weather back; the hard ones keep the block's outline.
        bed = np.interp(layer % 1.0, [0, 0.12, 0.25, 0.85, 1.0], [1.0, 0.9, 0.0, 0.0, 1.0])
        scale -= kind.layers * bed * rng.uniform(0.3, 1.0, 64)[np.floor(layer).astype(int) % 64]
    body *= scale[:, None]
    body *= np.array(kind.proportions) * np.exp(rng.normal(0, kind.variety, 3))
    return body @ _random_turn(rng, 0.12).T, faces


def _random_turn(rng: np.random.Generator, spread: float | None = None) -> Array:
    """Rotation (3, 3): any, or one that leaves z within about ``spread`` [rad] and the heading as it is."""
    columns = rng.normal(0, 1, (3, 3)) if spread is None else np.eye(3) + rng.normal(0, spread, (3, 3))
    q, r = np.linalg.qr(columns)
    q = q * np.sign(np.diag(r))
    return np.asarray(q if np.linalg.det(q) > 0 else q * [1, 1, -1])


def _collider(visible: Array, foot: float) -> Collider:
    """Smallest upright box or cylinder about ``visible`` (n, 3) [m] that stands at z = ``foot``."""
    from scipy.spatial import ConvexHull

    hull = visible[ConvexHull(visible[:, :2]).vertices, :2]
    top = float(visible[:, 2].max()) - foot
    edges = np.roll(hull, -1, axis=0) - hull
    turns = np.arctan2(edges[:, 1], edges[:, 0])
    axes = np.stack([np.stack([np.cos(turns), np.sin(turns)]), np.stack([-np.sin(turns), np.cos(turns)])])
    along = np.einsum("nd,kdt->tkn", hull, axes)  # (edges, 2, corners)
    low, high = along.min(axis=-1), along.max(axis=-1)
    best = int(np.argmin(np.prod(high - low, axis=1)))
    size, middle = high[best] - low[best], (high[best] + low[best]) / 2
    centre = middle @ axes[:, :, best]
    radius = float(np.linalg.norm(hull - centre, axis=1).max())
    if np.pi * radius**2 < float(np.prod(size)):
        return Collider(shape="cylinder", size=(radius, top), position=(float(centre[0]), float(centre[1]), foot))
    return Collider(
        shape="box",
        size=(float(size[0]), float(size[1]), top),
        position=(float(centre[0]), float(centre[1]), foot),
        yaw_deg=float(np.degrees(turns[best])),
    )
