# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Clumps: many tufts of one or several species as one mesh that is instanced over a meadow.

A ray that grazes a meadow visits every tuft whose bounding box it crosses. Blades extend far beyond their roots, so the
boxes of single tufts overlap many times; a clump of a metre, whose blades share one bounding volume hierarchy, took
half the time for the same blades.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Mesh, merge_meshes
from fieldtruth.world.plants.grass_species import GrassSpecies
from fieldtruth.world.plants.tufts import grow_tuft


def grow_clump(
    shares: Mapping[GrassSpecies, float],
    *,
    name: str,
    radius: float,
    per_m2: float,
    rng: np.random.Generator,
    size: float = 0.5,
    detail: float = 1.0,
) -> Mesh:
    """Tufts in a disc of ``radius`` [m] with a ragged rim, ``per_m2`` per square metre; ``shares`` by species.

    Heights vary about the ``size`` (0: each species' least usual height, 1: its greatest) and are lower at the rim.
    Tufts of clumps that are a radius apart mix. No colliders; the footprint [m] is the radius. Tilt a clump with the
    ground.
    """
    count = max(1, round(per_m2 * np.pi * radius**2))
    weights = np.array(list(shares.values()), np.float64)
    chosen = rng.choice(len(weights), size=count, p=weights / weights.sum())
    parts = []
    for k, (xy, row) in enumerate(zip(_positions(count, radius, rng), chosen, strict=True)):
        species = list(shares)[row]
        low, high = species.height
        share = size + rng.normal(0, 0.25) - 0.3 * (np.hypot(*xy) / radius) ** 2
        height = float(np.clip(low + (high - low) * share, 0.6 * low, 1.3 * high))
        parts.append(_moved(grow_tuft(species, name=f"{name}_{k}", height=height, rng=rng, detail=detail), xy))
    return merge_meshes(name, parts, footprint=radius)


def _positions(count: int, radius: float, rng: np.random.Generator) -> Array:
    """Positions (count, 2) [m] spread evenly over the disc: a sunflower pattern with jitter."""
    k = np.arange(count)
    out = radius * np.sqrt((k + 0.5) / count) * rng.uniform(0.82, 1.12, count)
    turn = k * np.pi * (3 - np.sqrt(5)) + rng.normal(0, 0.3, count)
    return np.stack([out * np.cos(turn), out * np.sin(turn)], 1)


def _moved(mesh: Mesh, xy: Array) -> Mesh:
    """The mesh moved by ``xy`` [m], with deeper roots far from the clump's middle, for uneven ground."""
    vertices = mesh.vertices.copy()
    vertices[:, :2] += xy.astype(np.float32)
    deeper = vertices[:, 2] < 0
    vertices[deeper, 2] -= np.float32(0.25 * np.hypot(*xy))
    return replace(mesh, vertices=vertices)
