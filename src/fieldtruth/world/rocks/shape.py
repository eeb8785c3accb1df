# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The body of a rock: a block cut by fracture planes, with worn edges.

A body is star-shaped: it has one radius per direction. Cut by planes with normals n_k at distances d_k, its radius in
direction u is 1 / max(n_k . u / d_k). Erosion rounds edges and corners: a p-norm replaces the maximum, close to it for
a large p (flat facets of freshly broken rock) and a smooth ball for a small one.
"""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Index

_SNAP: Final = 0.4
"""Distance, in sides of a triangle, within which vertices move onto an edge, so that edges are not jagged."""


def geodesic(frequency: int) -> tuple[Array, Index]:
    """Unit vertices (v, 3) and outward faces (20 * frequency**2, 3) of a subdivided icosahedron."""
    golden = (1 + 5**0.5) / 2
    ring = [(0.0, a, b) for a in (-1.0, 1.0) for b in (-golden, golden)]
    corners = np.array([np.roll(p, k) for k in range(3) for p in ring])
    apart = np.linalg.norm(corners[:, None] - corners, axis=-1)
    faces = np.array(
        [
            (a, b, c) if np.linalg.det(corners[[a, b, c]]) > 0 else (a, c, b)
            for a in range(12)
            for b in range(a)
            for c in range(b)
            if max(apart[a, b], apart[b, c], apart[a, c]) < 2.01
        ]
    )
    steps = [(i, j) for i in range(frequency + 1) for j in range(frequency + 1 - i)]
    number = {step: k for k, step in enumerate(steps)}
    shares = np.array([(frequency - i - j, i, j) for i, j in steps]) / frequency
    cells = [(number[i, j], number[i + 1, j], number[i, j + 1]) for i, j in steps if i + j < frequency]
    cells += [(number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]) for i, j in steps if i + j < frequency - 1]
    points = np.einsum("sk,fkd->fsd", shares, corners[faces]).reshape(-1, 3)
    triangles = (np.arange(20)[:, None, None] * len(steps) + np.array(cells)).reshape(-1, 3)
    _, first, owner = np.unique(np.round(points, 6), axis=0, return_index=True, return_inverse=True)
    unique = points[first]
    return unique / np.linalg.norm(unique, axis=1, keepdims=True), owner.ravel()[triangles]


def fracture_planes(rng: np.random.Generator, count: int, joints: float) -> Array:
    """Planes (k, 3) as n / d: random cuts and, with ``joints`` (0 to 1), three orthogonal families.

    Massive rock breaks along joints into blocks (Hencher, Practical Rock Mechanics, 2015): pairs of parallel planes,
    here the more oblique the smaller ``joints`` is; the random cuts remove the corners.
    """
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, k * np.pi * (3 - 5**0.5)
    around = np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=-1)
    around += rng.normal(0, 0.28, around.shape)
    cuts = around / np.linalg.norm(around, axis=1, keepdims=True)
    distance = rng.uniform(0.82, 1.12, count) + 0.22 * joints
    if joints > 0:
        axes = np.concatenate([np.eye(3), -np.eye(3)]) + rng.normal(0, 0.32 - 0.22 * joints, (6, 3))
        cuts = np.concatenate([cuts, axes / np.linalg.norm(axes, axis=1, keepdims=True)])
        distance = np.concatenate([distance, rng.uniform(0.5 + 0.25 * joints, 0.97, 6) / max(joints, 0.3) ** 0.2])
    return np.asarray(cuts / distance[:, None])


def worn_radius(directions: Array, planes: Array, sharpness: float) -> Array:
    """Radius (v,) of the body along unit ``directions`` (v, 3); ``sharpness`` is the p of the norm."""
    inverse = np.maximum(directions @ planes.T, 0)
    top = inverse.max(axis=1)
    return np.asarray(1 / (top * ((inverse / top[:, None]) ** sharpness).sum(axis=1) ** (1 / sharpness)))


def broken(directions: Array, radius: Array, count: int, rng: np.random.Generator) -> Array:
    """Radius (v,) after ``count`` pieces broke off: each leaves a flat face that ends at a ledge inside the body."""
    for _ in range(count):
        normal, along = (v / np.linalg.norm(v) for v in rng.normal(0, 1, (2, 3)))
        faced = directions @ normal
        distance = rng.uniform(0.62, 0.88) * float((radius * faced).max())
        cut = distance / np.maximum(faced, 0.05)
        share = np.clip((directions @ along - rng.uniform(-0.2, 0.35)) / 0.1 + 0.5, 0.0, 1.0)
        radius = radius - share * np.maximum(radius - cut, 0.0)
    return radius


def snapped(directions: Array, planes: Array, side: float) -> Array:
    """Directions moved onto edges between facets that are nearer than ``_SNAP`` times a triangle's ``side`` [rad]."""
    moved = directions
    for _ in range(3):
        inverse = np.maximum(moved @ planes.T, 1e-9)
        order = np.argsort(-inverse, axis=1)[:, :2]
        first, second = planes[order[:, 0]], planes[order[:, 1]]
        rows = np.arange(len(moved))
        gap = inverse[rows, order[:, 0]] - inverse[rows, order[:, 1]]
        uphill = first - second
        uphill = uphill - (uphill * moved).sum(1, keepdims=True) * moved
        step = -gap[:, None] * uphill / np.maximum((uphill**2).sum(1, keepdims=True), 1e-9)
        near = np.linalg.norm(moved + step - directions, axis=1) < _SNAP * side
        moved = np.where(near[:, None], moved + step, moved)
        moved = moved / np.linalg.norm(moved, axis=1, keepdims=True)
    return np.asarray(moved)
