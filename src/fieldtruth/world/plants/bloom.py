# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A bush in bloom: some of its leaves, in patches on the outside, become flowers."""

from dataclasses import replace
from typing import Final

import numpy as np

from fieldtruth.world.model import Mesh

FLOWER_SIZE: Final = 0.6
"""Length of a flower relative to the leaf that it replaces."""


def in_bloom(mesh: Mesh, foliage: int, flower: str, share: float, rng: np.random.Generator) -> Mesh:
    """The mesh with a ``share`` of the leaves of material row ``foliage`` replaced by flowers.

    The triangles of a leaf share their first vertex. Leaves far from the middle bloom first, some patches more than
    others.
    """
    of_leaf = np.flatnonzero(mesh.material == foliage)
    first, number = np.unique(mesh.faces[of_leaf, 0], return_inverse=True)
    middle = np.zeros((len(first), 3))
    np.add.at(middle, number, mesh.vertices[mesh.faces[of_leaf]].mean(axis=1))
    middle /= np.bincount(number)[:, None]
    centre, spread = middle.mean(0), middle.std(0) + 1e-9
    outwards = np.linalg.norm((middle - centre) / spread, axis=1) + 0.5 * (middle[:, 2] - centre[2]) / spread[2]
    waves = rng.normal(0, 2.2, (3, 3)) / spread.mean()
    patch = np.cos(middle @ waves.T + rng.uniform(0, 2 * np.pi, 3)).sum(axis=1)
    score = outwards + 0.5 * patch + rng.normal(0, 0.5, len(first))
    blooming = score > np.quantile(score, 1 - share)
    rows = of_leaf[blooming[number]]
    material = mesh.material.copy()
    material[rows] = len(mesh.materials)
    vertices = mesh.vertices.copy()
    corner, base = mesh.faces[rows, 1:].ravel(), mesh.vertices[mesh.faces[rows, 0]].repeat(2, axis=0)
    vertices[corner] = base + np.float32(FLOWER_SIZE) * (mesh.vertices[corner] - base)
    return replace(mesh, vertices=vertices, material=material, materials=(*mesh.materials, flower))
