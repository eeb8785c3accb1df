# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Oriented boxes around the objects of a world that have an instance id of their own."""

from collections.abc import Collection
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.world.model import Instance, Mesh, World


class OrientedBox(NamedTuple):
    """The smallest box around an object, or a part of it, with given axes."""

    centre: Array
    """(3,) [m]."""
    size: Array
    """(3,) [m] along its axes."""
    rotation: Array
    """(3, 3) from its axes."""

    def in_frame(self, a_from_b: Array) -> "OrientedBox":
        """Return a box of frame b in frame a."""
        return OrientedBox(
            transforms.transform(a_from_b, self.centre[None])[0], self.size, a_from_b[:3, :3] @ self.rotation
        )

    def contains(self, points: Array, margin: float = 0.0) -> Mask:
        """Mask of the points (n, 3) [m] of its frame that are in it, or outside by at most ``margin`` [m]."""
        own = (np.asarray(points, np.float64) - self.centre) @ self.rotation
        return np.asarray((np.abs(own) <= self.size / 2 + margin).all(axis=-1))

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON."""
        return {"center": self.centre.tolist(), "size": self.size.tolist(), "rotation": self.rotation.tolist()}


def named_objects(world: World) -> dict[int, Instance]:
    """Objects by instance id: all but the robot, the ground, swarms and water."""
    return {each.object_id: each for each in world.instances if each.kind != "water"}


def box_around(points: Array, rotation: Array) -> OrientedBox:
    """Smallest box with axes ``rotation`` (3, 3) around points (n, 3)."""
    own = points @ rotation
    low, high = own.min(axis=0), own.max(axis=0)
    return OrientedBox(rotation @ ((low + high) / 2), high - low, rotation)


def object_box(world: World, instance: Instance) -> OrientedBox:
    """Box of an object in the world frame, along the axes of its own frame: x forward, z up where it stands upright."""
    scaled = instance.world_from_object[:3, :3]
    points = transforms.transform(instance.world_from_object, outermost(world.meshes[instance.mesh]))
    return box_around(points, scaled / np.cbrt(np.linalg.det(scaled)))


def faces_of(world: World, mesh: Mesh, labels: Collection[int] | None) -> Mask:
    """Mask (f,) of the faces of a mesh that have one of these classes; all for None."""
    if labels is None:
        return np.ones(len(mesh.faces), np.bool_)
    own = np.array([int(world.materials[name].label) for name in mesh.materials])
    return np.asarray(np.isin(own, list(labels))[mesh.material])


def outermost(mesh: Mesh, faces: Mask | None = None) -> Array:
    """Vertices (n, 3) [m] of the convex hull of a mesh, or of some of its faces, in the object's frame."""
    if faces is None:
        return _hull(mesh)
    return _hull_of(mesh.vertices[np.unique(mesh.faces[faces])])


@lru_cache(maxsize=4096)
def _hull(mesh: Mesh) -> Array:
    return _hull_of(mesh.vertices[np.unique(mesh.faces)])


def _hull_of(points: Any) -> Array:
    exact: Array = np.asarray(points, np.float64)
    try:
        corners: Array = exact[ConvexHull(exact).vertices]
    except (QhullError, ValueError):  # flat, or fewer than four
        return exact
    return corners
