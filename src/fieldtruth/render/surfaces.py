# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Normals, texture coordinates, materials, tints, snow and wires of a scene's surfaces, as tables that kernels read."""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.light import (
    AirTable,
    LightTable,
    MaterialTable,
    RobotTable,
    Shading,
    SnowTable,
    SurfaceTable,
    WireTable,
)
from fieldtruth.kernels.water import RIPPLES
from fieldtruth.sense.scene import Scene, grid_of
from fieldtruth.world.model import Mesh, Terrain
from fieldtruth.world.seasons.change import hidden_share

LOADS: Final = 0.05
"""Depth [m] in the open from which all that faces up is white."""


def surface_table(scene: Scene, vertex_near: Float32Array) -> SurfaceTable:
    """Tables of a scene; ``vertex_near`` (v,) is the share of open air at each vertex of its meshes."""
    meshes, materials = scene.meshes, {name: row for row, name in enumerate(scene.world.materials)}
    vertex = np.empty((sum(len(mesh.vertices) for mesh in meshes), 6), np.float32)
    face = np.empty((sum(len(mesh.faces) for mesh in meshes), 4), np.int32)
    first, faces = 0, 0
    for mesh in meshes:  # written in place: copies of these tables would be the most memory that a run needs
        own, rows = slice(first, first + len(mesh.vertices)), slice(faces, faces + len(mesh.faces))
        vertex[own, :3], vertex[own, 3:5], vertex[own, 5] = mesh.normals, mesh.uv, vertex_near[own]
        face[rows, :3] = mesh.faces + np.int32(first)
        face[rows, 3] = np.array([materials[name] for name in mesh.materials], np.int32)[mesh.material]
        first, faces = own.stop, rows.stop
    axes = np.array([top.world_from_object[:3, :3] for top in scene.top_levels])
    return SurfaceTable(
        vertex=vertex,
        face=face,
        face_repeat=np.concatenate([*(_metres_per_repeat(m) for m in meshes), np.zeros(0, np.float32)]),
        top_rotation=(axes / np.cbrt(np.linalg.det(axes))[:, None, None]).astype(np.float32),
        top_tint=np.array([top.tint for top in scene.top_levels], np.float32),
        top_base=np.array([top.world_from_object[2, 3] for top in scene.top_levels], np.float32),
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


def wire_table(scene: Scene, materials: MaterialTable) -> WireTable:
    """Wires of a scene in the world frame, as photographs draw them."""
    rows = {name: row for row, name in enumerate(scene.world.materials)}
    radius = np.zeros(len(scene.top_levels), np.float32)
    chains, own, albedo = list[Array](), list[int](), list[Array]()
    for top, (mesh, pose, _, tint) in enumerate(scene.top_levels):
        if mesh is None or mesh.axis is None:
            continue
        scale = float(np.cbrt(np.linalg.det(pose[:3, :3])))
        radius[top] = scale * mesh.axis[:, 3].mean()
        chains.append(mesh.axis[:, :3].astype(np.float64) @ pose[:3, :3].T + pose[:3, 3])
        material = rows[mesh.materials[0]]
        albedo.append(materials.atlas.mean[materials.texture[material]] * materials.tint[material] * np.array(tint))
        own.append(top)
    tangents = [np.gradient(chain, axis=0) for chain in chains]
    middles = [(chain.min(axis=0) + chain.max(axis=0)) / 2 for chain in chains]
    balls = [[*m, np.linalg.norm(chain - m, axis=1).max()] for m, chain in zip(middles, chains, strict=True)]
    return WireTable(
        start=np.concatenate([*(chain[:-1] for chain in chains), np.zeros((0, 3))]),
        end=np.concatenate([*(chain[1:] for chain in chains), np.zeros((0, 3))]),
        tangent=np.concatenate([*(np.stack([t[:-1], t[1:]], axis=1) for t in tangents), np.zeros((0, 2, 3))]),
        first=np.cumsum([0, *(len(chain) - 1 for chain in chains)]).astype(np.int32),
        ball=np.array(balls).reshape(-1, 4),
        top=np.array(own, np.int32),
        albedo=np.array(albedo, np.float32).reshape(-1, 3),
        radius=radius,
    )


def shading_of(scene: Scene, light: LightTable, materials: MaterialTable, air: AirTable) -> Shading:
    """Tables of a scene for shading, without the second rays of water, and with an exposure of 1."""
    snow = snow_table(scene.world.terrain)
    return Shading(
        scene=scene.rays.alone,
        hits=scene.hits,
        surfaces=surface_table(scene, light.vertex_near),
        materials=materials,
        light=light,
        wires=wire_table(scene, materials),
        has_water=False,
        exposure=np.float32(1.0),
        air=air,
        snow=snow,
        has_snow=bool(snow.on_top > 0),
        robot=RobotTable(np.zeros((0, 7)), np.eye(4), np.zeros(4), np.zeros((0, 3))),
        ripples=RIPPLES,
    )
