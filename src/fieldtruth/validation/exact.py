# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A second ray tracer, for some hundred rays: double precision, NumPy, no Embree and no tree.

Things whose box a ray meets, then boxes about some triangles of their mesh, then the triangles themselves are sorted
out by brute force. Every triangle that the ray meets, or misses by a hair, is told: see ``Hits``.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.classes import Label
from fieldtruth.sense.scene import terrain_triangles
from fieldtruth.world.model import GROUND_ID, Mesh, World

F8 = NDArray[np.float64]
I8 = NDArray[np.int64]

TERRAIN: Final = ""
"""Name of the terrain among the meshes; the class of its triangles depends on where they are hit."""
BACKDROP: Final = "<backdrop>"
_GROUP: Final = 32  # triangles in a box
_RAYS: Final = 32  # at once against all things
_PAIRS: Final = 200_000  # of rays and triangles at once
_SKIN: Final = 0.001  # [m] by which boxes are larger
_PARALLEL: Final = 2e-5
"""Cosine between ray and normal below which a triangle is seen edge-on, and no ray can be sure to meet it."""


class Hits(NamedTuple):
    """Triangles that rays meet, or miss by a hair, ordered by ray and then by reach."""

    ray: I8
    reach: F8
    """[m] along the ray."""
    label: NDArray[np.uint8]
    """Class; 0 on the terrain, whose class depends on the place."""
    instance: I8
    margin: F8
    """[m] from the nearest border of the triangle, in its plane; below 0 outside."""
    cosine: F8
    """Of the angle between ray and normal."""


class _Solid(NamedTuple):
    """Triangles of a mesh in its own frame, neighbours together, and boxes about each ``_GROUP`` of them."""

    corners: F8
    label: NDArray[np.uint8]
    low: F8
    high: F8


class _Things(NamedTuple):
    """All things of a mesh: poses, object ids, and boxes in the world."""

    pose: F8
    inverse: F8
    object_id: I8
    low: F8
    high: F8


class ExactTracer:
    """A world's triangles. Threads may share it."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._solids: dict[str, _Solid] = {}
        poses: dict[str, list[F8]] = {TERRAIN: [np.eye(4)]}
        ids: dict[str, list[int]] = {TERRAIN: [GROUND_ID]}
        if world.backdrop is not None:
            poses[BACKDROP], ids[BACKDROP] = [np.eye(4)], [GROUND_ID]
        for thing in world.instances:
            poses.setdefault(thing.mesh, []).append(thing.world_from_object)
            ids.setdefault(thing.mesh, []).append(thing.object_id)
        for swarm in world.swarms:
            for row, pose in zip(swarm.mesh.tolist(), swarm.world_from_object, strict=True):
                poses.setdefault(swarm.meshes[row], []).append(pose)
                ids.setdefault(swarm.meshes[row], []).append(swarm.object_id)
        self._things = {name: self._placed(name, np.array(poses[name]), np.array(ids[name])) for name in poses}

    def hits(self, origins: F8, directions: F8, limit: F8) -> Hits:
        """Trace rays (n, 3), directions of unit length, each up to its limit (n,) [m]."""
        found: list[Hits] = []
        for first in range(0, len(origins), _RAYS):
            rays = np.arange(first, min(first + _RAYS, len(origins)))
            for name, things in self._things.items():
                ray, thing = np.nonzero(
                    _meets(things.low, things.high, origins[rays, None], directions[rays, None], limit[rays, None])
                )
                if len(ray):
                    found += self._try_things(name, rays[ray], thing, origins, directions, limit)
        if not found:
            nothing = np.zeros(0)
            return Hits(nothing.astype(int), nothing, nothing.astype(np.uint8), nothing.astype(int), nothing, nothing)
        hits = Hits._make(np.concatenate(parts) for parts in zip(*found, strict=True))
        order = np.lexsort((hits.reach, hits.ray))
        return Hits._make(part[order] for part in hits)

    def _try_things(self, name: str, ray: I8, thing: I8, origins: F8, directions: F8, limit: F8) -> list[Hits]:
        """Rays against things of one mesh whose boxes they meet."""
        things, solid = self._things[name], self._solid(name)
        inverse = things.inverse[thing]
        start = np.einsum("nij,nj->ni", inverse[:, :3, :3], origins[ray]) + inverse[:, :3, 3]
        ahead = np.einsum("nij,nj->ni", inverse[:, :3, :3], directions[ray])
        scale = np.linalg.norm(ahead, axis=1)  # of a metre in the thing's frame
        found = []
        for pairs in _blocks(len(ray), len(solid.low)):
            pair, group = np.nonzero(_meets(
                solid.low - _SKIN, solid.high + _SKIN, start[pairs, None], ahead[pairs, None], limit[ray[pairs], None]
            ))  # fmt: skip
            pair += pairs.start
            for part in _blocks(len(pair), _GROUP):
                face = group[part, None] * _GROUP + np.arange(_GROUP)
                inside = face < len(solid.corners)
                face, who = face[inside], np.repeat(pair[part], inside.sum(axis=1))
                reach, margin, cosine = _triangles(solid.corners[face], start[who], ahead[who])
                margin /= scale[who]
                here = (
                    (reach > 0) & (reach <= limit[ray[who]]) & (cosine > _PARALLEL) & (margin > -_near(reach) / cosine)
                )
                who, face = who[here], face[here]
                found.append(
                    Hits(
                        ray[who],
                        reach[here],
                        solid.label[face],
                        things.object_id[thing[who]],
                        margin[here],
                        cosine[here],
                    )
                )
        return found

    def _placed(self, name: str, pose: F8, object_id: I8) -> _Things:
        vertices = self._vertices(name).astype(np.float64)
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        corners = np.array([[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]]
                            for i in (0, 1) for j in (0, 1) for k in (0, 1)])  # fmt: skip
        placed = np.einsum("nij,cj->nci", pose[:, :3, :3], corners) + pose[:, None, :3, 3]
        inverse = np.asarray(np.linalg.inv(pose), np.float64)
        return _Things(pose, inverse, object_id, placed.min(axis=1) - _SKIN, placed.max(axis=1) + _SKIN)

    def _vertices(self, name: str) -> NDArray[np.float32]:
        return terrain_triangles(self._world.terrain.field)[0] if name == TERRAIN else self._mesh(name).vertices

    def _mesh(self, name: str) -> Mesh:
        if name == BACKDROP:
            assert self._world.backdrop is not None
            return self._world.backdrop
        return self._world.meshes[name]

    def _solid(self, name: str) -> _Solid:
        if name not in self._solids:
            if name == TERRAIN:
                vertices, faces = terrain_triangles(self._world.terrain.field)
                label = np.zeros(len(faces), np.uint8)
            else:
                mesh = self._mesh(name)
                vertices, faces = mesh.vertices, mesh.faces
                names = [int(self._world.materials[m].label) for m in mesh.materials]
                label = np.array(names, np.uint8)[mesh.material]
            self._solids[name] = _sorted(vertices.astype(np.float64)[faces], label)
        return self._solids[name]


def doubt(reach: F8, cosine: F8) -> F8:
    """Length [m] along a ray by which single precision may place a surface before or behind its place."""
    return np.asarray(_near(reach) / cosine + 1e-6 * reach)


def border_is_near(margin: F8, reach: F8, cosine: F8) -> NDArray[np.bool_]:
    """Whether a border is so near that single precision may fall on its other side."""
    return np.asarray(margin < _near(reach) / cosine)


def trail_labels(world: World, points: F8, reach: float, cosine: float) -> set[int]:
    """Classes that the terrain may have at a point (3,) [m]: both where a trail's edge is near."""
    distance = float(world.terrain.trail_distance.at(points[0], points[1]))
    labels = {int(Label.TRAIL if distance < 0 else Label.GROUND)}
    if abs(distance) < float(_near(np.array(reach))) / cosine:
        labels = {int(Label.TRAIL), int(Label.GROUND)}
    return labels


def _near(reach: F8) -> F8:
    """[m] by which a ray's end may lie beside its place, across the ray, in single precision.

    Coordinates of 64 m have a last digit of 8 um, and are turned into the frame of a thing; a direction's last digit
    moves the end by 1.2e-7 of the reach.
    """
    return np.asarray(3e-5 + 2.4e-7 * reach)


def _meets(low: F8, high: F8, start: F8, ahead: F8, limit: F8) -> NDArray[np.bool_]:
    """Whether rays up to their limits meet boxes."""
    near, far = np.zeros(()), limit
    for axis in range(3):
        along = ahead[..., axis]
        along = np.where(np.abs(along) < 1e-12, 1e-12, along)
        first, second = (low[..., axis] - start[..., axis]) / along, (high[..., axis] - start[..., axis]) / along
        near = np.maximum(near, np.minimum(first, second))
        far = np.minimum(far, np.maximum(first, second))
    return np.asarray(near <= far)


def _triangles(corners: F8, start: F8, ahead: F8) -> tuple[F8, F8, F8]:
    """Where rays meet the planes of triangles (n, 3, 3).

    Returns:
        Reach in lengths of ``ahead``, distance to the nearest border (below 0 outside), cosine to the normal.
    """
    edges = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(edges[:, 0], -edges[:, 2])
    area = np.linalg.norm(normal, axis=1)
    towards = np.einsum("ni,ni->n", normal, ahead)
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.einsum("ni,ni->n", normal, corners[:, 0] - start) / towards
        cosine = np.abs(towards) / (area * np.linalg.norm(ahead, axis=1))
        point = start + reach[:, None] * ahead
        inwards = np.cross(normal[:, None], edges)
        beside = np.einsum("nki,nki->nk", inwards, point[:, None] - corners) / np.linalg.norm(inwards, axis=-1)
    flat = ~(area > 0)
    return np.where(flat, -1.0, reach), np.where(flat, -np.inf, beside.min(axis=1)), np.where(flat, 0.0, cosine)


def _sorted(corners: F8, label: NDArray[np.uint8]) -> _Solid:
    """Bring neighbours together, along a curve through the cells of a grid whose number interleaves the axes' bits."""
    middle = corners.mean(axis=1)
    low = middle.min(axis=0)
    cell = ((middle - low) / max(1e-9, float(np.ptp(middle, axis=0).max())) * 1023).astype(np.int64)
    code = np.zeros(len(cell), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= (cell[:, axis] >> bit & 1) << (3 * bit + axis)
    order = np.argsort(code, kind="stable")
    corners, label = corners[order], label[order]
    starts = np.arange(0, len(corners), _GROUP)
    return _Solid(
        corners, label,
        np.minimum.reduceat(corners.min(axis=1), starts), np.maximum.reduceat(corners.max(axis=1), starts),
    )  # fmt: skip


def _blocks(count: int, each: int) -> list[slice]:
    """Parts of ``count`` items that hold at most ``_PAIRS`` pairs of ``each``."""
    step = max(1, _PAIRS // max(1, each))
    return [slice(first, min(first + step, count)) for first in range(0, count, step)]
