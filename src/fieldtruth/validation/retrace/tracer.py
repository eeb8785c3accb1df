# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A second ray tracer: double precision, NumPy, no Embree and no tree. It serves a few thousand rays, not images.

Bounding boxes of objects, then of groups of triangles, then the triangles themselves are tested by brute force. Every
triangle that a ray hits, or misses by less than single precision resolves, is returned.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Index, Mask
from fieldtruth.world.model import GROUND_ID, Heightfield, Mesh, World

TERRAIN: Final = 0
"""Label of triangles of the terrain, whose class depends on where they are hit."""
_GROUP: Final = 32  # triangles per box
_RAYS: Final = 32  # at once against all objects
_PAIRS: Final = 200_000  # of rays and triangles at once
_SKIN: Final = 0.001  # [m] by which boxes are larger
_PARALLEL: Final = 2e-5
"""Cosine between ray and normal below which a triangle is seen edge-on and skipped."""


class Hits(NamedTuple):
    """Triangles that rays hit or nearly hit, ordered by ray and then by range."""

    ray: Index
    range_m: Array
    label: NDArray[np.uint8]
    instance: Index
    margin: Array
    """Distance [m] to the nearest edge of the triangle, in its plane; below 0 outside."""
    cosine: Array
    """Of the angle between ray and normal."""


class _Solid(NamedTuple):
    """Triangles of a mesh in its own frame, neighbours together, with a box about each ``_GROUP`` of them."""

    corners: Array
    label: NDArray[np.uint8]
    low: Array
    high: Array


class _Placed(NamedTuple):
    """All objects with the same mesh: object_from_world, instance ids, and boxes in the world."""

    inverse: Array
    instance: Index
    low: Array
    high: Array


class ReferenceTracer:
    """The triangles of a world. Threads may share it."""

    def __init__(self, world: World) -> None:
        self.world = world
        labels = {name: int(material.label) for name, material in world.materials.items()}
        meshes: dict[str, tuple[Array, NDArray[np.uint8]]] = {"terrain": terrain_corners(world.terrain.field)}
        poses: dict[str, list[tuple[Array, int]]] = {"terrain": [(np.eye(4), GROUND_ID)]}

        def place(mesh: Mesh, pose: Array, instance: int) -> None:
            name = f"mesh {mesh.name}"
            if name not in meshes:
                label = np.array([labels[material] for material in mesh.materials], np.uint8)[mesh.material]
                meshes[name] = mesh.vertices.astype(np.float64)[mesh.faces], label
            poses.setdefault(name, []).append((pose, instance))

        if world.backdrop is not None:
            place(world.backdrop, np.eye(4), GROUND_ID)
        for each in world.instances:
            place(world.meshes[each.mesh], each.world_from_object, each.object_id)
        for swarm in world.swarms:
            own = [world.meshes[name] for name in swarm.meshes]
            for row, pose in zip(swarm.mesh.tolist(), swarm.world_from_object, strict=True):
                place(own[row], pose, swarm.object_id)
        self._solids = {name: _grouped(*mesh) for name, mesh in meshes.items()}
        self._placed = {name: _placed(self._solids[name], poses[name]) for name in meshes}

    @property
    def triangles(self) -> int:
        """Number of triangles in the world, those of each object counted."""
        return sum(len(solid.corners) * len(self._placed[name].instance) for name, solid in self._solids.items())

    def hits(self, origins: Array, directions: Array, limit: Array) -> Hits:
        """Trace rays (n, 3), directions of unit length, each up to its limit (n,) [m]."""
        nothing = np.zeros(0)
        found = [Hits(nothing.astype(int), nothing, nothing.astype(np.uint8), nothing.astype(int), nothing, nothing)]
        for first in range(0, len(origins), _RAYS):
            rays = np.arange(first, min(first + _RAYS, len(origins)))
            start, ahead, end = origins[rays, None], directions[rays, None], limit[rays, None]
            for name, placed in self._placed.items():
                ray, row = np.nonzero(_meets(placed.low, placed.high, start, ahead, end))
                if len(ray):
                    found += self._hits_of(name, rays[ray], row, origins, directions, limit)
        hits = Hits._make(np.concatenate(parts) for parts in zip(*found, strict=True))
        order = np.lexsort((hits.range_m, hits.ray))
        return Hits._make(part[order] for part in hits)

    def _hits_of(
        self, name: str, ray: Index, row: Index, origins: Array, directions: Array, limit: Array
    ) -> list[Hits]:
        """Hits of pairs of ray and object, all with the same mesh."""
        placed, solid, found = self._placed[name], self._solids[name], []
        inverse = placed.inverse[row]
        start = np.einsum("nij,nj->ni", inverse[:, :3, :3], origins[ray]) + inverse[:, :3, 3]
        ahead = np.einsum("nij,nj->ni", inverse[:, :3, :3], directions[ray])
        scale = np.linalg.norm(ahead, axis=1)  # of a metre in the object's frame
        low, high = solid.low - _SKIN, solid.high + _SKIN
        for pairs in _blocks(len(ray), len(low)):
            near = _meets(low, high, start[pairs, None], ahead[pairs, None], limit[ray[pairs], None])
            pair, group = np.nonzero(near)
            pair += pairs.start
            for part in _blocks(len(pair), _GROUP):
                face = group[part, None] * _GROUP + np.arange(_GROUP)
                inside = face < len(solid.corners)
                face, pair_of = face[inside], np.repeat(pair[part], inside.sum(axis=1))
                range_m, margin, cosine = _intersect(solid.corners[face], start[pair_of], ahead[pair_of])
                margin /= scale[pair_of]
                hit = (range_m > 0) & (range_m <= limit[ray[pair_of]]) & (cosine > _PARALLEL)
                hit &= margin > -resolution(range_m) / np.maximum(cosine, _PARALLEL)
                pair_of, face = pair_of[hit], face[hit]
                instance = placed.instance[row[pair_of]]
                found.append(Hits(ray[pair_of], range_m[hit], solid.label[face], instance, margin[hit], cosine[hit]))
        return found


def resolution(range_m: Array) -> Array:
    """Distance [m] across the ray by which single precision may displace its end.

    Coordinates of 64 m have a last digit of 8 um and are transformed to the frame of an object; the last digit of a
    direction moves the end by 1.2e-7 of the range.
    """
    return np.asarray(3e-5 + 2.4e-7 * range_m)


def terrain_corners(field: Heightfield) -> tuple[Array, NDArray[np.uint8]]:
    """Triangles (t, 3, 3) of a heightfield as its docstring defines them, cells divided from (i, j) to (i + 1, j + 1).

    It does not use the triangulation of the sensors' scene.
    """
    i, j = np.meshgrid(*(np.arange(n) for n in field.heights.shape), indexing="ij")
    nodes = np.stack([field.x0 + field.spacing * i, field.y0 + field.spacing * j, field.heights], axis=-1)
    a, b, c, d = nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]
    corners = np.stack([np.stack([a, b, c], axis=-2), np.stack([a, c, d], axis=-2)]).reshape(-1, 3, 3)
    return corners.astype(np.float64), np.full(len(corners), TERRAIN, np.uint8)


def _grouped(corners: Array, label: NDArray[np.uint8]) -> _Solid:
    """Sort triangles along a Morton curve, so that neighbours share a box."""
    middle = corners.mean(axis=1)
    cell = (middle - middle.min(axis=0)) / max(1e-9, float(np.ptp(middle, axis=0).max()))
    cell = (cell * 1023).astype(np.int64)
    code = np.zeros(len(cell), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= (cell[:, axis] >> bit & 1) << (3 * bit + axis)
    order = np.argsort(code, kind="stable")
    corners, starts = corners[order], np.arange(0, len(corners), _GROUP)
    low, high = corners.min(axis=1), corners.max(axis=1)
    return _Solid(corners, label[order], np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts))


def _placed(solid: _Solid, poses: list[tuple[Array, int]]) -> _Placed:
    pose, instance = np.array([pose for pose, _ in poses]), np.array([number for _, number in poses])
    bounds = np.stack([solid.low.min(axis=0), solid.high.max(axis=0)])
    corners = np.array([[bounds[i, 0], bounds[j, 1], bounds[k, 2]] for i, j, k in np.ndindex(2, 2, 2)])
    moved = np.einsum("nij,cj->nci", pose[:, :3, :3], corners) + pose[:, None, :3, 3]
    inverse = np.asarray(np.linalg.inv(pose), np.float64)
    return _Placed(inverse, instance, moved.min(axis=1) - _SKIN, moved.max(axis=1) + _SKIN)


def _meets(low: Array, high: Array, start: Array, ahead: Array, limit: Array) -> Mask:
    """Whether rays up to their limits meet boxes."""
    near, far = np.zeros(()), limit
    for axis in range(3):
        along = ahead[..., axis]
        along = np.where(np.abs(along) < 1e-12, 1e-12, along)
        first, second = (low[..., axis] - start[..., axis]) / along, (high[..., axis] - start[..., axis]) / along
        near, far = np.maximum(near, np.minimum(first, second)), np.minimum(far, np.maximum(first, second))
    return np.asarray(near <= far)


def _intersect(corners: Array, start: Array, ahead: Array) -> tuple[Array, Array, Array]:
    """Intersect rays with the planes of triangles (n, 3, 3).

    Returns:
        Range in lengths of ``ahead``, distance to the nearest edge (below 0 outside), cosine to the normal.
    """
    edges = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(edges[:, 0], -edges[:, 2])
    area = np.linalg.norm(normal, axis=1)
    towards = np.einsum("ni,ni->n", normal, ahead)
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = np.einsum("ni,ni->n", normal, corners[:, 0] - start) / towards
        cosine = np.abs(towards) / (area * np.linalg.norm(ahead, axis=1))
        point = start + range_m[:, None] * ahead
        inwards = np.cross(normal[:, None], edges)
        inside = np.einsum("nki,nki->nk", inwards, point[:, None] - corners) / np.linalg.norm(inwards, axis=-1)
    flat = ~(area > 0)
    return np.where(flat, -1.0, range_m), np.where(flat, -np.inf, inside.min(axis=1)), np.where(flat, 0.0, cosine)


def _blocks(count: int, each: int) -> list[slice]:
    """Slices of ``count`` items that hold at most ``_PAIRS`` pairs of ``each``."""
    step = max(1, _PAIRS // max(1, each))
    return [slice(first, min(first + step, count)) for first in range(0, count, step)]
