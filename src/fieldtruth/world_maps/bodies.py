# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bodies of a world, and what they do to a robot: solid, flexible or passable.

Worlds have surfaces. Those of bodies are closed here, as a line must leave what it enters: the stem of a plant is a
tube that is open where it sprouts. Leaves and blades are sheets, which have no inside.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.classes import Label
from fieldtruth.kernels.columns import FLEXIBLE, FOOT, HARD, PASSABLE, PLANT, SOLID, Copies, Faces
from fieldtruth.world.model import LOOSE, Mesh, World

PLANTS: Final = (Label.TRUNK, Label.TREETOP, Label.BUSH, Label.HIGH_GRASS)
"""Classes of plants."""
GROUNDS: Final = (Label.GROUND, Label.TRAIL, Label.ROCK)
"""Classes of objects that are ground to drive on, stones and rocks among them."""
THIN: Final = 0.02
"""Thickness [m] of a stem below which a robot bends it."""
_WELD: Final = 1e-5  # [m] within which vertices are one
_Faces = NDArray[np.int64]


def kinds_of(label: NDArray[np.uint8], is_leaf: Mask, thickness: Array) -> NDArray[np.uint8]:
    """Return what surfaces (n,) do to a robot that drives against them: SOLID, FLEXIBLE or PASSABLE.

    Leaves and blades let it pass, stems thinner than ``THIN`` bend, all else stops it. This is the one place that says
    so, until plants have a stiffness.

    Args:
        label: class ids.
        is_leaf: whether they are leaves or blades, see ``leaves_of``.
        thickness: [m] of the body, see ``thickness_of``.
    """
    flexible = np.isin(label, PLANTS) & (thickness < THIN)
    return np.where(is_leaf, PASSABLE, np.where(flexible, FLEXIBLE, SOLID)).astype(np.uint8)


def leaves_of(world: World, mesh: Mesh) -> Mask:
    """Faces (f,) that are leaves, blades or petals: classes of foliage, and materials that light shines through."""
    materials = [world.materials[name] for name in mesh.materials]
    leaf = [m.translucency > 0 or m.label in (Label.TREETOP, Label.HIGH_GRASS) for m in materials]
    return np.array(leaf, np.bool_)[mesh.material] | mesh.passable


def faces_of(world: World) -> Faces:
    """Faces of all meshes, in the order of ``World.meshes``; water is left out."""
    parts = [_faces_of(world, mesh) for mesh in world.meshes.values()]
    vertices, corners, label, flags = (
        [part[k] for part in parts] or [empty]
        for k, empty in enumerate((np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int64), *2 * [np.zeros(0, "u1")]))
    )
    first = np.cumsum([0, *(len(each) for each in vertices)])
    return Faces(
        vertices=np.concatenate(vertices),
        corners=np.concatenate([each + start for each, start in zip(corners, first, strict=False)]),
        label=np.concatenate(label),
        flags=np.concatenate(flags),
        first_vertex=first.astype(np.int64),
        first_face=np.cumsum([0, *(len(each) for each in corners)]).astype(np.int64),
    )


def _faces_of(world: World, mesh: Mesh) -> tuple[NDArray[np.float32], _Faces, NDArray[np.uint8], NDArray[np.uint8]]:
    """Vertices, faces, classes and flags of a mesh, closed."""
    label = np.array([world.materials[name].label for name in mesh.materials], np.uint8)[mesh.material]
    leaf = leaves_of(world, mesh)
    is_body = ~leaf & (label != Label.WATER)
    _, first, same = np.unique(np.rint(mesh.vertices / _WELD), axis=0, return_index=True, return_inverse=True)
    welded = first[same.reshape(-1)][mesh.faces.astype(np.int64)]
    body = welded[is_body]
    stem = _pieces(body)
    points, caps, owner = _caps(mesh.vertices.astype(np.float64), body)
    thickness = np.full(len(mesh.faces), np.inf)
    vertices = np.concatenate([mesh.vertices, points.astype(np.float32)])
    thickness[is_body] = thickness_of(vertices.astype(np.float64), body, caps, stem, stem[owner])
    kind = kinds_of(label, leaf, thickness)
    flags = kind | np.where(np.isin(label, PLANTS), PLANT, 0) | np.where(np.isin(label, GROUNDS), HARD, 0)
    flags |= np.where((label == Label.TRUNK) & (kind == SOLID), FOOT, 0)
    kept, own = label != Label.WATER, np.flatnonzero(is_body)[owner]
    return (
        vertices,
        np.concatenate([welded[kept], caps]),
        np.concatenate([label[kept], label[own]]),
        np.concatenate([flags[kept], kind[own]]).astype(np.uint8),
    )


def _pieces(faces: _Faces) -> NDArray[np.int64]:
    """Number (f,) of the connected piece that each face belongs to, in a body of shared vertices."""
    if not len(faces):
        return np.zeros(0, np.int64)
    ends = np.concatenate([faces[:, (0, 1)], faces[:, (1, 2)]]).T
    count = int(faces.max()) + 1
    _, piece = connected_components(coo_array((np.ones(ends.shape[1], np.int8), tuple(ends)), (count, count)), False)
    return np.asarray(piece[faces[:, 0]], np.int64)


def _caps(vertices: Array, faces: _Faces) -> tuple[Array, _Faces, NDArray[np.intp]]:
    """Close the openings of surfaces: a cone from each, to the middle of its rim.

    Returns:
        The tips (k, 3) of the cones, which follow the vertices; their faces (c, 3); the face to which each is joined.
    """
    edges = np.concatenate([faces[:, (0, 1)], faces[:, (1, 2)], faces[:, (2, 0)]])
    face = np.tile(np.arange(len(faces)), 3)
    forward = edges[:, 0] < edges[:, 1]
    _, row, net = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_inverse=True)
    surplus = np.bincount(net.reshape(-1), np.where(forward, 1.0, -1.0), len(row)).astype(np.int64)  # 0: closed
    rim = np.sort(edges[row], axis=1)
    rim = np.where((surplus > 0)[:, None], rim, rim[:, ::-1])
    times = np.abs(surplus)
    rim, owner = np.repeat(rim, times, axis=0), np.repeat(face[row], times)
    if not len(rim):
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64), owner
    count = len(vertices)
    _, loop = connected_components(coo_array((np.ones(len(rim), np.int8), tuple(rim.T)), (count, count)), False)
    _, loop = np.unique(loop[rim[:, 0]], return_inverse=True)
    number = np.bincount(loop)
    tips = np.stack([np.bincount(loop, vertices[rim].mean(axis=1)[:, k]) / number for k in range(3)], axis=-1)
    return tips, np.column_stack([rim[:, ::-1], count + loop]), owner


def thickness_of(
    vertices: Array, faces: _Faces, caps: _Faces, piece: NDArray[np.int64], cap_piece: NDArray[np.int64]
) -> Array:
    """Thickness [m] (f,) of the piece that each face belongs to: 4 V / A, of a long cylinder its diameter.

    V is the volume inside faces (f, 3) and caps (c, 3) of vertices (v, 3) [m], A the area of the faces; ``piece`` (f,)
    and ``cap_piece`` (c,) number the pieces.
    """
    if not len(faces):
        return np.zeros(0)
    numbers, row = np.unique(piece, return_inverse=True)
    origin = np.zeros((int(numbers[-1]) + 1, 3))
    origin[piece] = vertices[faces[:, 0]]
    a, b, c = (
        vertices[np.concatenate([faces, caps])[:, k]] - origin[np.concatenate([piece, cap_piece])] for k in (0, 1, 2)
    )
    six = np.einsum("ni,ni->n", a, np.cross(b, c))
    size = len(origin)
    volume = np.abs(np.bincount(np.concatenate([piece, cap_piece]), six, size)) / 6
    across = np.cross(b - a, c - a)[: len(faces)]
    area = np.bincount(piece, np.linalg.norm(across, axis=1) / 2, size)
    return np.asarray((4 * volume / np.maximum(area, 1e-12))[numbers][row])


def copies_of(world: World) -> Iterator[Copies]:
    """Yield the objects, then each swarm but those that lie loose; their poses are those of the world, not a copy."""
    rows = {name: row for row, name in enumerate(world.meshes)}
    if world.instances:
        yield Copies(
            np.array([each.world_from_object for each in world.instances]),
            np.array([rows[each.mesh] for each in world.instances], np.int64),
            np.array([each.object_id for each in world.instances], np.uint32),
        )
    for swarm in (each for each in world.swarms if each.kind not in LOOSE and len(each.mesh)):
        own = np.array([rows[name] for name in swarm.meshes], np.int64)
        poses = np.ascontiguousarray(swarm.world_from_object, np.float64)
        yield Copies(poses, own[swarm.mesh], np.array([swarm.object_id], np.uint32))


def boxes_of(faces: Faces, copies: Copies) -> tuple[Array, Array]:
    """Lowest and highest x, y [m], (n, 2) each, of boxes around copies of meshes; turned over where one is empty."""
    ends = np.stack([faces.first_vertex[:-1], faces.first_vertex[1:]], axis=-1).tolist()
    boxes = [(faces.vertices[a:b].min(axis=0), faces.vertices[a:b].max(axis=0)) if b > a else None for a, b in ends]
    middle = np.array([np.zeros(3) if box is None else (box[0] + box[1]) / 2 for box in boxes], np.float64)
    half = np.array([np.full(3, -1e9) if box is None else (box[1] - box[0]) / 2 for box in boxes], np.float64)
    rotation, own = copies.pose[:, :2, :3], copies.mesh
    centre = np.einsum("nij,nj->ni", rotation, middle[own]) + copies.pose[:, :2, 3]
    reach = np.einsum("nij,nj->ni", np.abs(rotation), half[own])
    return centre - reach, centre + reach
