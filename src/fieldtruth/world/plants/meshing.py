# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Skin on the skeleton: tapered tubes about the stems, wide at the roots, with bark that tiles around the seam."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.world.plants.growth import ROOT_DEPTH, Array, Stems, unit

BARK_REPEAT: Final = 0.6  # [m] of bark per repeat of the texture on thick stems
SMALLEST_REPEAT: Final = 0.12  # [m] along thin twigs, where the repeat around is smaller than this

Surface = tuple[Array, Array, Array, NDArray[np.int32]]


def tubes(stems: Stems, sides: int, profile: Array | None = None) -> Surface:
    """Vertices (v, 3) [m], unit normals pointing out, uv and faces of one tube per stem; the tip is a point.

    ``profile`` (k + 1, sides + 1) multiplies the radius around and along the stems. The seam's vertices are doubled: u
    runs from 0 to a whole number of repeats, v along the stem at the scale that u has at its foot.
    """
    n, rings, _ = stems.axis.shape
    tangent, across, over = _frames(stems.axis)
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    turn[-1] = 0  # bit-equal ends close the seam
    spoke = np.cos(turn)[:, None] * across[:, :, None] + np.sin(turn)[:, None] * over[:, :, None]
    reach = (
        stems.radius[:, :, None, None] * (np.ones((rings, sides + 1)) if profile is None else profile)[None, :, :, None]
    )
    reach[:, -1] = 0
    vertices = stems.axis[:, :, None] + reach * spoke

    normals = _smooth_normals(vertices) if profile is not None else _cone_normals(stems, spoke, tangent)
    around = np.maximum(np.rint(2 * np.pi * stems.radius[:, 0] / BARK_REPEAT), 1)
    repeat = np.clip(2 * np.pi * stems.radius[:, 0] / around, SMALLEST_REPEAT, 1.4 * BARK_REPEAT)
    u = around[:, None, None] * np.linspace(0, 1, sides + 1)
    v = (stems.length / repeat)[:, None, None] * np.linspace(0, 1, rings)[:, None]
    uv = np.stack(np.broadcast_arrays(u, v), -1)

    i, j = np.arange(rings - 1)[:, None], np.arange(sides)
    a = i * (sides + 1) + j
    b, c = a + 1, a + sides + 1
    lower, upper = np.stack([a, b, c], -1).reshape(-1, 3), np.stack([b, c + 1, c], -1)[:-1].reshape(-1, 3)
    faces = (np.arange(n) * rings * (sides + 1))[:, None, None] + np.concatenate([lower, upper])
    flat = vertices.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2)
    return *flat, faces.reshape(-1, 3).astype(np.int32)


def root_flare(stems: Stems, sides: int, flare: float, rng: np.random.Generator) -> Array:
    """A profile for `tubes` of a trunk (k + 1, sides + 1): wide at the ground, with root ridges, hardly round above."""
    z = np.maximum(np.linspace(0, stems.length[0], stems.axis.shape[1]) - ROOT_DEPTH, -0.1)[:, None]
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    phase = rng.uniform(0, 2 * np.pi, 4)
    ridges = 0.5 * np.cos(3 * turn + phase[0]) + 0.5 * np.cos(5 * turn + phase[1])
    flutes = 0.05 * np.cos(2 * turn + phase[2] + 0.5 * z) + 0.035 * np.cos(5 * turn + phase[3] - 0.4 * z)
    foot = 1.4 * float(stems.radius[0, 0])
    profile = 1 + flutes + flare * np.exp(-z / foot) * (1 + 0.5 * ridges)
    profile[:, -1] = profile[:, 0]
    return np.asarray(profile)


def _frames(axis: Array) -> tuple[Array, Array, Array]:
    """Tangents and two crosswise unit vectors per node, (n, k + 1, 3) each, carried along without twist."""
    step = unit(np.diff(axis, axis=1))
    tangent = unit(np.concatenate([step[:, :1], step[:, :-1] + step[:, 1:], step[:, -1:]], 1))
    helper = np.where(np.abs(tangent[:, 0, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    across = np.empty_like(tangent)
    across[:, 0] = unit(np.cross(tangent[:, 0], helper))
    for i in range(1, axis.shape[1]):
        carried = across[:, i - 1]
        across[:, i] = unit(carried - (carried * tangent[:, i]).sum(1, keepdims=True) * tangent[:, i])
    return tangent, across, np.cross(tangent, across)


def _cone_normals(stems: Stems, spoke: Array, tangent: Array) -> Array:
    """Normals of round tapered tubes: the spoke, tilted by the taper."""
    rings = stems.axis.shape[1]
    slope = (stems.radius[:, 0] - stems.radius[:, -1]) / np.maximum(stems.length, 1e-9)
    return (
        unit(spoke + slope[:, None, None, None] * np.broadcast_to(tangent[:, :, None], spoke.shape)) if rings else spoke
    )


def _smooth_normals(vertices: Array) -> Array:
    """Normals of tubes of any cross-section by central differences on the (ring, side) grid, around the seam."""
    around = np.roll(vertices[:, :, :-1], -1, 2) - np.roll(vertices[:, :, :-1], 1, 2)
    along = np.gradient(vertices[:, :, :-1], axis=1)
    normals = unit(np.cross(around, along))
    return np.concatenate([normals, normals[:, :, :1]], 2)
