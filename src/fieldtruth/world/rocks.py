# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rocks: types as data, bodies made by fracture and noise as meshes, and poses in the ground.

A body is star-shaped: it has one radius per direction. Cut by planes with normals n_k at distances d_k, its radius in
direction u is 1 / max(n_k . u / d_k). Erosion rounds edges and corners: a p-norm replaces the maximum, close to it for
a large p (flat facets of freshly broken rock) and a smooth ball for a small one.

A mesh has normals with creases, texture coordinates projected on boxes, and a collider; a part of it is below the soil.
A pose is inclined with the slope, and so deep that no gap below the rim is visible.
"""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.spatial import ConvexHull

from fieldtruth.core.arrays import Array, Index
from fieldtruth.world import materials  # noqa: F401  (reads the materials and textures of added files)
from fieldtruth.world.grids import solid_noise
from fieldtruth.world.library import Entry, Library, validated
from fieldtruth.world.model import Collider, Heightfield, Instance, Mesh, make_mesh
from fieldtruth.world.placement import (
    Density,
    ObjectGroup,
    WorldBuilder,
    eased,
    place_until_count,
    random_tint,
    rotations_to,
    upright_pose,
)

TRIES: Final = 6000
_SNAP: Final = 0.4
"""Distance, in sides of a triangle, within which vertices move onto an edge, so that edges are not jagged."""


def geodesic(frequency: int) -> tuple[Array, Index]:
    """Unit vertices (v, 3) and outward faces (20 * frequency**2, 3) of a subdivided icosahedron."""
    golden = (1 + 5**0.5) / 2
    ring = [(0.0, a, b) for a in (-1.0, 1.0) for b in (-golden, golden)]
    corners = np.array([np.roll(p, k) for k in range(3) for p in ring])
    apart = np.linalg.norm(corners[:, None] - corners, axis=-1)
    faces = np.array(
        [
            (a, b, c) if np.linalg.det(corners[[a, b, c]]) > 0 else (a, c, b)
            for a in range(12)
            for b in range(a)
            for c in range(b)
            if max(apart[a, b], apart[b, c], apart[a, c]) < 2.01
        ]
    )
    steps = [(i, j) for i in range(frequency + 1) for j in range(frequency + 1 - i)]
    number = {step: k for k, step in enumerate(steps)}
    shares = np.array([(frequency - i - j, i, j) for i, j in steps]) / frequency
    cells = [(number[i, j], number[i + 1, j], number[i, j + 1]) for i, j in steps if i + j < frequency]
    cells += [(number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]) for i, j in steps if i + j < frequency - 1]
    points = np.einsum("sk,fkd->fsd", shares, corners[faces]).reshape(-1, 3)
    triangles = (np.arange(20)[:, None, None] * len(steps) + np.array(cells)).reshape(-1, 3)
    _, first, owner = np.unique(np.round(points, 6), axis=0, return_index=True, return_inverse=True)
    unique = points[first]
    return unique / np.linalg.norm(unique, axis=1, keepdims=True), owner.ravel()[triangles]


def fracture_planes(rng: np.random.Generator, count: int, joints: float) -> Array:
    """Planes (k, 3) as n / d: random cuts and, with ``joints`` (0 to 1), three orthogonal families.

    Massive rock breaks along joints into blocks (Hencher, Practical Rock Mechanics, 2015): pairs of parallel planes,
    here the more oblique the smaller ``joints`` is; the random cuts remove the corners.
    """
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, k * np.pi * (3 - 5**0.5)
    around = np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=-1)
    around += rng.normal(0, 0.28, around.shape)
    cuts = around / np.linalg.norm(around, axis=1, keepdims=True)
    distance = rng.uniform(0.82, 1.12, count) + 0.22 * joints
    if joints > 0:
        axes = np.concatenate([np.eye(3), -np.eye(3)]) + rng.normal(0, 0.32 - 0.22 * joints, (6, 3))
        cuts = np.concatenate([cuts, axes / np.linalg.norm(axes, axis=1, keepdims=True)])
        distance = np.concatenate([distance, rng.uniform(0.5 + 0.25 * joints, 0.97, 6) / max(joints, 0.3) ** 0.2])
    return np.asarray(cuts / distance[:, None])


def worn_radius(directions: Array, planes: Array, sharpness: float) -> Array:
    """Radius (v,) of the body along unit ``directions`` (v, 3); ``sharpness`` is the p of the norm."""
    inverse = np.maximum(directions @ planes.T, 0)
    top = inverse.max(axis=1)
    return np.asarray(1 / (top * ((inverse / top[:, None]) ** sharpness).sum(axis=1) ** (1 / sharpness)))


def broken(directions: Array, radius: Array, count: int, rng: np.random.Generator) -> Array:
    """Radius (v,) after ``count`` pieces broke off: each leaves a flat face that ends at a ledge inside the body."""
    for _ in range(count):
        normal, along = (v / np.linalg.norm(v) for v in rng.normal(0, 1, (2, 3)))
        faced = directions @ normal
        distance = rng.uniform(0.62, 0.88) * float((radius * faced).max())
        cut = distance / np.maximum(faced, 0.05)
        share = np.clip((directions @ along - rng.uniform(-0.2, 0.35)) / 0.1 + 0.5, 0.0, 1.0)
        radius = radius - share * np.maximum(radius - cut, 0.0)
    return radius


def snapped(directions: Array, planes: Array, side: float) -> Array:
    """Directions moved onto edges between facets that are nearer than ``_SNAP`` times a triangle's ``side`` [rad]."""
    moved = directions
    for _ in range(3):
        inverse = np.maximum(moved @ planes.T, 1e-9)
        order = np.argsort(-inverse, axis=1)[:, :2]
        first, second = planes[order[:, 0]], planes[order[:, 1]]
        rows = np.arange(len(moved))
        gap = inverse[rows, order[:, 0]] - inverse[rows, order[:, 1]]
        uphill = first - second
        uphill = uphill - (uphill * moved).sum(1, keepdims=True) * moved
        step = -gap[:, None] * uphill / np.maximum((uphill**2).sum(1, keepdims=True), 1e-9)
        near = np.linalg.norm(moved + step - directions, axis=1) < _SNAP * side
        moved = np.where(near[:, None], moved + step, moved)
        moved = moved / np.linalg.norm(moved, axis=1, keepdims=True)
    return np.asarray(moved)


def corner_normals(vertices: Array, faces: Index, crease_deg: float) -> Array:
    """Unit normals (f, 3, 3) of each face's corners: the mean over adjacent faces within the crease angle."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    flat = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    corner = faces.ravel()
    order = np.argsort(corner, kind="stable")
    start = np.searchsorted(corner[order], np.arange(len(vertices)))
    count = np.diff([*start, len(corner)])
    result = np.zeros((len(corner), 3))
    own = flat[np.arange(len(corner)) // 3]
    for k in range(int(count.max())):
        has = count[corner] > k
        around = order[np.minimum(start[corner] + k, len(corner) - 1)] // 3
        joined = has & ((flat[around] * own).sum(1) > np.cos(np.radians(crease_deg)))
        result += across[around] * joined[:, None]
    lengths = np.linalg.norm(result, axis=1, keepdims=True)
    return np.asarray(np.where(lengths > 1e-12, result / np.maximum(lengths, 1e-12), own).reshape(-1, 3, 3))


def box_uv(vertices: Array, faces: Index, smooth: Array, shift: Array) -> tuple[Array, Index]:
    """Texture coordinates [m] (f, 3, 2) projected along the nearest axis of each face, and that axis (f,) 0 to 2.

    Faces are inclined by at most 55 deg to the projection, so the texture is stretched by less than 1.8. The normals
    ``smooth`` (f, 3) choose the axis, so that a rough surface is not patchy; ``shift`` (3, 2) [m] is per axis.
    """
    axis = np.argmax(np.abs(smooth), axis=1)
    u = np.array([1, 0, 0])[axis]
    v = np.array([2, 2, 1])[axis]
    corners = vertices[faces]
    rows = np.arange(len(faces))[:, None]
    uv = np.stack([corners[rows, [[0, 1, 2]], u[:, None]], corners[rows, [[0, 1, 2]], v[:, None]]], axis=-1)
    return uv + shift[axis][:, None], axis


def welded(
    vertices: Array, faces: Index, normals: Array, uv: Array, axis: Index
) -> tuple[Array, Array, Array, NDArray[np.int32]]:
    """Vertices, normals, uv and faces with corners merged that share position, normal and texture axis."""
    key = np.column_stack([faces.ravel(), np.repeat(axis, 3), np.round(normals.reshape(-1, 3) * 1000).astype(np.int64)])
    _, first, owner = np.unique(key, axis=0, return_index=True, return_inverse=True)
    triangles = owner.reshape(-1, 3).astype(np.int32)
    return vertices[faces.ravel()[first]], normals.reshape(-1, 3)[first], uv.reshape(-1, 2)[first], triangles


TEXTURE_LENGTH: Final = 1.2
"""Length [m] of one repeat of a rock's texture."""


@dataclass(frozen=True, kw_only=True)
class RockType:
    """Fracture and weathering of the rocks of one type."""

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
    return make_mesh(
        name, *skin, (rock_type.material,), colliders=(_collider(visible, -depth / 2),) if solid else (),
        footprint=float(np.hypot(visible[:, 0], visible[:, 1]).max()), species=(rock_type.name,),
    )  # fmt: skip


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


COURSE: Final = 0.19
"""Mean height [m] of a course of a dry stone wall."""
BATTER: Final = 0.3
"""Share of its thickness at the foot that a wall loses up to its top."""


def laid_stones(material: str, size: tuple[float, ...], rng: np.random.Generator) -> list[Mesh]:
    """Stones of a dry wall along x, two skins of staggered courses below a course of through stones.

    ``size`` [m] is length, thickness at the foot, and height above z = 0; the first course is in the soil.
    """
    length, thickness, height = size
    count = max(2, round(height / COURSE))
    inner = np.arange(1, count) + rng.uniform(-0.12, 0.12, count - 1)
    levels = np.concatenate([[-0.12], inner * height / count, [height]])
    stones = []
    for k, (low, high) in enumerate(pairwise(levels)):
        wide = thickness * (1 - BATTER * max(low, 0.0) / height)
        for side in (0.0,) if k == count - 1 else (-1.0, 1.0):
            depth = wide if side == 0 else 0.56 * wide
            for start, end in pairwise(_joints(length, rng)):
                extent = np.array([end - start, depth, high - low]) * rng.uniform([1.0, 0.88, 1.02], [1.08, 1.06, 1.22])
                middle = (start + end) / 2, side * (wide - depth) / 2, (low + high) / 2
                stones.append(_stone(material, extent, np.array(middle), rng))
    return stones


def _joints(length: float, rng: np.random.Generator) -> Array:
    """Positions [m] along a course of its stones' ends."""
    parts = rng.uniform(0.6, 1.6, max(2, round(length / (1.7 * COURSE) + rng.uniform(-0.6, 0.6))))
    return np.asarray(length * (np.concatenate([[0.0], np.cumsum(parts)]) / parts.sum() - 0.5))


def _stone(material: str, extent: Array, middle: Array, rng: np.random.Generator) -> Mesh:
    """A hewn block of an ``extent`` (3,) [m] about its ``middle``."""
    directions, faces = geodesic(3)
    directions = directions @ _random_turn(rng).T
    planes = fracture_planes(rng, 9, 0.95)
    directions = snapped(directions, planes, 1.1 / 3)
    body = directions * worn_radius(directions, planes, 22.0)[:, None]
    body *= (1 + 0.025 * solid_noise(body, wavelength=0.7, octaves=2, rng=rng))[:, None]
    body = body @ _random_turn(rng, 0.04).T
    vertices = middle + (body - (body.max(0) + body.min(0)) / 2) / np.ptp(body, axis=0) * extent
    normals = corner_normals(vertices, faces, 30.0)
    uv, axis = box_uv(vertices, faces, corner_normals(vertices, faces, 89.0).mean(axis=1), rng.uniform(0, 8, (3, 2)))
    return make_mesh("stone", *welded(vertices, faces, normals, uv / TEXTURE_LENGTH, axis), (material,))


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


LEAN: Final = 0.75
"""Slope of a rock relative to that of the ground."""
_SECTORS: Final = 16
BED: Final = 0.03
"""Least depth of a rock's rim in the ground [m], per square root of its radius [m]."""


def rock_pose(field: Heightfield, mesh: Mesh, x: float, y: float, yaw: float, scale: float) -> Array:
    """Pose (4, 4) of a rock, inclined with the mean slope below it and sunk until its whole rim is in the ground."""
    radius = mesh.footprint * scale
    angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    around = field.height_at(x + 0.8 * radius * np.cos(angles), y + 0.8 * radius * np.sin(angles))
    slope = 2 * np.array([around @ np.cos(angles), around @ np.sin(angles)]) / (len(angles) * 0.8 * radius)
    pose = upright_pose(x, y, yaw, scale)
    pose[:3, :3] = rotations_to(np.array([[-LEAN * slope[0], -LEAN * slope[1], 1.0]]))[0] @ pose[:3, :3]
    rim = rim_vertices(mesh) @ pose[:3, :3].T + pose[:3, 3]
    gap = rim[:, 2] - field.height_at(rim[:, 0], rim[:, 1])
    pose[2, 3] = min(float(around.mean()), -float(gap.max()) - BED * np.sqrt(radius))
    return pose


def rim_vertices(mesh: Mesh) -> Array:
    """The lowest vertex (k, 3) in the outer part of each sector around the rock; it must be below the ground."""
    points = mesh.vertices.astype(np.float64)
    away, turn = np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])
    number = np.floor((turn / (2 * np.pi) + 0.5) * _SECTORS).astype(int) % _SECTORS
    found = []
    for k in range(_SECTORS):
        rows = np.flatnonzero(number == k)
        if len(rows):
            outer = rows[away[rows] > 0.55 * away[rows].max()]
            found.append(points[outer[np.argmin(points[outer, 2])]])
    return np.array(found)


def scatter_rocks(
    builder: WorldBuilder, group: ObjectGroup, rng: np.random.Generator, density: Density
) -> list[Instance]:
    """Scatter rocks where ``density`` (share in [0, 1] at positions (n, 2)) allows them.

    Draws ``TRIES`` positions and a number for each at first; then for each candidate that keeps the spacing a scale,
    whose logarithm is uniform, and for a placed rock yaw and tint.

    Raises:
        CrowdedWorldError: too few candidates are free even at a fifth of the spacing.
    """
    darts = builder.random_positions(builder.tries(TRIES), rng)
    hits = darts[rng.random(len(darts)) < density(darts)]

    def attempt(xy: Array, number: int, apart: bool) -> Instance | None:
        if not apart:
            return None
        mesh, scale = group.mesh(number), float(np.exp(rng.uniform(*np.log(group.scales))))
        if not builder.is_free(xy, mesh.footprint * scale):
            return None
        x, y = map(float, xy)
        pose = rock_pose(builder.field, mesh, x, y, float(rng.uniform(0, 2 * np.pi)), scale)
        return builder.add(group.kind, mesh, pose, [(*xy, mesh.footprint * scale)], tint=random_tint(rng, group.tint))

    spacings = eased(group.spacing, (1.0, 0.8, 0.6, 0.4, 0.2))
    return group.check_complete(place_until_count(group.count, hits, attempt, spacings=spacings))
