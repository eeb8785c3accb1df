# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Plants of the forest: trees of all ages, bushes and grass where there is light, ferns in the shade."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.world.environments.forest.config import Config
from fieldtruth.world.environments.forest.stand import Stand
from fieldtruth.world.model import Mesh, Raster
from fieldtruth.world.placement import ObjectGroup, SwarmSpec, WorldBuilder
from fieldtruth.world.plants import BUSHES, GRASSES, TREES, grow_bush, grow_clump, grow_tree

AGES: Final[Mapping[str, tuple[float, float]]] = {"old": (18.0, 25.0), "grown": (10.0, 16.0), "young": (3.0, 6.0)}
"""Heights [m]."""
TREE_DETAIL: Final = {"old": 0.14, "grown": 0.27, "young": 0.5}
TUFTS_PER_M2: Final = 8.0
"""Density of tufts in a clump."""
FERNS_PER_CLUMP: Final = 3


def plant_trees(builder: WorldBuilder, config: Config, growth: np.random.Generator, rng: np.random.Generator) -> None:
    """Plant old trees, then younger ones between them, each where some light is left, none on a trail."""
    stand = Stand(builder)
    counts = {"old": config.old_trees, "grown": config.grown_trees, "young": config.young_trees}
    total = sum(config.species.values())

    def off_trails(xy: Array) -> Mask:
        return builder.trail_distance(xy) > 0.55

    for age, heights in AGES.items():
        left = counts[age]
        for k, (name, share) in enumerate(config.species.items()):
            count = left if k == len(config.species) - 1 else min(left, round(counts[age] * share / total))
            left -= count
            trees = [
                grow_tree(
                    TREES[name],
                    name=f"{name}_{age}_{n}",
                    height=float(growth.uniform(*heights)),
                    rng=growth,
                    detail=TREE_DETAIL[age],
                    grown_in="stand",
                )
                for n in range(min(config.individuals, count))
            ]
            if trees:
                group = ObjectGroup(kind=name, meshes=trees, count=count, scales=(0.88, 1.15), tint=0.1)
                stand.plant(group, rng, off_trails)


def plant_bushes(builder: WorldBuilder, config: Config, rng: np.random.Generator) -> None:
    """Plant hazel and bramble where trails and glades let light in."""

    def allowed(xy: Array) -> Mask:
        away = builder.trail_distance(xy)
        return (away > 0.9) & (rng.random(len(xy)) < np.exp(-away / 6.0))

    names = ("hazel", "bramble")
    for k, name in enumerate(names):
        bush = BUSHES[name]
        bushes = [
            grow_bush(bush, name=f"bush_{name}_{n}", height=bush.grown.height * float(rng.uniform(0.6, 1.0)), rng=rng)
            for n in range(4)
        ]
        count = config.bushes // len(names) + (k < config.bushes % len(names))
        group = ObjectGroup(kind="bush", meshes=bushes, count=count, spacing=1.2, scales=(0.7, 1.15), tint=0.1)
        builder.scatter(group, rng, allowed)


def plant_herbs(builder: WorldBuilder, config: Config, glades: Raster, rng: np.random.Generator) -> None:
    """Scatter grass in the light, mostly along the trails, ferns in the shade, and some nettles."""

    def grass(xy: Array) -> Array:
        away = builder.trail_distance(xy)
        light = 0.75 * np.exp(-np.maximum(away, 0.0) / 1.6) + 0.42 * glades.at(*xy.T)
        return np.asarray(np.clip(light, 0.06, 0.9) * (away > -0.1))

    def ferns(xy: Array) -> Array:
        shade = np.clip(0.55 - 0.9 * glades.at(*xy.T), 0.0, 1.0)
        return shade * (builder.trail_distance(xy) > 0.25)

    def nettles(xy: Array) -> Array:
        return np.clip(glades.at(*xy.T) - 0.9, 0.0, 1.0) * (builder.trail_distance(xy) > 0.2)

    grass_clumps = _clumps("grass", {"forest": 0.9, "sedge": 0.1}, rng)
    nettle_clumps = _clumps("nettles", {"nettle": 0.7, "forest": 0.3}, rng)
    fern_clumps = _fern_clumps(rng)
    grass_per_m2, ferns_per_m2 = config.grass_per_m2 / TUFTS_PER_M2, config.ferns_per_m2 / FERNS_PER_CLUMP
    for name, kind, meshes, per_m2, scales, tint, clear, density in (
        ("forest_grass", "high_grass", grass_clumps, grass_per_m2, (0.7, 1.25), 0.14, 0.0, grass),
        ("ferns", "fern", fern_clumps, ferns_per_m2, (0.65, 1.2), 0.14, 0.5, ferns),
        ("nettles", "herb", nettle_clumps, 0.35, (0.7, 1.2), 0.12, 0.5, nettles),
    ):
        spec = SwarmSpec(
            name=name, kind=kind, meshes=meshes, per_m2=per_m2, scales=scales, tint=tint, tilt=1.0, clear=clear
        )
        builder.scatter_swarm(spec, rng, density)


def _fern_clumps(rng: np.random.Generator) -> list[Mesh]:
    """Six clumps of ferns of increasing size."""
    shares = {GRASSES["fern"]: 0.8, GRASSES["bracken"]: 0.2}
    per_m2 = FERNS_PER_CLUMP / (np.pi * 0.75**2)
    return [grow_clump(shares, name=f"ferns_{k}", radius=0.75, per_m2=per_m2, rng=rng, size=0.15 * k) for k in range(6)]


def _clumps(name: str, shares: Mapping[str, float], rng: np.random.Generator) -> list[Mesh]:
    """Five clumps of grass and herbs of increasing size."""
    return [
        grow_clump(
            {GRASSES[species]: share for species, share in shares.items()},
            name=f"{name}_{k}",
            radius=0.5,
            per_m2=TUFTS_PER_M2,
            rng=rng,
            size=0.2 + 0.15 * k,
            detail=0.6,
        )
        for k in range(5)
    ]
