# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Triangles of files are made sound: which sides are outside, which edges are sharp, where nothing closes a mesh.

Vertices at one position are one point, whatever their normals and uv. Triangles that share an edge of two run around it
in opposite directions where both show the same side. Which of them to turn is a colouring of a graph in which each
triangle is two nodes, as it is and turned: nodes of neighbours that fit are joined, and one of the two connected parts
in which a piece of the mesh then lies twice is chosen (it lies in one part, joined with itself, where a surface has one
side only, as Moebius' strip).
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.world.solids import CREASE_DEG

_CLOSE: Final = 1e-6
"""Distance of one point, relative to the size of the mesh."""
_Rows = NDArray[np.int64]


class Sound(NamedTuple):
    """Triangles that were turned, edges that one triangle alone has, and what each corner and vertex belongs to."""

    faces: _Rows  # (m, 3)
    turned: int
    open_edges: int
    normals: Array  # (m, 3, 3), of unit length
    group: _Rows  # (m, 3), the smooth surface of each corner about its point
    point: _Rows  # (n,), number of the point of each vertex


def solid_faces(vertices: Array, faces: _Rows) -> Mask:
    """Mask of the triangles (m,) that have an area."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    twice = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.asarray(twice > 1e-12 * np.ptp(vertices, axis=0).max() ** 2)


def row_keys(rows: Array | _Rows) -> _Rows:
    """Return one number (n,) for each row (n, k) of whole numbers from 0 on; NumPy sorts rows ten times as slowly."""
    key = np.zeros(len(rows), np.int64)
    for column in rows.astype(np.int64).T:
        key = key * (column.max(initial=0) + 1) + column
    return key


def made_sound(vertices: Array, faces: _Rows) -> Sound:
    """Turn triangles so that all of a piece show one side, and closed pieces their outside; normals without creases."""
    size = max(float(np.ptp(vertices, axis=0).max()), 1e-12)
    _, point = np.unique(row_keys(np.rint((vertices - vertices.min(axis=0)) / (_CLOSE * size))), return_inverse=True)
    one, other, same_way, lonely, crowded = _neighbours(point[faces])
    turn = _turned(vertices, faces, (one, other, same_way), lonely, crowded)
    faces = np.where(turn[:, None], faces[:, ::-1], faces)
    normals, group = _corner_normals(vertices, faces, point)
    return Sound(faces, int(turn.sum()), int(lonely.sum()), normals, group, point)


def _neighbours(faces: _Rows) -> tuple[_Rows, _Rows, Mask, _Rows, _Rows]:
    """Pairs of triangles at edges of two and whether both run along it in one direction; other edges by triangle.

    These are open edges, of one triangle, and those of more than two, where bodies touch.
    """
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    forward = edges[:, 0] < edges[:, 1]
    _, key, count = np.unique(row_keys(np.sort(edges, axis=1)), return_inverse=True, return_counts=True)
    order = np.argsort(key, kind="stable")
    pairs = order[(count[key] == 2)[order]].reshape(-1, 2)
    face = np.repeat(np.arange(len(faces)), 3)
    lonely, crowded = (np.bincount(face[chosen], minlength=len(faces)) for chosen in (count[key] == 1, count[key] > 2))
    return face[pairs[:, 0]], face[pairs[:, 1]], forward[pairs[:, 0]] == forward[pairs[:, 1]], lonely, crowded


def _turned(vertices: Array, faces: _Rows, pairs: tuple[_Rows, _Rows, Mask], lonely: _Rows, crowded: _Rows) -> Mask:
    """Mask of the triangles (m,) to turn.

    A closed piece shows its outside, pieces that close only together do so together; in an open one most stay.
    """
    one, other, same_way = pairs
    n = len(faces)
    rows = np.concatenate([one, one + n])
    columns = np.concatenate([np.where(same_way, other + n, other), np.where(same_way, other, other + n)])
    _, part = connected_components(coo_array((np.ones(len(rows)), (rows, columns)), shape=(2 * n, 2 * n)), False)
    as_is, turned = part[:n], part[n:]
    key = np.minimum(as_is, turned)  # of a piece
    sign = np.where(as_is == key, 1.0, -1.0)
    flip = np.bincount(key, sign) < 0
    volume = np.bincount(key, sign * np.linalg.det(vertices[faces] - vertices.mean(axis=0)))
    has_none = np.bincount(key, lonely) == 0
    touches = has_none & (np.bincount(key, crowded) > 0)
    flip[touches] ^= float(volume[touches] @ np.where(flip[touches], -1.0, 1.0)) < 0
    alone = has_none & ~touches
    flip[alone] = volume[alone] < 0
    return np.asarray((as_is != turned) & ((as_is == key) == flip[key]))


def _corner_normals(vertices: Array, faces: _Rows, point: _Rows) -> tuple[Array, _Rows]:
    """Mean normal, weighted by area, over the triangles around a corner up to the next crease, and their number."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    across = np.cross(b - a, c - a)
    unit = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    one, other, same_way, *_ = _neighbours(point[faces])
    smooth = ~same_way & (np.einsum("ij,ij->i", unit[one], unit[other]) > np.cos(np.radians(CREASE_DEG)))
    one, other = one[smooth], other[smooth]
    own, theirs = point[faces[one]], point[faces[other]]
    pair, i, j = np.nonzero(own[:, :, None] == theirs[:, None, :])
    count = 3 * len(faces)
    joined = coo_array((np.ones(len(pair)), (3 * one[pair] + i, 3 * other[pair] + j)), shape=(count, count))
    number, group = connected_components(joined, directed=False)
    total = np.stack([np.bincount(group, np.repeat(across[:, k], 3), number) for k in range(3)], axis=1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    total = np.where(length > 0, total / np.where(length > 0, length, 1.0), (0.0, 0.0, 1.0))
    return np.asarray(total[group].reshape(-1, 3, 3), np.float64), group.reshape(-1, 3).astype(np.int64)
