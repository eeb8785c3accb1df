# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Plants of the lake's shore, distributed by the distance to the water and in groves and swathes."""

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.world.environments.lake.config import Config
from fieldtruth.world.environments.lake.power_line import PowerLine
from fieldtruth.world.environments.lake.shore import Shore
from fieldtruth.world.grids import noise_map
from fieldtruth.world.model import Mesh
from fieldtruth.world.placement import Density, ObjectGroup, SwarmSpec, WorldBuilder
from fieldtruth.world.plants import BUSHES, GRASSES, TREES, grow_bush, grow_clump, grow_tree, grow_tuft

WATERSIDE_TREES: Final = {"alder": (7.0, 11.0), "willow": (5.5, 9.0)}  # species: height [m], lowest and highest
MEADOW_TREES: Final = {"birch": (7.0, 12.0), "pine": (8.0, 14.0), "oak": (7.0, 11.0)}
WATERSIDE_BUSHES: Final = ("grey_willow",)
MEADOW_BUSHES: Final = ("hazel", "bramble")

BELOW_WIRES: Final = 3.4  # [m] from the power line to the nearest trunk
TREE_DETAIL: Final = 0.4
TUFT_DETAIL: Final = 0.55
TRIES: Final = 9000


def plant_trees(
    builder: WorldBuilder,
    shore: Shore,
    line: PowerLine,
    config: Config,
    growth: np.random.Generator,
    rng: np.random.Generator,
) -> None:
    """Plant alders and willows near the water with gaps between them, groves in the meadow, none below the wires."""
    grove = noise_map(builder.size, 17.0, rng)
    for kind, species, count, (low, high) in (
        ("waterside_tree", WATERSIDE_TREES, config.waterside_trees, (0.9, 6.0)),
        ("meadow_tree", MEADOW_TREES, config.meadow_trees, (8.5, 99.0)),
    ):
        trees = [
            grow_tree(
                TREES[name],
                name=f"{kind}_{name}_{k}",
                height=float(growth.uniform(*heights)),
                rng=growth,
                detail=TREE_DETAIL,
            )
            for k in range(config.individuals)
            for name, heights in species.items()
        ]

        def allowed(xy: Array, low: float = low, high: float = high) -> Mask:
            inland, thick = shore.inland.at(*xy.T), grove(xy)
            return (inland > low) & (inland < high) & (thick > -0.1) & (line.distance(xy) > BELOW_WIRES)

        group = ObjectGroup(kind=kind, meshes=trees, count=count, spacing=4.2, scales=(0.85, 1.15), tint=0.08)
        builder.scatter(group, rng, allowed, tries=TRIES)


def plant_bushes(builder: WorldBuilder, shore: Shore, config: Config, rng: np.random.Generator) -> None:
    """Plant grey willows along the water, hazel and brambles in the meadow, in thickets."""
    thicket = noise_map(builder.size, 12.0, rng)
    for kind, names, count, (low, high) in (
        ("waterside_bush", WATERSIDE_BUSHES, config.waterside_bushes, (0.6, 7.0)),
        ("meadow_bush", MEADOW_BUSHES, config.meadow_bushes, (5.0, 99.0)),
    ):
        bushes = [
            grow_bush(
                BUSHES[name],
                name=f"bush_{name}_{k}",
                rng=rng,
                height=BUSHES[name].grown.height * float(rng.uniform(0.6, 1.15)),
            )
            for k in range(config.individuals)
            for name in names
        ]

        def allowed(xy: Array, low: float = low, high: float = high) -> Mask:
            inland = shore.inland.at(*xy.T)
            return (inland > low) & (inland < high) & (thicket(xy) > -0.5)

        group = ObjectGroup(kind=kind, meshes=bushes, count=count, scales=(0.75, 1.15), tint=0.1)
        builder.scatter(group, rng, allowed, tries=TRIES)


class _GrassArea(NamedTuple):
    """Grass of one kind: shares by species, clumps (or single tufts if the radius is 0), and where they grow."""

    species: Mapping[str, float]
    radius: float  # [m] of a clump
    tufts_per_m2: float  # of a clump
    per_m2: float  # clumps or single tufts
    density: Density


def plant_grass(builder: WorldBuilder, shore: Shore, config: Config, rng: np.random.Generator) -> None:
    """Scatter reeds and cattails in the shallow water, sedges along it, long grass and herbs in the meadow."""
    few = config.individuals
    for row, area in enumerate(_grass_areas(builder, shore, config, rng)):
        name = f"{next(iter(area.species))}_{row + 1}"
        if area.radius > 0:
            meshes = make_clumps(area.species, name, area.radius, area.tufts_per_m2, few + 1, rng)
        else:
            meshes = _make_tufts(next(iter(area.species)), name, 2 * few, rng)
        spec = SwarmSpec(
            name=f"high_grass_{name}",
            kind="high_grass",
            meshes=meshes,
            per_m2=area.per_m2 * config.grass,
            scales=(0.75, 1.2),
            tilt=1.0,
            clear=0.3 + 0.7 * area.radius,
        )
        builder.scatter_swarm(spec, rng, area.density)


def _grass_areas(builder: WorldBuilder, shore: Shore, config: Config, rng: np.random.Generator) -> list[_GrassArea]:
    beds, swathe, thin = (noise_map(builder.size, wavelength, rng) for wavelength in (16.0, 9.0, 5.0))

    def depth(xy: Array) -> Array:
        return np.asarray(config.water_level - builder.field.height_at(*xy.T))

    def inland(xy: Array) -> Array:
        return shore.inland.at(*xy.T)

    def turf(xy: Array, start: float, thick: Array) -> Array:
        return np.asarray(np.clip(inland(xy) / 2.0 - start, 0, 1) * np.clip(thick, 0, 1))

    def reed(xy: Array) -> Array:
        return _within(depth(xy), -0.05, 0.5) * np.clip(2.0 * beds(xy) - 0.3, 0, 1)

    def cattail(xy: Array) -> Array:
        return _within(depth(xy), 0.02, 0.35) * np.clip(-1.5 * beds(xy) - 0.6, 0, 1)

    def sedge(xy: Array) -> Array:
        return _within(inland(xy), 0.45, 2.4) * np.clip(0.55 + 0.7 * thin(xy), 0, 1)

    return [
        _GrassArea({"reed": 1.0}, 0.5, 13.0, 1.6, reed),
        _GrassArea({"cattail": 1.0}, 0.35, 9.0, 1.2, cattail),
        _GrassArea({"sedge": 1.0}, 0.35, 7.0, 1.6, sedge),
        _GrassArea(
            {"meadow": 0.9, "dock": 0.1},
            0.9,
            9.0,
            0.55,
            lambda xy: turf(xy, 0.5, 0.3 + 0.7 * swathe(xy) + 0.25 * thin(xy)),
        ),
        _GrassArea(
            {"dry": 0.7, "meadow": 0.3},
            0.8,
            6.0,
            0.35,
            lambda xy: turf(xy, 2.0, -0.15 - 0.7 * swathe(xy) + 0.4 * thin(xy)),
        ),
        _GrassArea({"nettle": 1.0}, 0.7, 9.0, 0.45, lambda xy: turf(xy, 2.0, 1.3 * beds(xy) - 1.2)),
        _GrassArea({"meadow": 1.0}, 0.0, 1.0, 0.7, lambda xy: turf(xy, 0.5, 0.6 - 0.3 * swathe(xy))),
    ]


def _make_tufts(species: str, name: str, count: int, rng: np.random.Generator) -> list[Mesh]:
    """Single tufts from small to large."""
    grass = GRASSES[species]
    return [
        grow_tuft(grass, name=f"{name}_{k}", height=float(height), rng=rng, detail=TUFT_DETAIL)
        for k, height in enumerate(np.linspace(*grass.height, count))
    ]


def make_clumps(
    species: Mapping[str, float], name: str, radius: float, per_m2: float, count: int, rng: np.random.Generator
) -> list[Mesh]:
    """Clumps of ``radius`` [m] with ``per_m2`` tufts, mixed of species by their shares."""
    shares = {GRASSES[one]: share for one, share in species.items()}
    return [
        grow_clump(shares, name=f"{name}_{k}", radius=radius, per_m2=per_m2, rng=rng, detail=TUFT_DETAIL)
        for k in range(count)
    ]


def _within(value: Array, low: float, high: float) -> Array:
    """1 between two bounds, 0 outside."""
    return np.asarray((value > low) & (value < high), np.float64)
