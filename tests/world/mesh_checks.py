# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Checks that hold for every mesh, and the vertices and scale of an object."""

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Instance, Mesh, World


def face_normals(mesh: Mesh) -> Array:
    """Normals (f, 3) of the triangles, twice their area [m^2] long."""
    a, b, c = mesh.vertices[mesh.faces].astype(np.float64).transpose(1, 0, 2)
    return np.asarray(np.cross(b - a, c - a))


def world_vertices(world: World, instance: Instance) -> Array:
    """Vertices (v, 3) of an object in the world [m]."""
    pose = instance.world_from_object
    return np.asarray(world.meshes[instance.mesh].vertices @ pose[:3, :3].T + pose[:3, 3])


def scale_of(instance: Instance) -> float:
    """Uniform scale of an object."""
    return float(np.cbrt(np.linalg.det(instance.world_from_object[:3, :3])))


def assert_valid(mesh: Mesh, *, least_area: float) -> None:
    """Types and shapes of the arrays, finite values, unit normals, and triangles above an area [m^2]."""
    count = len(mesh.vertices)
    assert mesh.vertices.dtype == mesh.normals.dtype == mesh.uv.dtype == np.float32
    assert mesh.faces.dtype == mesh.material.dtype == np.int32
    assert mesh.vertices.shape == mesh.normals.shape == (count, 3)
    assert mesh.uv.shape == (count, 2)
    assert mesh.material.shape == (len(mesh.faces),)
    assert mesh.faces.min() == 0
    assert mesh.faces.max() < count
    assert all(np.isfinite(a).all() for a in (mesh.vertices, mesh.normals, mesh.uv))
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
    assert 0.5 * np.linalg.norm(face_normals(mesh), axis=1).min() > least_area


def assert_same_bytes(first: Mesh, second: Mesh) -> None:
    """Equality of two meshes to the last bit."""
    for part in ("vertices", "normals", "uv", "faces", "material"):
        assert getattr(first, part).tobytes() == getattr(second, part).tobytes()
    assert first.colliders == second.colliders
    assert first.footprint == second.footprint
