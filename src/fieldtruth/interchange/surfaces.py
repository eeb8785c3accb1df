# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Surfaces: the triangles of one material, and therefore of one class, as other tools take them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Float32Array
from fieldtruth.core.classes import Label
from fieldtruth.world.model import Material, Mesh


@dataclass(frozen=True, kw_only=True)
class Surface:
    """Triangles of one material.

    ``vertices`` (v, 3) float32 [m]; ``normals`` (v, 3) float32 of unit length; ``uv`` (v, 2) float32 in repeats of the
    texture, u to the right and v up; ``faces`` (f, 3) int32, anticlockwise seen from outside; ``tint`` (v, 3) float32
    is a linear colour factor per vertex, None where it is 1.
    """

    material: str
    label: Label
    vertices: Float32Array
    normals: Float32Array
    uv: Float32Array
    faces: NDArray[np.int32]
    tint: Float32Array | None = None


def mesh_surfaces(mesh: Mesh, materials: Mapping[str, Material]) -> tuple[Surface, ...]:
    """Split a mesh by material, in the order of ``mesh.materials``; each part has the vertices that it uses."""
    return tuple(
        Surface(
            material=name,
            label=materials[name].label,
            vertices=mesh.vertices[rows],
            normals=mesh.normals[rows],
            uv=mesh.uv[rows],
            faces=faces,
        )
        for name, rows, faces in _parts(mesh)
    )


def _parts(mesh: Mesh) -> Iterator[tuple[str, NDArray[np.intp], NDArray[np.int32]]]:
    """Yield a material's name, the rows of its vertices and its faces, for each material that has faces."""
    for row, name in enumerate(mesh.materials):
        faces = mesh.faces[mesh.material == row]
        if not len(faces):
            continue
        used = np.zeros(len(mesh.vertices), bool)
        used[faces] = True
        renumbered = (np.cumsum(used) - 1).astype(np.int32)
        yield name, np.flatnonzero(used), renumbered[faces]


def merge_surfaces(parts: Sequence[Surface]) -> Surface:
    """Join surfaces of one material and one frame into one."""
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    tinted = any(part.tint is not None for part in parts)
    tints = [np.ones((len(p.vertices), 3), np.float32) if p.tint is None else p.tint for p in parts] if tinted else []
    return Surface(
        material=parts[0].material,
        label=parts[0].label,
        vertices=np.concatenate([part.vertices for part in parts]),
        normals=np.concatenate([part.normals for part in parts]),
        uv=np.concatenate([part.uv for part in parts]),
        faces=np.concatenate([part.faces + np.int32(o) for part, o in zip(parts, offsets, strict=True)]),
        tint=np.concatenate(tints) if tinted else None,
    )


def placed(surface: Surface, poses: NDArray[np.float64], tints: NDArray[np.float32] | None = None) -> Surface:
    """Copy a surface to poses (n, 4, 4), rotation times a uniform scale and translation, with tints (n, 3)."""
    count, size = len(poses), len(surface.vertices)
    rotations = poses[:, :3, :3] / np.cbrt(np.linalg.det(poses[:, :3, :3]))[:, None, None]
    vertices = surface.vertices.astype(np.float64) @ np.swapaxes(poses[:, :3, :3], 1, 2) + poses[:, None, :3, 3]
    normals = surface.normals @ np.swapaxes(rotations, 1, 2).astype(np.float32)
    offsets = (size * np.arange(count, dtype=np.int32))[:, None, None]
    return Surface(
        material=surface.material,
        label=surface.label,
        vertices=vertices.reshape(-1, 3).astype(np.float32),
        normals=normals.reshape(-1, 3),
        uv=np.tile(surface.uv, (count, 1)),
        faces=(surface.faces + offsets).reshape(-1, 3),
        tint=None if tints is None else np.repeat(tints, size, axis=0),
    )
