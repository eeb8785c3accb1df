# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Clumps: many tufts, of several kinds if wished, as one mesh that is instanced over a meadow.

A ray that grazes a meadow visits every tuft whose box it crosses. Blades reach far beyond their roots, so the boxes of
single tufts overlap many times over; a clump of a metre, in which one tree of boxes sorts all blades, was measured to
take half the time for the same blades.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Mesh, merge_meshes
from fieldtruth.world.plants.grass_species import GrassSpecies
from fieldtruth.world.plants.tufts import grow_tuft


def grow_clump(
    kinds: Mapping[GrassSpecies, float], *, name: str, radius: float, per_m2: float, rng: np.random.Generator,
    size: float = 0.5, detail: float = 1.0,
) -> Mesh:  # fmt: skip
    """Tufts in a disc of ``radius`` [m], ``per_m2`` of them on each square metre, with a ragged rim.

    ``kinds`` gives the shares of the kinds. Heights spread about the ``size`` (0: each kind's least usual height, 1:
    its greatest), lower at the rim. Where clumps stand as close as their radius, their tufts mix. No colliders; the
    footprint [m] is the radius. A clump is to be tilted with the ground.
    """
    count = max(1, round(per_m2 * np.pi * radius**2))
    shares = np.array(list(kinds.values()), np.float64)
    chosen = rng.choice(len(shares), size=count, p=shares / shares.sum())
    parts = []
    for k, (place, kind) in enumerate(zip(_places(count, radius, rng), chosen, strict=True)):
        tuft = list(kinds)[kind]
        low, high = tuft.height
        share = size + rng.normal(0, 0.25) - 0.3 * (np.hypot(*place) / radius) ** 2
        height = float(np.clip(low + (high - low) * share, 0.6 * low, 1.3 * high))
        parts.append(_moved(grow_tuft(tuft, name=f"{name}_{k}", height=height, rng=rng, detail=detail), place))
    return merge_meshes(name, parts, footprint=radius)


def _places(count: int, radius: float, rng: np.random.Generator) -> Array:
    """Places (count, 2) [m] all over the disc, neither in rows nor in heaps: a sunflower's, shaken."""
    k = np.arange(count)
    out = radius * np.sqrt((k + 0.5) / count) * rng.uniform(0.82, 1.12, count)
    turn = k * np.pi * (3 - np.sqrt(5)) + rng.normal(0, 0.3, count)
    return np.stack([out * np.cos(turn), out * np.sin(turn)], 1)


def _moved(mesh: Mesh, place: Array) -> Mesh:
    """The mesh shifted over the ground; what is far from the clump's middle reaches deeper, for uneven ground."""
    vertices = mesh.vertices.copy()
    vertices[:, :2] += place.astype(np.float32)
    deeper = vertices[:, 2] < 0
    vertices[deeper, 2] -= np.float32(0.25 * np.hypot(*place))
    return replace(mesh, vertices=vertices)
