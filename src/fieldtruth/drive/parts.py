# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Parts of a world: what lies in a rectangle of it, as a world in the same coordinates.

Maps and physics of a large world are made of parts, so that they cost what lies around the route and not the world.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.drive.bearing import FOOT
from fieldtruth.world.model import Collider, Heightfield, Mesh, Swarm, World

WHOLE: Final = 100.0
"""Side length [m] up to which a world is one part."""


class WorldParts:
    """Parts of ``world``, with whatever reaches into them."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.is_one = max(world.size) <= WHOLE
        if not self.is_one:
            self._low, self._high = _extents(world)
            self._swarms = [_circles(world, swarm) for swarm in world.swarms]

    def around(self, xy: Array, reach: float) -> World:
        """The part within ``reach`` [m] of a point (2,) [m] along x and y; a world up to ``WHOLE`` itself."""
        return self.within(xy - reach, xy + reach)

    def within(self, low: Array, high: Array) -> World:
        """Return what lies or reaches between two corners (2,) [m]: terrain, colliders, feet of trunks, swarms.

        Objects and members of swarms keep their order. ``size`` stays that of the world, whose middle is the origin.
        """
        world = self._world
        if self.is_one:
            return world
        near = np.flatnonzero(((self._low <= high) & (self._high >= low)).all(axis=1))
        field, layer = world.terrain.field, world.terrain.layer
        nodes = _nodes(field, low, high)
        cut = replace(
            field,
            heights=np.ascontiguousarray(field.heights[nodes]),
            x0=field.x0 + field.spacing * nodes[0].start,
            y0=field.y0 + field.spacing * nodes[1].start,
        )
        members = [
            np.flatnonzero((np.abs(np.clip(circles[:, :2], low, high) - circles[:, :2]) <= circles[:, 2:]).all(axis=1))
            for circles in self._swarms
        ]
        return replace(
            world,
            terrain=replace(world.terrain, field=cut, layer=None if layer is None else layer[nodes]),
            instances=tuple(world.instances[k] for k in near.tolist()),
            swarms=tuple(_members(swarm, kept) for swarm, kept in zip(world.swarms, members, strict=True)),
        )


def _nodes(field: Heightfield, low: Array, high: Array) -> tuple[slice, slice]:
    """Rows and columns of the nodes around a rectangle; two at least."""
    start, last = np.array([field.x0, field.y0]), np.array(field.heights.shape) - 1
    first = np.clip(np.floor((low - start) / field.spacing).astype(int), 0, last - 1)
    end = np.clip(np.ceil((high - start) / field.spacing).astype(int), first + 1, last) + 1
    return slice(int(first[0]), int(end[0])), slice(int(first[1]), int(end[1]))


def _members(swarm: Swarm, kept: NDArray[np.intp]) -> Swarm:
    return replace(swarm, mesh=swarm.mesh[kept], world_from_object=swarm.world_from_object[kept], tint=swarm.tint[kept])


def _circles(world: World, swarm: Swarm) -> Array:
    """Circles (n, 3) around the members of a swarm: x, y, radius [m]."""
    radius = np.array(
        [np.linalg.norm(world.meshes[name].vertices, axis=1).max(initial=0.0) for name in swarm.meshes], np.float64
    )
    poses = swarm.world_from_object
    return np.column_stack([poses[:, :2, 3], radius[swarm.mesh] * np.linalg.norm(poses[:, :3, 0], axis=1)])


def _extents(world: World) -> tuple[Array, Array]:
    """Lowest and highest x, y [m], (n, 2) each, of the colliders and feet of all instances."""
    low, high = np.empty((len(world.instances), 2)), np.empty((len(world.instances), 2))
    rows: dict[str, list[int]] = {}
    for row, instance in enumerate(world.instances):
        rows.setdefault(instance.mesh, []).append(row)
    for name, own in rows.items():
        poses = np.array([world.instances[row].world_from_object for row in own])
        low[own], high[own] = poses[:, :2, 3], poses[:, :2, 3]
        for points, radius in _solids(world.meshes[name]):
            scaled = radius * np.linalg.norm(poses[:, :3, 0], axis=1)[:, None]
            placed = np.stack([poses[:, :2, :3] @ point + poses[:, :2, 3] for point in points])
            low[own] = np.minimum(low[own], placed.min(axis=0) - scaled)
            high[own] = np.maximum(high[own], placed.max(axis=0) + scaled)
    return low, high


def _solids(mesh: Mesh) -> Iterator[tuple[Array, float]]:
    """Yield points on the axis, in the object's frame, and the radius [m] around them of each collider and the foot."""
    for collider in mesh.colliders:
        x, y, z = collider.position
        yield np.array([(x, y, z), (x, y, z + collider.size[-1])]), _radius(collider)
    foot: NDArray[np.float32] = mesh.vertices[mesh.vertices[:, 2] < 4 * FOOT]
    yield np.zeros((1, 3)), float(np.linalg.norm(foot, axis=1).max(initial=0.0))


def _radius(collider: Collider) -> float:
    return collider.size[0] if collider.shape == "cylinder" else math.hypot(*collider.size[:2]) / 2
