# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Wires of a scene in the world frame, as photographs draw them."""

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.kernels.light import MaterialTable, WireTable
from fieldtruth.sense.scene import Scene


def wire_table(scene: Scene, materials: MaterialTable) -> WireTable:
    """Wires of a scene in the world frame."""
    rows = {name: row for row, name in enumerate(scene.world.materials)}
    radius = np.zeros(len(scene.tops), np.float32)
    chains, tops, albedo = list[Array](), list[int](), list[Array]()
    for top, (mesh, pose, _, tint) in enumerate(scene.tops):
        if mesh is None or mesh.axis is None:
            continue
        scale = float(np.cbrt(np.linalg.det(pose[:3, :3])))
        radius[top] = scale * mesh.axis[:, 3].mean()
        chains.append(mesh.axis[:, :3].astype(np.float64) @ pose[:3, :3].T + pose[:3, 3])
        material = rows[mesh.materials[0]]
        albedo.append(materials.atlas.mean[materials.texture[material]] * materials.tint[material] * np.array(tint))
        tops.append(top)
    tangents = [np.gradient(chain, axis=0) for chain in chains]
    middles = [(chain.min(axis=0) + chain.max(axis=0)) / 2 for chain in chains]
    balls = [[*m, np.linalg.norm(chain - m, axis=1).max()] for m, chain in zip(middles, chains, strict=True)]
    return WireTable(
        start=np.concatenate([*(chain[:-1] for chain in chains), np.zeros((0, 3))]),
        end=np.concatenate([*(chain[1:] for chain in chains), np.zeros((0, 3))]),
        tangent=np.concatenate([*(np.stack([t[:-1], t[1:]], axis=1) for t in tangents), np.zeros((0, 2, 3))]),
        first=np.cumsum([0, *(len(chain) - 1 for chain in chains)]).astype(np.int32),
        ball=np.array(balls).reshape(-1, 4),
        top=np.array(tops, np.int32),
        albedo=np.array(albedo, np.float32).reshape(-1, 3),
        radius=radius,
    )
