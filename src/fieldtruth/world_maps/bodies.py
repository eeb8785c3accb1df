# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bodies of a world, and what they do to a robot: solid, flexible or passable.

Worlds have surfaces. Those of bodies are closed here, as a line must leave what it enters: the stem of a plant is a
tube that is open where it sprouts. Leaves and blades are sheets, which have no inside.
"""

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fieldtruth.core.arrays import Array, Float32Array, Mask
from fieldtruth.core.classes import Label
from fieldtruth.kernels.columns import CAP, FLEXIBLE, FOOT, HARD, PASSABLE, PLANT, SOLID, Copies, Faces
from fieldtruth.world.model import LOOSE, Mesh, World
from fieldtruth.world.stems import bends

PLANTS: Final = (Label.TRUNK, Label.TREETOP, Label.BUSH, Label.HIGH_GRASS)
"""Classes of plants."""
GROUNDS: Final = (Label.GROUND, Label.TRAIL, Label.ROCK)
"""Classes of objects that are ground to drive on, stones and rocks among them."""
_WELD: Final = 1e-5  # [m] within which vertices are one
_Rows = NDArray[np.int64]
_Bytes = NDArray[np.uint8]


def kinds_of(mesh: Mesh, label: _Bytes, is_leaf: Mask, thickness: Array) -> _Bytes:
    """Return what surfaces (n,) do to a robot that drives against them: SOLID, FLEXIBLE or PASSABLE.

    Leaves and blades let it pass, stems bend as ``world.stems.bends`` says, all else stops it.

    Args:
        mesh: with the surfaces.
        label: class ids.
        is_leaf: whether they are leaves or blades.
        thickness: [m] of the body, see ``thickness_of``; infinite for leaves.
    """
    flexible = np.isin(label, PLANTS) & bends(mesh, thickness)
    return np.where(is_leaf, PASSABLE, np.where(flexible, FLEXIBLE, SOLID)).astype(np.uint8)


def faces_of(world: World) -> Faces:
    """Faces of all meshes, in the order of ``World.meshes``; water is left out."""
    none = np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int64), np.zeros(0, np.uint8), np.zeros(0, np.uint8)
    parts = [_closed(world, mesh) for mesh in world.meshes.values()]
    vertices, corners, label, flags = zip(none, *parts, strict=True)
    first = np.cumsum([len(each) for each in vertices])
    return Faces(
        np.concatenate(vertices),
        np.concatenate([none[1], *(each + start for each, start in zip(corners[1:], first, strict=False))]),
        np.concatenate(label),
        np.concatenate(flags),
        first.astype(np.int64),
        np.cumsum([len(each) for each in corners]).astype(np.int64),
    )


def _closed(world: World, mesh: Mesh) -> tuple[Float32Array, _Rows, _Bytes, _Bytes]:
    """Vertices, faces, classes and flags of a mesh whose bodies are closed."""
    own = [world.materials[name] for name in mesh.materials]
    foliage = [each.translucency > 0 or each.label in (Label.TREETOP, Label.HIGH_GRASS) for each in own]
    leaf = np.array(foliage, np.bool_)[mesh.material] | mesh.passable
    label = np.array([each.label for each in own], np.uint8)[mesh.material]
    corners = _first_equal(np.rint(mesh.vertices / _WELD))[mesh.faces]
    kept = label != Label.WATER
    corners, leaf, label = corners[kept], leaf[kept], label[kept]
    body = np.flatnonzero(~leaf)
    tips, caps, joined = _caps(mesh.vertices.astype(np.float64), corners[body])
    vertices = np.concatenate([mesh.vertices, tips.astype(np.float32)])
    thickness = np.full(len(label), np.inf)
    thickness[body] = thickness_of(vertices.astype(np.float64), corners[body], caps, joined)
    kind = kinds_of(mesh, label, leaf, thickness)
    flags = kind + PLANT * np.isin(label, PLANTS) + HARD * (np.isin(label, GROUNDS) & ~leaf)
    flags += FOOT * ((label == Label.TRUNK) & (kind == SOLID))
    cap = body[joined]
    labels, all_flags = np.concatenate([label, label[cap]]), np.concatenate([flags, kind[cap] + CAP])
    return vertices, np.concatenate([corners, caps]), labels, all_flags.astype(np.uint8)


def _first_equal(rows: Float32Array) -> _Rows:
    """Index (n,) of the first of rows (n, 3) that equals each; NumPy's ``unique`` of rows takes twice as long."""
    order = np.lexsort(rows.T)  # of equal ones, the first comes first
    is_new = np.ones(len(rows), np.bool_)
    is_new[1:] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    first = np.empty(len(rows), np.int64)
    first[order] = order[is_new][np.cumsum(is_new) - 1]
    return first


def _connected(pairs: _Rows, count: int) -> _Rows:
    """Number (count,) of the piece that each vertex belongs to, of those that pairs (n, 2) connect."""
    matrix = coo_array((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), (max(1, count),) * 2)
    return np.asarray(connected_components(matrix, directed=False)[1], np.int64)


def _caps(vertices: Array, faces: _Rows) -> tuple[Array, _Rows, _Rows]:
    """Close the openings of surfaces: a cone from the rim of each to its middle.

    Returns:
        The tips (k, 3) of the cones, which follow the vertices; their faces (c, 3); the row of ``faces`` at each.
    """
    edges = np.concatenate([faces[:, (0, 1)], faces[:, (1, 2)], faces[:, (2, 0)]])
    low, high, count = edges.min(axis=1), edges.max(axis=1), max(1, len(vertices))
    both, row, edge = np.unique(low * count + high, return_index=True, return_inverse=True)
    rim = np.stack([both // count, both % count], axis=1)
    sign = np.where(edges[:, 0] < edges[:, 1], 1.0, -1.0)
    surplus = np.bincount(edge, sign, len(row)).astype(np.int64)  # 0 where faces meet
    rim = np.repeat(np.where((surplus > 0)[:, None], rim[:, ::-1], rim), np.abs(surplus), axis=0)
    joined = np.repeat(row % max(1, len(faces)), np.abs(surplus))
    _, loop = np.unique(_connected(rim, len(vertices))[rim[:, 0]], return_inverse=True)
    tips = np.stack([np.bincount(loop, vertices[rim[:, 0], k]) for k in range(3)], axis=-1) / np.bincount(loop)[:, None]
    return tips, np.column_stack([rim, len(vertices) + loop]), joined


def thickness_of(vertices: Array, faces: _Rows, caps: _Rows, joined: _Rows) -> Array:
    """Thickness [m] (f,) of the connected piece that each face belongs to: 4 V / A, of a long cylinder its diameter.

    V is the volume inside faces (f, 3) and caps (c, 3) of vertices (v, 3) [m], A the area of the faces; ``joined`` (c,)
    are the faces at the caps.
    """
    piece = _connected(np.concatenate([faces[:, :2], faces[:, 1:]]), len(vertices))[faces[:, 0]]
    every = np.concatenate([piece, piece[joined]])
    origin = np.zeros((len(vertices), 3))
    origin[piece] = vertices[faces[:, 0]]
    a, b, c = (vertices[np.concatenate([faces, caps])[:, k]] - origin[every] for k in range(3))
    volume = np.abs(np.bincount(every, np.einsum("ni,ni->n", a, np.cross(b, c)))) / 6
    area = np.bincount(piece, np.linalg.norm(np.cross(b - a, c - a), axis=1)[: len(faces)]) / 2
    return np.asarray(4 * volume[piece] / np.maximum(area[piece], 1e-12))


def copies_of(world: World) -> Iterator[Copies]:
    """Yield the objects, then each swarm but those that lie loose; poses of swarms are those of the world, no copy."""
    rows = {name: row for row, name in enumerate(world.meshes)}
    if world.instances:
        numbers = np.array([(rows[each.mesh], each.object_id) for each in world.instances], np.int64)
        poses = np.array([each.world_from_object for each in world.instances])
        yield Copies(poses, numbers[:, 0].copy(), numbers[:, 1].astype(np.uint32))
    for swarm in (each for each in world.swarms if each.kind not in LOOSE and len(each.mesh)):
        own = np.array([rows[name] for name in swarm.meshes], np.int64)[swarm.mesh]
        poses = np.ascontiguousarray(swarm.world_from_object, np.float64)
        yield Copies(poses, own, np.full(len(own), swarm.object_id, np.uint32))


def boxes_of(faces: Faces, groups: Sequence[Copies]) -> list[tuple[Array, Array]]:
    """Lowest and highest x, y [m], (n, 2) each, of boxes around the copies of meshes in each group."""
    ends = zip(faces.first_vertex[:-1].tolist(), faces.first_vertex[1:].tolist(), strict=True)
    own = [faces.vertices[a:b] if b > a else np.zeros((1, 3), np.float32) for a, b in ends]
    low, high = (np.array([extreme(each, axis=0) for each in own], np.float64) for extreme in (np.min, np.max))
    boxes = []
    for pose, mesh, _ in groups:
        centre = np.einsum("nij,nj->ni", pose[:, :2, :3], ((low + high) / 2)[mesh]) + pose[:, :2, 3]
        reach = np.einsum("nij,nj->ni", np.abs(pose[:, :2, :3]), ((high - low) / 2)[mesh])
        boxes.append((centre - reach, centre + reach))
    return boxes
