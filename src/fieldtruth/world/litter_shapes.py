# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shapes of what lies on the ground: curled leaves, blades, twigs, stones; n of a kind at once, as one surface."""

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.plants.blades import discs, kites, spindles
from fieldtruth.world.plants.growth import unit
from fieldtruth.world.plants.meshing import Surface

Shape = Callable[[Array, Array, np.random.Generator], Surface]
"""Surface of n objects at foots (n, 3) [m] on level ground with sizes (n,) [m], their greatest extent."""

_GOLDEN: Final = (1.0 + np.sqrt(5.0)) / 2.0
_BALL: Final = unit(
    np.array([[s * a, t * b, 0.0] for a, b in ((1.0, _GOLDEN),) for s in (-1, 1) for t in (-1, 1)])[:, [0, 1, 2]]
)
_CORNERS: Final = np.concatenate([_BALL, np.roll(_BALL, 1, axis=1), np.roll(_BALL, 2, axis=1)])
"""Corners (12, 3) of an icosahedron."""


def _triangles() -> list[list[int]]:
    """Faces of the icosahedron: corners that are neighbours of each other, counterclockwise from outside."""
    near = np.linalg.norm(_CORNERS[:, None] - _CORNERS, axis=-1) < 1.1
    found = []
    for a in range(12):
        for b in range(a + 1, 12):
            for c in range(b + 1, 12):
                if near[a, b] and near[b, c] and near[a, c]:
                    outward = np.linalg.det(_CORNERS[[a, b, c]]) > 0
                    found.append([a, b, c] if outward else [a, c, b])
    return found


_FACES: Final = _triangles()


def leaves(foot: Array, size: Array, rng: np.random.Generator) -> Surface:
    """Dead leaves that lie askew: folded along the midrib, tips and margins bent up or down; two halves each."""
    n = len(foot)
    ahead, side, up = _askew(n, 18.0, rng)
    width = size * rng.uniform(0.38, 0.62, n)
    curl, fold = rng.normal(0.0, 0.12, n) * size, np.abs(rng.normal(0.12, 0.12, n)) * size
    flip = np.where(rng.random(n) < 0.5, -1.0, 1.0)
    rows = []
    for sign in (1.0, -1.0):
        for along, out, high in ((-0.5, 0.0, 1.0), (-0.2, 0.9, 0.0), (0.22, 0.75, 0.0), (0.5, 0.0, 1.0)):
            z = flip * (high * curl + (1.0 - high) * fold) + 0.25 * size * rng.normal(0.0, 0.25, n)
            rows.append(
                foot
                + (along * size)[:, None] * ahead
                + (0.5 * sign * out * width)[:, None] * side
                + (z + 0.3 * fold)[:, None] * up
            )
    vertices = np.stack(rows, axis=1)
    tilt = (0.5 * flip * fold / np.maximum(width, 1e-6))[:, None] * side
    normals = unit(np.stack([up - tilt] * 4 + [up + tilt] * 4, axis=1))
    half = [[0.5, 0.03], [0.96, 0.3], [0.9, 0.7], [0.5, 0.97]]
    uv = np.broadcast_to([*half, *([1.0 - u, v] for u, v in half)], (n, 8, 2))
    return _gathered(vertices, normals, uv, [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]])


def blades(foot: Array, size: Array, rng: np.random.Generator) -> Surface:
    """Blades of grass in tufts of four, from upright to lying."""
    n = len(foot)
    tuft = np.repeat(rng.normal(0.0, 0.008, (n, 1, 2)), 4, axis=1) + rng.normal(0.0, 0.006, (n, 4, 2))
    base = np.concatenate([np.repeat(foot[:, None, :2], 4, axis=1) + tuft, np.full((n, 4, 1), -0.012)], axis=2)
    lean = np.radians(rng.uniform(12.0, 75.0, (n, 4)))
    turn = rng.uniform(0.0, 2.0 * np.pi, (n, 4))
    direction = np.stack([np.sin(lean) * np.cos(turn), np.sin(lean) * np.sin(turn), np.cos(lean)], axis=-1)
    length = (size[:, None] * rng.uniform(0.5, 1.0, (n, 4)) + 0.012).ravel()
    upper = np.broadcast_to([0.1, 0.05, 1.0], (4 * n, 3))
    return kites(base.reshape(-1, 3), direction.reshape(-1, 3), upper, length, np.full(4 * n, 0.005), 0.35)


def stems(foot: Array, size: Array, rng: np.random.Generator) -> Surface:
    """Needles and dry stalks that lie about, a tenth as wide as a leaf."""
    n = len(foot)
    ahead, _, up = _askew(n, 9.0, rng)
    return kites(foot - 0.5 * size[:, None] * ahead, ahead, up, size, np.maximum(0.02 * size, 0.0016), 0.5)


def flakes(foot: Array, size: Array, rng: np.random.Generator) -> Surface:
    """Pieces of bark and husks."""
    n = len(foot)
    ahead, _, up = _askew(n, 8.0, rng)
    return kites(foot - 0.5 * size[:, None] * ahead, ahead, up, size, size * rng.uniform(0.3, 0.7, n), 0.45)


def clover(foot: Array, size: Array, rng: np.random.Generator) -> Surface:
    """Three leaflets of a ``size`` on a stalk too thin to be seen."""
    n = len(foot)
    turn = rng.uniform(0.0, 2.0 * np.pi, n)[:, None] + 2.0 * np.pi * np.arange(3) / 3
    direction = unit(np.stack([np.cos(turn), np.sin(turn), rng.uniform(-0.1, 0.4, (n, 3))], axis=-1)).reshape(-1, 3)
    base = np.repeat(foot + np.array([0.0, 0.0, 0.022]), 3, axis=0)
    upper = np.broadcast_to([0.0, 0.0, 1.0], (3 * n, 3))
    return kites(base, direction, upper, np.repeat(size, 3), 0.9 * np.repeat(size, 3), 0.6)


def flowers(foot: Array, size: Array, rng: np.random.Generator) -> Surface:
    """Daisies that face the sky."""
    n = len(foot)
    normal = unit(np.concatenate([rng.normal(0.0, 0.25, (n, 2)), np.ones((n, 1))], axis=1))
    return discs(foot + np.array([0.0, 0.0, 0.04]), normal, 0.5 * size)


def twigs(foot: Array, size: Array, rng: np.random.Generator) -> Surface:
    """Twigs, an eightieth to a thirtieth as thick as long, in two straight pieces."""
    n = len(foot)
    ahead, side, up = _askew(n, 4.0, rng)
    thick = np.maximum(size * rng.uniform(1 / 80, 1 / 30, n), 0.002)
    bend = unit(ahead + rng.normal(0.0, 0.35, (n, 1)) * side + np.abs(rng.normal(0.0, 0.08, (n, 1))) * up)
    middle = foot + (0.3 * thick)[:, None] * up
    ends = middle - 0.55 * size[:, None] * ahead, middle + 0.45 * size[:, None] * bend
    joint = middle - 0.05 * size[:, None] * ahead
    low, high = np.concatenate([ends[0], joint]), np.concatenate([middle, ends[1]])
    return spindles(low, high, np.concatenate([0.5 * thick, 0.42 * thick]))


def stones(foot: Array, size: Array, rng: np.random.Generator) -> Surface:
    """Stones of twenty faces, flat and irregular, a third in the ground."""
    n = len(foot)
    axes = 0.5 * size[:, None] * np.stack([np.ones(n), rng.uniform(0.6, 0.95, n), rng.uniform(0.35, 0.7, n)], axis=1)
    ball = _CORNERS * rng.uniform(0.78, 1.12, (n, 12, 1))
    return _turned(foot + np.array([0.0, 0.0, 0.22]) * axes[:, 2:], ball, axes, rng)


def cones(foot: Array, size: Array, rng: np.random.Generator) -> Surface:
    """Fallen cones, half as thick as long."""
    n = len(foot)
    axes = 0.5 * size[:, None] * np.array([1.0, 0.5, 0.5])
    return _turned(foot + np.array([0.0, 0.0, 0.8]) * axes[:, 2:], np.tile(_CORNERS, (n, 1, 1)), axes, rng)


def _turned(middle: Array, ball: Array, axes: Array, rng: np.random.Generator) -> Surface:
    """Ellipsoids (n, 12, 3) with half axes (n, 3) [m], turned about the vertical."""
    turn = rng.uniform(0.0, 2.0 * np.pi, len(middle))
    cosine, sine = np.cos(turn)[:, None], np.sin(turn)[:, None]

    def rotated(v: Array) -> Array:
        return np.stack([cosine * v[..., 0] - sine * v[..., 1], sine * v[..., 0] + cosine * v[..., 1], v[..., 2]], -1)

    vertices = middle[:, None] + rotated(ball * axes[:, None])
    normals = unit(rotated(ball / axes[:, None]))
    uv = 8.0 * vertices[..., :2] + rng.random((len(middle), 1, 2))
    return _gathered(vertices, normals, uv, _FACES)


def _askew(n: int, tilt_deg: float, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Axes ahead, aside and up (n, 3) of objects that lie in any direction, up to about ``tilt_deg`` from level."""
    turn, tilt = rng.uniform(0.0, 2.0 * np.pi, n), np.tan(np.radians(tilt_deg)) * rng.normal(0.0, 0.6, (n, 2))
    up = unit(np.concatenate([tilt, np.ones((n, 1))], axis=1))
    level = np.stack([np.cos(turn), np.sin(turn), np.zeros(n)], axis=1)
    ahead = unit(level - (level * up).sum(axis=1, keepdims=True) * up)
    return ahead, np.cross(up, ahead), up


def _gathered(vertices: Array, normals: Array, uv: Array, pattern: list[list[int]]) -> Surface:
    """One surface of n objects with k vertices (n, k, ...), each with the faces of ``pattern``."""
    n, k, _ = vertices.shape
    faces = k * np.arange(n)[:, None, None] + np.array(pattern)
    return vertices.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2), faces.reshape(-1, 3).astype(np.int32)


SHAPES: Final[Mapping[str, Shape]] = {
    each.__name__: each for each in (leaves, blades, stems, flakes, clover, flowers, twigs, stones, cones)
}
