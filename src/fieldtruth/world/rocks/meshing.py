# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Surface of a rock: normals with creases, and box-projected texture coordinates."""

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Index


def corner_normals(vertices: Array, faces: Index, crease_deg: float) -> Array:
    """Unit normals (f, 3, 3) of each face's corners: the mean over adjacent faces within the crease angle."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    flat = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    corner = faces.ravel()
    order = np.argsort(corner, kind="stable")
    start = np.searchsorted(corner[order], np.arange(len(vertices)))
    count = np.diff([*start, len(corner)])
    result = np.zeros((len(corner), 3))
    own = flat[np.arange(len(corner)) // 3]
    for k in range(int(count.max())):
        has = count[corner] > k
        around = order[np.minimum(start[corner] + k, len(corner) - 1)] // 3
        joined = has & ((flat[around] * own).sum(1) > np.cos(np.radians(crease_deg)))
        result += across[around] * joined[:, None]
    lengths = np.linalg.norm(result, axis=1, keepdims=True)
    return np.asarray(np.where(lengths > 1e-12, result / np.maximum(lengths, 1e-12), own).reshape(-1, 3, 3))


def box_uv(vertices: Array, faces: Index, smooth: Array, shift: Array) -> tuple[Array, Index]:
    """Texture coordinates [m] (f, 3, 2) projected along the nearest axis of each face, and that axis (f,) 0 to 2.

    Faces are inclined by at most 55 deg to the projection, so the texture is stretched by less than 1.8. The normals
    ``smooth`` (f, 3) choose the axis, so that a rough surface is not patchy; ``shift`` (3, 2) [m] is per axis.
    """
    axis = np.argmax(np.abs(smooth), axis=1)
    u = np.array([1, 0, 0])[axis]
    v = np.array([2, 2, 1])[axis]
    corners = vertices[faces]
    rows = np.arange(len(faces))[:, None]
    uv = np.stack([corners[rows, [[0, 1, 2]], u[:, None]], corners[rows, [[0, 1, 2]], v[:, None]]], axis=-1)
    return uv + shift[axis][:, None], axis


def welded(
    vertices: Array, faces: Index, normals: Array, uv: Array, axis: Index
) -> tuple[Array, Array, Array, NDArray[np.int32]]:
    """Vertices, normals, uv and faces with corners merged that share position, normal and texture axis."""
    key = np.column_stack([faces.ravel(), np.repeat(axis, 3), np.round(normals.reshape(-1, 3) * 1000).astype(np.int64)])
    _, first, owner = np.unique(key, axis=0, return_index=True, return_inverse=True)
    triangles = owner.reshape(-1, 3).astype(np.int32)
    return vertices[faces.ravel()[first]], normals.reshape(-1, 3)[first], uv.reshape(-1, 2)[first], triangles
