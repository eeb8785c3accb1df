# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Polylines and polygons: rounded corners, bars of a given thickness, triangulation."""

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldtruth.core.arrays import Array


def rounded(path: ArrayLike, radius: float, *, steps: int = 5) -> Array:
    """Polyline (p, d) with every corner replaced by an arc of ``radius`` [m], or less if the sides are too short."""
    points = np.asarray(path, np.float64)
    result = [points[0]]
    for before, corner, after in zip(points[:-2], points[1:-1], points[2:], strict=True):
        a, b = before - corner, after - corner
        to_a, to_b = a / np.linalg.norm(a), b / np.linalg.norm(b)
        half = np.arccos(np.clip(to_a @ to_b, -1, 1)) / 2
        cut = min(radius / np.tan(half), 0.499 * float(np.linalg.norm(a)), 0.499 * float(np.linalg.norm(b)))
        middle = (to_a + to_b) / np.linalg.norm(to_a + to_b)
        centre = corner + middle * cut / np.cos(half)
        start, stop = corner + cut * to_a - centre, corner + cut * to_b - centre
        angle = np.pi - 2 * half
        for s in np.linspace(0, 1, steps + 1):
            result.append(centre + (np.sin((1 - s) * angle) * start + np.sin(s * angle) * stop) / np.sin(angle))
    return np.array([*result, points[-1]])


def bar_outline(path: ArrayLike, thickness: ArrayLike) -> Array:
    """Anticlockwise outline (2 p, 2) of a bar along an open plane path (p, 2) [m]; one thickness, or one per point."""
    points = np.asarray(path, np.float64)
    steps = np.diff(points, axis=0)
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    before, after = np.vstack([steps[:1], steps]), np.vstack([steps, steps[-1:]])
    halving = before + after
    normal = np.stack([-halving[:, 1], halving[:, 0]], axis=1)
    normal /= np.linalg.norm(halving, axis=1, keepdims=True)
    cosine = np.einsum("ij,ij->i", halving, before) / np.linalg.norm(halving, axis=1)
    half = np.broadcast_to(np.asarray(thickness, np.float64), len(points)) / 2 / cosine
    offset = half[:, None] * normal
    return np.concatenate([points - offset, (points + offset)[::-1]])


def signed_area(outline: Array) -> float:
    """Area [m2] of a polygon (n, 2), positive if anticlockwise."""
    x, y = outline[:, 0], outline[:, 1]
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def triangulate(outline: Array) -> NDArray[np.int32]:
    """Triangles (n - 2, 3) of a simple anticlockwise polygon (n, 2), by ear clipping."""
    left = list(range(len(outline)))
    triangles: list[tuple[int, int, int]] = []
    while len(left) > 3:
        for k in range(len(left)):
            ear = (left[k - 1], left[k], left[(k + 1) % len(left)])
            if _is_ear(outline, ear, left):
                triangles.append(ear)
                del left[k]
                break
        else:
            raise ValueError("outline must be simple and anticlockwise")
    return np.array([*triangles, tuple(left)], np.int32)


def _is_ear(outline: Array, ear: tuple[int, int, int], left: list[int]) -> bool:
    corners = outline[list(ear)]
    if signed_area(corners) <= 0:
        return False
    others = outline[[k for k in left if k not in ear]]
    inside = np.ones(len(others), bool)
    for a, b in pairwise([*corners, corners[0]]):
        edge, to_point = b - a, others - a
        inside &= edge[0] * to_point[:, 1] - edge[1] * to_point[:, 0] >= 0
    return not inside.any()


def at_length(path: Array, lengths: ArrayLike) -> tuple[Array, Array]:
    """Points (k, 2) at given lengths (k,) [m] along a plane path (p, 2), and the path's slope there (k,) [rad]."""
    steps = np.diff(path, axis=0)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps, axis=1))])
    wanted = np.asarray(lengths, np.float64)
    points = np.stack([np.interp(wanted, along, path[:, k]) for k in range(2)], axis=1)
    piece = np.clip(np.searchsorted(along, wanted, side="right") - 1, 0, len(steps) - 1)
    return points, np.arctan2(steps[piece, 1], steps[piece, 0])


def path_length(path: Array) -> float:
    """Length [m] of a polyline (p, d)."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
