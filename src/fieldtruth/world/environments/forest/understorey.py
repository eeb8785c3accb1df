# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Below the trees: natural regeneration, bilberry, brambles and fallen twigs.

The forest is a woodrush beech forest (Luzulo-Fagetum, habitat 9110) that was planted with spruce and pine and turns
back: beech and spruce germinate in groups where some light falls, thousands to the hectare; dwarf shrubs, ferns and
grass cover a part of the acid soil, needles and leaves the rest.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.environments.forest.config import Config
from fieldtruth.world.grids import noise_map
from fieldtruth.world.model import Mesh, Raster
from fieldtruth.world.placement import Density, SwarmSpec, WorldBuilder
from fieldtruth.world.plants import BUSHES, GRASSES, TREES, grow_bush, grow_clump, grow_tree, grow_twigs

SEEDLINGS_PER_TUFT: Final = 3
"""Of ``beech_seedling`` and ``spruce_seedling``."""
SEEDLINGS: Final[Mapping[str, float]] = {"beech_seedling": 0.7, "spruce_seedling": 0.3}
SAPLINGS: Final[Mapping[str, int]] = {"beech": 4, "spruce": 2, "oak": 1}
"""Individuals of each species; members of the swarm are copies of them in equal numbers."""
SAPLING_HEIGHT: Final = 2.2  # [m] of the habit
SAPLING_SCALES: Final = (0.28, 0.7)
"""Of the smallest and the largest individual. The share of the leaves is the scale squared, so that they have their
real size in each."""
GROUP: Final = 7.0  # [m], wavelength of the groups of seedlings and dwarf shrubs
TWIGS_PER_CLUMP: Final = 6


def plant_understorey(builder: WorldBuilder, config: Config, glades: Raster, rng: np.random.Generator) -> None:
    """Scatter seedlings and saplings in groups, bilberries and brambles in the light, and twigs everywhere."""
    young, dwarf = noise_map(config.size, GROUP, rng), noise_map(config.size, GROUP, rng)

    def off_trails(xy: Array, clear: float) -> Array:
        return (builder.trail_distance(xy) > clear).astype(np.float64)

    def groups(xy: Array) -> Array:
        return np.clip(0.3 * young(xy) + 0.15 * glades.at(*xy.T) + 0.05, 0.0, 1.0) * off_trails(xy, 0.25)

    def mats(xy: Array) -> Array:
        return np.clip(0.5 * dwarf(xy) + 0.2 * glades.at(*xy.T) - 0.3, 0.0, 1.0) * off_trails(xy, 0.2)

    def light(xy: Array) -> Array:
        beside = np.exp(-np.maximum(builder.trail_distance(xy), 0.0) / 2.5)
        return np.clip(0.5 * beside + 0.3 * glades.at(*xy.T), 0.0, 1.0) * off_trails(xy, 0.4)

    seedlings, per_clump = _clumps("seedlings", SEEDLINGS, 2.7, 0.6, rng)
    bilberries, tufts = _clumps("bilberries", {"bilberry": 1.0}, 14.0, 0.6, rng, detail=0.35)
    swarms: tuple[tuple[str, str, Sequence[Mesh], float, Density, float], ...] = (
        ("seedlings", "seedling", seedlings, config.seedlings_per_m2 / SEEDLINGS_PER_TUFT / per_clump, groups, 0.5),
        ("bilberries", "dwarf_shrub", bilberries, config.bilberries_per_m2 / tufts, mats, 0.5),
        ("brambles", "bramble", _brambles(rng), config.brambles_per_m2, light, 0.9),
        ("twigs", "twig", _twigs(rng), config.twigs_per_m2 / TWIGS_PER_CLUMP, lambda xy: off_trails(xy, 0.1), 0.8),
    )
    for name, kind, meshes, per_m2, density, clear in swarms:
        spec = SwarmSpec(
            name=name, kind=kind, meshes=meshes, per_m2=_before_thinning(per_m2, density, builder), scales=(0.8, 1.2),
            tint=0.12, tilt=1.0, clear=clear,
        )  # fmt: skip
        builder.scatter_swarm(spec, rng, density)
    saplings = SwarmSpec(
        name="saplings", kind="sapling", meshes=_saplings(rng), sink=0.02, clear=0.9,
        per_m2=_before_thinning(config.saplings_per_m2, groups, builder), tint=0.12,
    )  # fmt: skip
    builder.scatter_swarm(saplings, rng, groups)


def _before_thinning(per_m2: float, density: Density, builder: WorldBuilder) -> float:
    """Density of positions of which ``density`` leaves about ``per_m2`` in the mean over the world; at most 20."""
    axes = (np.arange(-s / 2 + 0.5, s / 2, 1.0) for s in builder.size)
    mean = float(density(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)).mean())
    return min(per_m2 / max(mean, 1e-3), 20.0)


def _clumps(
    name: str, shares: Mapping[str, float], per_m2: float, radius: float, rng: np.random.Generator, detail: float = 1.0
) -> tuple[list[Mesh], int]:
    """Five clumps of increasing height, and the number of tufts in each."""
    species = {GRASSES[key]: share for key, share in shares.items()}
    clumps = [
        grow_clump(
            species, name=f"{name}_{k}", radius=radius, per_m2=per_m2, rng=rng, size=0.1 + 0.2 * k, detail=detail
        )
        for k in range(5)
    ]
    return clumps, max(1, round(per_m2 * np.pi * radius**2))


def _saplings(rng: np.random.Generator) -> list[Mesh]:
    names = [f"{species}_{k}" for species, count in SAPLINGS.items() for k in range(count)]
    scales = rng.permutation(np.geomspace(*SAPLING_SCALES, len(names)))
    return [_sapling(name, float(scale), rng) for name, scale in zip(names, scales, strict=True)]


def _sapling(name: str, scale: float, rng: np.random.Generator) -> Mesh:
    species = TREES[name.rpartition("_")[0]]
    tree = grow_tree(species, name=f"sapling_{name}", height=SAPLING_HEIGHT, rng=rng, detail=scale**2)
    vertices = np.float32(scale) * tree.vertices
    return replace(tree, vertices=vertices, footprint=scale * tree.footprint, colliders=())


def _brambles(rng: np.random.Generator) -> list[Mesh]:
    """Low brambles, which the robot drives over."""
    grown = [grow_bush(BUSHES["bramble"], name=f"brambles_{k}", height=0.6, rng=rng, detail=0.6) for k in range(4)]
    return [replace(mesh, colliders=()) for mesh in grown]


def _twigs(rng: np.random.Generator) -> list[Mesh]:
    return [grow_twigs(name=f"twigs_{k}", radius=0.8, count=TWIGS_PER_CLUMP, rng=rng) for k in range(6)]
