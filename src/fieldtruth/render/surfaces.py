# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Normals, texture coordinates, materials, tints and snow of a scene's surfaces, as tables that kernels read."""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.light import SnowTable, SurfaceTable
from fieldtruth.sense.scene import Scene, grid_of
from fieldtruth.world.model import Mesh, Terrain
from fieldtruth.world.seasons.snow import hidden_share

LOADS: Final = 0.05
"""Depth [m] in the open from which all that faces up is white."""


def surface_table(scene: Scene, vertex_near: Float32Array) -> SurfaceTable:
    """Tables of a scene; ``vertex_near`` (v,) is the share of open air at each vertex of its meshes."""
    meshes, materials = scene.meshes, {name: row for row, name in enumerate(scene.world.materials)}
    vertices, faces, starts = [], [], np.cumsum([0, *(len(m.vertices) for m in meshes)])
    for mesh, start, end in zip(meshes, starts[:-1], starts[1:], strict=True):
        rows = np.array([materials[name] for name in mesh.materials], np.int32)[mesh.material]
        vertices.append(np.column_stack([mesh.normals, mesh.uv, vertex_near[start:end]]))
        faces.append(np.column_stack([mesh.faces + np.int32(start), rows]))
    axes = np.array([top.world_from_object[:3, :3] for top in scene.tops])
    return SurfaceTable(
        vertex=np.concatenate([*vertices, np.zeros((0, 6), np.float32)]).astype(np.float32),
        face=np.concatenate([*faces, np.zeros((0, 4), np.int32)]).astype(np.int32),
        face_repeat=np.concatenate([*(_metres_per_repeat(m) for m in meshes), np.zeros(0, np.float32)]),
        top_rotation=(axes / np.cbrt(np.linalg.det(axes))[:, None, None]).astype(np.float32),
        top_tint=np.array([top.tint for top in scene.tops], np.float32),
        top_base=np.array([top.world_from_object[2, 3] for top in scene.tops], np.float32),
    )


def _metres_per_repeat(mesh: Mesh) -> Float32Array:
    """Length [m] of one repeat of the texture on each face: the square root of its area over its area in uv."""
    corners, uv = mesh.vertices[mesh.faces].astype(np.float64), mesh.uv[mesh.faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1)
    s, t = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    area_uv = np.abs(s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0])
    return np.asarray(np.sqrt(area / np.maximum(area_uv, 1e-9)).clip(1e-3, 1e3), np.float32)


def snow_table(terrain: Terrain) -> SnowTable:
    """Table of a terrain, with ``on_top`` 0 where no snow lies."""
    deep = 0.0 if terrain.snow is None else float(np.quantile(terrain.snow, 0.9))
    return SnowTable(grid_of(hidden_share(terrain)), np.float32(min(deep / LOADS, 1.0)))
