# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""How the meshes' surfaces lie: tables by vertex, face and thing, packed so that a hit touches little memory."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.sense.scene import Scene
from fieldtruth.world.model import Mesh

NORMAL_X, NORMAL_Y, NORMAL_Z, TEX_U, TEX_V, OPEN_SKY = range(6)
FIRST, SECOND, THIRD, MATERIAL = range(4)


class SurfaceTable(NamedTuple):
    """All meshes, one behind the other. A face of a mesh stands at ``HitTable.mesh_face`` plus its number."""

    vertex: NDArray[np.float32]  # (v, 6) unit normal in the object's frame, uv in repeats, share of open sky
    face: NDArray[np.int32]  # (f, 4) rows of its three vertices and of its material, in ``World.materials``' order
    face_repeat: NDArray[np.float32]  # (f,) [m] that one repeat of the texture covers
    top_rotation: NDArray[np.float32]  # (tops, 3, 3) world from object, without scale
    top_tint: NDArray[np.float32]  # (tops, 3)


def surface_table(scene: Scene, vertex_sky: NDArray[np.float32]) -> SurfaceTable:
    """Tables of a scene; ``vertex_sky`` (v,) is the share of open sky at each vertex of its meshes."""
    meshes, materials = scene.meshes, {name: row for row, name in enumerate(scene.world.materials)}
    vertices, faces, starts = [], [], np.cumsum([0, *(len(m.vertices) for m in meshes)])
    for mesh, start, end in zip(meshes, starts[:-1], starts[1:], strict=True):
        rows = np.array([materials[name] for name in mesh.materials], np.int32)[mesh.material]
        vertices.append(np.column_stack([mesh.normals, mesh.uv, vertex_sky[start:end]]))
        faces.append(np.column_stack([mesh.faces + np.int32(start), rows]))
    turned = np.array([pose[:3, :3] for _, _, pose in scene.tops])
    return SurfaceTable(
        vertex=np.concatenate([*vertices, np.zeros((0, 6), np.float32)]).astype(np.float32),
        face=np.concatenate([*faces, np.zeros((0, 4), np.int32)]).astype(np.int32),
        face_repeat=np.concatenate([*(_metres_per_repeat(m) for m in meshes), np.zeros(0, np.float32)]),
        top_rotation=(turned / np.cbrt(np.linalg.det(turned))[:, None, None]).astype(np.float32),
        top_tint=np.array(scene.tints, np.float32),
    )


def _metres_per_repeat(mesh: Mesh) -> NDArray[np.float32]:
    """Length [m] of one repeat of the texture on each face: the square root of area over area in uv."""
    corners, uv = mesh.vertices[mesh.faces].astype(np.float64), mesh.uv[mesh.faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1)
    s, t = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    area_uv = np.abs(s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0])
    return np.asarray(np.sqrt(area / np.maximum(area_uv, 1e-9)).clip(1e-3, 1e3), np.float32)
