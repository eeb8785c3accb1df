# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What grows in the forest: trees of all ages, bushes and grass where light comes in, ferns in the shade."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Mesh, Raster
from fieldtruth.world.placement import Site
from fieldtruth.world.plants import BUSHES, GRASSES, TREES, grow_bush, grow_clump, grow_tree

if TYPE_CHECKING:
    from fieldtruth.world.environments.forest import ForestConfig


AGES: Final[Mapping[str, tuple[float, float]]] = {"old": (15.0, 21.0), "grown": (9.0, 14.0), "young": (3.0, 6.0)}
"""Heights [m]."""
TREE_DETAIL: Final = {"old": 0.11, "grown": 0.11, "young": 0.35}
CLUMP_PER_M2: Final = 8.0
FERNS_TOGETHER: Final = 3


def plant_trees(site: Site, config: "ForestConfig", growth: np.random.Generator, rng: np.random.Generator) -> None:
    """Old trees first at crown's distance, then what grows between them; none on a trail."""
    counts = {"old": config.old_trees, "grown": config.grown_trees, "young": config.young_trees}
    spacing = {"old": 3.0, "grown": 1.9, "young": 1.3}
    total = sum(config.species.values())

    def off_trails(places: Array) -> NDArray[np.bool_]:
        return site.trail_distance(places) > 0.55

    for age, heights in AGES.items():
        left = counts[age]
        for k, (name, share) in enumerate(config.species.items()):
            count = left if k == len(config.species) - 1 else min(left, round(counts[age] * share / total))
            left -= count
            trees = [
                grow_tree(
                    TREES[name], name=f"{name}_{age}_{n}", height=float(growth.uniform(*heights)), rng=growth,
                    detail=TREE_DETAIL[age], grown_in="stand",
                )
                for n in range(min(config.individuals, count))
            ]  # fmt: skip
            if trees:
                site.scatter(
                    name,
                    trees,
                    count,
                    rng=rng,
                    allowed=off_trails,
                    spacing=spacing[age],
                    scales=(0.88, 1.15),
                    tint=0.1,
                    quarters=True,
                )


def plant_bushes(site: Site, config: "ForestConfig", rng: np.random.Generator) -> None:
    """Hazel and bramble, where the trails and glades let light in."""

    def allowed(places: Array) -> NDArray[np.bool_]:
        away = site.trail_distance(places)
        return (away > 0.9) & (rng.random(len(places)) < np.exp(-away / 6.0))

    kinds = [BUSHES[name] for name in ("hazel", "bramble") if name in BUSHES]
    for k, kind in enumerate(kinds):
        bushes = [
            grow_bush(
                kind, name=f"bush_{kind.name}_{n}", height=kind.grown.height * float(rng.uniform(0.6, 1.0)), rng=rng
            )
            for n in range(4)
        ]
        count = config.bushes // len(kinds) + (k < config.bushes % len(kinds))
        site.scatter("bush", bushes, count, rng=rng, allowed=allowed, spacing=1.2, scales=(0.7, 1.15), tint=0.1)


def strew_herbs(site: Site, config: "ForestConfig", glade: Raster, rng: np.random.Generator) -> None:
    """Grass where it is light, above all along the trails; ferns in the hollows' shade; nettles here and there."""

    def light(places: Array) -> Array:
        away = site.trail_distance(places)
        return 0.75 * np.exp(-np.maximum(away, 0.0) / 1.6) + 0.28 * glade.at(places[:, 0], places[:, 1])

    def grass(places: Array) -> Array:
        return np.clip(light(places), 0.02, 0.9) * (site.trail_distance(places) > -0.1)

    def ferns(places: Array) -> Array:
        shade = np.clip(0.55 - 0.9 * glade.at(places[:, 0], places[:, 1]), 0.0, 1.0)
        return shade * (site.trail_distance(places) > 0.25)

    def nettles(places: Array) -> Array:
        return np.clip(glade.at(places[:, 0], places[:, 1]) - 0.9, 0.0, 1.0) * (site.trail_distance(places) > 0.2)

    grasses, fronds, patches = _clumps(rng)
    site.strew(
        "forest_grass", "high_grass", grasses, per_m2=config.grass_per_m2 / CLUMP_PER_M2, rng=rng, density=grass,
        scales=(0.7, 1.25), tint=0.14, tilt=1.0,
    )  # fmt: skip
    site.strew(
        "ferns", "fern", fronds, per_m2=config.ferns_per_m2 / FERNS_TOGETHER, rng=rng, density=ferns,
        scales=(0.65, 1.2), tint=0.14, tilt=1.0, clear=0.5,
    )  # fmt: skip
    site.strew(
        "nettles", "herb", patches, per_m2=0.35, rng=rng, density=nettles, scales=(0.7, 1.2), tint=0.12, tilt=1.0,
        clear=0.5,
    )  # fmt: skip


def _clumps(rng: np.random.Generator) -> tuple[list[Mesh], list[Mesh], list[Mesh]]:
    """Clumps of grass, of ferns and of nettles."""
    mixtures = {
        "grass": {GRASSES["forest"]: 0.9, GRASSES["sedge"]: 0.1},
        "nettles": {GRASSES["nettle"]: 0.7, GRASSES["forest"]: 0.3},
    }
    grasses, patches = (
        [
            grow_clump(
                kinds,
                name=f"{name}_{k}",
                radius=0.5,
                per_m2=CLUMP_PER_M2,
                rng=rng,
                size=0.2 + 0.15 * k,
                detail=0.6,
            )
            for k in range(5)
        ]
        for name, kinds in mixtures.items()
    )
    fronds = [
        grow_clump(
            {GRASSES["fern"]: 0.8, GRASSES["bracken"]: 0.2}, name=f"ferns_{k}", radius=0.75,
            per_m2=FERNS_TOGETHER / (np.pi * 0.75**2), rng=rng, size=0.15 * k,
        )
        for k in range(6)
    ]  # fmt: skip
    return grasses, fronds, patches
