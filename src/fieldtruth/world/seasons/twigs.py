# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The fine twigs that leaves hide: meshes have a surface for the thickest only, and a bare crown needs the others.

Each carries a leaf in summer: it grows from the wood nearest to it, out to where the leaf was.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Float32Array, Index, Mask
from fieldtruth.world.plants.growth import unit

PER_LEAF: Final = 0.6
"""Twigs per leaf of a mesh; leaves of meshes with less detail stand for several."""
MOST: Final = 20_000
"""Twigs of a mesh."""
COLOUR: Final = (0.105, 0.076, 0.058)
"""Albedo of young bark, which is brown and smooth in all species; even that of birches."""
LONGEST: Final = 1.1
"""[m]"""
SLIM: Final = 0.006
"""Radius of a twig at its base relative to its length."""
THINNEST: Final = 0.022
"""Radius that is added, relative to a leaf, and at most ``THIN``."""
THIN: Final = 0.0024  # [m]
REACH: Final = (0.6, 1.8)
"""Least and greatest length of a twig that starts beside its leaf, relative to the leaf."""

Surface = tuple[Float32Array, Float32Array, Float32Array, NDArray[np.int32]]


def hidden_twigs(wood: Array, leaves: Array, leaf: float, gone: Mask, rng: np.random.Generator) -> Surface:
    """Vertices, normals, uv and faces of pointed three-sided twigs to leaves that are ``gone``.

    ``wood`` (f, 3, 3) [m] are the triangles of the drawn stems, ``leaves`` (n, 3) [m] positions of leaves of a
    length ``leaf`` [m]. Numbers are drawn for
    all leaves, so that a twig is the same in each season.
    """
    chance, length, bow = (
        rng.random(len(leaves)),
        leaf * rng.uniform(*REACH, len(leaves)),
        rng.normal(0, 1, leaves.shape),
    )
    share = min(PER_LEAF, MOST / max(len(leaves), 1))
    rows = np.flatnonzero(gone & (chance < share))
    if not len(rows) or not len(wood):
        empty = np.zeros((0, 3), np.float32)
        return empty, empty, empty[:, :2], np.zeros((0, 3), np.int32)
    foot, tip = _axes(wood, leaves[rows], length[rows], bow[rows])
    return _needles(foot, tip, min(THINNEST * leaf, THIN))


def _axes(wood: Array, leaves: Array, least: Array, bow: Array) -> tuple[Array, Array]:
    """Feet and tips (n, 3) [m]."""
    wood = wood.astype(np.float64)
    points = np.concatenate([wood[:, 0] + t * (wood[:, 2] - wood[:, 0]) for t in (0.1, 0.35, 0.6, 0.85)])
    distance, nearest = cKDTree(points).query(leaves)
    away, foot = np.asarray(distance), points[nearest]
    ahead = unit(leaves - foot + 0.12 * away[:, None] * bow + 1e-6 * bow)
    reach = np.maximum(away * 1.08, least)
    tip = foot + reach[:, None] * ahead
    return tip - np.minimum(reach, LONGEST)[:, None] * ahead, tip


def _needles(foot: Array, tip: Array, thinnest: float) -> Surface:
    n = len(foot)
    axis = tip - foot
    length = np.linalg.norm(axis, axis=1)
    ahead = axis / length[:, None]
    across = unit(np.cross(ahead, [0.31, 0.2, 0.93]))
    over = np.cross(ahead, across)
    turn = 2 * np.pi * np.arange(3) / 3
    spoke = np.cos(turn)[:, None] * across[:, None] + np.sin(turn)[:, None] * over[:, None]
    radius = thinnest + SLIM * length
    vertices = np.concatenate([foot[:, None] + radius[:, None, None] * spoke, tip[:, None]], axis=1)
    normals = np.concatenate([spoke, ahead[:, None]], axis=1)
    v = np.stack([0 * length, 0 * length, 0 * length, length / 0.15], axis=1)
    uv = np.stack([np.broadcast_to([0.0, 0.33, 0.67, 0.5], v.shape), v], axis=-1)
    faces: Index = 4 * np.arange(n)[:, None, None] + np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3]])
    return (
        vertices.reshape(-1, 3).astype(np.float32),
        normals.reshape(-1, 3).astype(np.float32),
        uv.reshape(-1, 2).astype(np.float32),
        faces.reshape(-1, 3).astype(np.int32),
    )
