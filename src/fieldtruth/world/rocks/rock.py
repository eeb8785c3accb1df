# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rock types, and a rock of one type as a mesh partly below the soil, with its collider and footprint."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np
from pydantic import Field
from scipy.spatial import ConvexHull

from fieldtruth.core.arrays import Array, Index
from fieldtruth.world import materials  # noqa: F401  (reads the materials and textures of added files)
from fieldtruth.world.library import Entry, Library, validated
from fieldtruth.world.model import Collider, Mesh
from fieldtruth.world.noise import solid_noise
from fieldtruth.world.rocks.meshing import box_uv, corner_normals, welded
from fieldtruth.world.rocks.shape import broken, fracture_planes, geodesic, snapped, worn_radius

TEXTURE_LENGTH: Final = 1.2
"""Length [m] of one repeat of a rock's texture."""


@dataclass(frozen=True, kw_only=True)
class RockType:
    """How rocks of one type break and weather."""

    name: str
    material: str
    proportions: tuple[float, float, float]  # mean length, width and height
    cuts: int  # random fracture planes; fewer leave larger facets
    joints: float  # share of the block that three families of joints shape, 0 to 1
    sharpness: float  # of the edges: about 5 is worn by a river, 40 freshly broken
    roughness: float  # standard deviation of the fractal noise on the surface, in radii
    ledges: Annotated[int, Field(ge=0)] = 0  # faces that end inside the body, where pieces broke off
    tilt: Annotated[float, Field(ge=0)] = 0.12  # standard deviation [rad] of the turn out of its bed
    layers: float = 0.0  # depth of the joints between layers (bedding or cleavage), in radii
    buried: tuple[float, float] = (0.2, 0.4)  # least and greatest share of the height below the soil
    variety: float = 0.16  # standard deviation of the proportions' logarithms


def _rock_type(name: str, content: Entry, path: Path) -> RockType:
    return validated(RockType, {"name": name, **content}, str(path))


ROCK_TYPES: Final = Library("rocks", _rock_type, lambda rock_type: [rock_type.material])
"""Rock types by name, one data file each."""


def make_rock(
    rock_type: RockType, *, name: str, size: float, rng: np.random.Generator, triangles: int = 720, solid: bool = True
) -> Mesh:
    """A rock whose largest horizontal extent is ``size`` [m], of at most ``triangles`` (80 to 3,000).

    z = 0 is the soil line; the share ``buried`` of the height is below it. The collider, a box or an upright cylinder,
    whichever is smaller, encloses all that may be above the soil (no collider if not ``solid``, for pebbles of a
    swarm). The footprint [m] is the radius about the origin that encloses the same.
    """
    if not 80 <= triangles <= 3000:
        raise ValueError(f"triangles must be between 80 and 3000, got {triangles}")
    if not size > 0:
        raise ValueError(f"size must be above 0 m, got {size}")
    frequency = int(np.sqrt(triangles / 20))
    vertices, faces = _body(rock_type, frequency, rng)
    vertices *= size / max(np.ptp(vertices[:, 0]), np.ptp(vertices[:, 1]))
    height = float(np.ptp(vertices[:, 2]))
    depth = float(rng.uniform(*rock_type.buried)) * height
    vertices[:, 2] -= vertices[:, 2].min() + depth
    visible = vertices[vertices[:, 2] > -depth / 2]
    vertices[:, :2] -= (visible[:, :2].max(0) + visible[:, :2].min(0)) / 2
    visible = vertices[vertices[:, 2] > -depth / 2]
    crease = 30.0 if rock_type.sharpness > 10 else 60.0
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
        materials=(rock_type.material,),
        colliders=(_collider(visible, -depth / 2),) if solid else (),
        footprint=float(np.hypot(visible[:, 0], visible[:, 1]).max()),
        species=(rock_type.name,),
    )


def _body(rock_type: RockType, frequency: int, rng: np.random.Generator) -> tuple[Array, Index]:
    """Vertices (v, 3) of about unit radius and faces: fractured, worn, layered, roughened, scaled to proportions."""
    directions, faces = geodesic(frequency)
    directions = directions @ _random_turn(rng).T
    planes = fracture_planes(rng, rock_type.cuts, rock_type.joints)
    sharpness = rock_type.sharpness * float(np.exp(rng.normal(0, 0.2)))
    if sharpness > 10:
        directions = snapped(directions, planes, 1.1 / frequency)
    radius = worn_radius(directions, planes, sharpness)
    if rock_type.ledges:
        radius = broken(directions, radius, rock_type.ledges, rng)
    body = directions * radius[:, None]
    swell = solid_noise(body, wavelength=1.6, octaves=2, rng=rng)
    grain = solid_noise(body, wavelength=0.7, octaves=max(1, int(np.log2(frequency))), rng=rng, gain=0.55)
    scale = 1 + 0.045 * swell.clip(-2, 2) + rock_type.roughness * grain.clip(-3, 3)
    if rock_type.layers:
        tilted = body @ _random_turn(rng, 0.15)[2]
        layer = 4.2 * tilted + 0.5 * swell
        # Weak beds weather back; hard ones keep the block's outline.
        bed = np.interp(layer % 1.0, [0, 0.12, 0.25, 0.85, 1.0], [1.0, 0.9, 0.0, 0.0, 1.0])
        scale -= rock_type.layers * bed * rng.uniform(0.3, 1.0, 64)[np.floor(layer).astype(int) % 64]
    body *= scale[:, None]
    body *= np.array(rock_type.proportions) * np.exp(rng.normal(0, rock_type.variety, 3))
    return body @ _random_turn(rng, rock_type.tilt).T, faces


def _random_turn(rng: np.random.Generator, spread: float | None = None) -> Array:
    """Random rotation (3, 3): uniform, or a small one of about ``spread`` [rad]."""
    columns = rng.normal(0, 1, (3, 3)) if spread is None else np.eye(3) + rng.normal(0, spread, (3, 3))
    q, r = np.linalg.qr(columns)
    q = q * np.sign(np.diag(r))
    return np.asarray(q if np.linalg.det(q) > 0 else q * [1, 1, -1])


def _collider(visible: Array, foot: float) -> Collider:
    """Smallest upright box or cylinder about ``visible`` (n, 3) [m] with its base at z = ``foot``."""
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
