# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The land beyond a world's edge: a ring of rising meadow that hides where the world ends. Class ground, no objects."""

import numpy as np
from numpy.typing import NDArray

from fieldtruth.world.model import Heightfield, Mesh

RINGS = (0.0, 1.0, 2.5, 5.0, 9.0, 15.0, 24.0, 38.0, 60.0, 95.0, 150.0, 240.0, 380.0, 600.0, 950.0)  # [m] from the edge
REPEAT = 40.0  # [m] that the meadow's texture covers


def make_backdrop(field: Heightfield, size: tuple[float, float], material: str, rng: np.random.Generator) -> Mesh:
    """Ring of land around a heightfield, fastened to its edge node by node, with low hills towards the horizon."""
    nx, ny = field.heights.shape
    edge = np.concatenate(
        [
            [(i, 0) for i in range(nx - 1)],
            [(nx - 1, j) for j in range(ny - 1)],
            [(i, ny - 1) for i in range(nx - 1, 0, -1)],
            [(0, j) for j in range(ny - 1, 0, -1)],
        ]
    )
    x0 = field.x0 + field.spacing * edge[:, 0]
    y0 = field.y0 + field.spacing * edge[:, 1]
    h0 = field.heights[edge[:, 0], edge[:, 1]].astype(np.float64)
    angle = np.arctan2(y0 / size[1], x0 / size[0])
    hills = sum((rng.normal() * np.cos(k * angle) + rng.normal() * np.sin(k * angle)) / k**0.7 for k in range(2, 18))
    far = np.hypot(x0, y0)
    rows = []
    for distance in RINGS:
        reach = 1.0 + distance / far
        fade = np.exp(-distance / 30.0)
        rise = 0.010 * distance + np.maximum(hills + 1.2, 0.0) * 9.0 * (distance / RINGS[-1]) ** 0.8
        rows.append(np.stack([x0 * reach, y0 * reach, h0 * fade + rise * (1.0 - fade)], axis=-1))
    vertices = np.stack(rows).astype(np.float32)  # (rings, n, 3)
    count = len(x0)
    k = np.arange(count)
    faces = []
    for ring in range(len(RINGS) - 1):
        a, b = ring * count + k, ring * count + (k + 1) % count
        faces += [np.stack([a, a + count, b + count], axis=-1), np.stack([a, b + count, b], axis=-1)]
    flat = vertices.reshape(-1, 3)
    triangles = np.concatenate(faces).astype(np.int32)
    return Mesh(
        name="backdrop",
        vertices=flat,
        normals=_vertex_normals(flat, triangles),
        uv=(flat[:, :2] / REPEAT).astype(np.float32),
        faces=triangles,
        material=np.zeros(len(triangles), np.int32),
        materials=(material,),
    )


def _vertex_normals(vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> NDArray[np.float32]:
    corners = vertices[triangles].astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across *= np.sign(across[:, 2:])
    normals = np.zeros_like(vertices, np.float64)
    for corner in range(3):
        np.add.at(normals, triangles[:, corner], across)
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True), np.float32)
