# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What grows on a lake's shore, each kind where it belongs: by the distance to the water and in groves and swathes."""

from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.world.backdrop import Land, strew_beyond
from fieldtruth.world.environments.power_line import PowerLine
from fieldtruth.world.environments.shore import Shore
from fieldtruth.world.grids import grid_axes
from fieldtruth.world.model import Mesh, Raster, Swarm
from fieldtruth.world.noise import fractal_noise
from fieldtruth.world.placement import Site, random_tints, upright_poses
from fieldtruth.world.plants import BUSHES, GRASSES, TREES, grow_bush, grow_clump, grow_tree, grow_tuft

Density = Callable[[Array], Array]
"""Share [0, 1] of what may grow at places (n, 2), or noise about 0 that tells thick places from thin ones."""

WATERSIDE_TREES: Final = {"alder": (7.0, 11.0), "willow": (5.5, 9.0)}  # height [m], least and greatest
MEADOW_TREES: Final = {"birch": (7.0, 12.0), "pine": (8.0, 14.0), "oak": (7.0, 11.0)}
WATERSIDE_BUSHES: Final = ("grey_willow",)
MEADOW_BUSHES: Final = ("hazel", "bramble")

BELOW_WIRES: Final = 3.4  # [m] from the line to the nearest trunk
TREE_DETAIL: Final = 0.6
FAR_DETAIL: Final = 0.06
BEYOND_DETAIL: Final = 0.25
FAR_REACH: Final = 380.0  # [m] from the middle to the last trees
TUFT_DETAIL: Final = 0.55


def plant_trees(
    site: Site, shore: Shore, line: PowerLine, waterside: int, meadow: int, individuals: int,
    growth: np.random.Generator, rng: np.random.Generator,
) -> None:  # fmt: skip
    """Alders and willows near the water with views between them, groves in the meadow, none below the wires.

    ``individuals`` of each species are grown and shared by all.
    """
    grove = patches(site.size, 17.0, rng)
    for kind, sorts, count, (low, high) in (
        ("waterside_tree", WATERSIDE_TREES, waterside, (0.9, 6.0)),
        ("meadow_tree", MEADOW_TREES, meadow, (8.5, 99.0)),
    ):
        trees = [
            grow_tree(
                TREES[name], name=f"{kind}_{name}_{k}", height=float(growth.uniform(*heights)), rng=growth,
                detail=1.0 if name == "pine" else TREE_DETAIL,  # few sprays of needles read as stars
            )
            for k in range(individuals)
            for name, heights in sorts.items()
        ]  # fmt: skip

        def allowed(places: Array, low: float = low, high: float = high) -> NDArray[np.bool_]:
            inland, thick = shore.inland.at(*places.T), grove(places)
            return (inland > low) & (inland < high) & (thick > -0.1) & (line.distance(places) > BELOW_WIRES)

        site.scatter(
            kind, trees, count, rng=rng, allowed=allowed, spacing=4.2, scales=(0.85, 1.15), tint=0.08, tries=9000
        )


def plant_bushes(
    site: Site, shore: Shore, waterside: int, meadow: int, individuals: int, rng: np.random.Generator
) -> None:
    """Grey willows along the water, hazel and brambles in the meadow, in thickets."""
    thicket = patches(site.size, 12.0, rng)
    for kind, names, count, (low, high) in (
        ("waterside_bush", WATERSIDE_BUSHES, waterside, (0.6, 7.0)),
        ("meadow_bush", MEADOW_BUSHES, meadow, (5.0, 99.0)),
    ):
        bushes = [
            grow_bush(
                BUSHES[name], name=f"bush_{name}_{k}", rng=rng,
                height=BUSHES[name].grown.height * float(rng.uniform(0.6, 1.15)),
            )
            for k in range(individuals)
            for name in names
        ]  # fmt: skip

        def allowed(places: Array, low: float = low, high: float = high) -> NDArray[np.bool_]:
            inland = shore.inland.at(*places.T)
            return (inland > low) & (inland < high) & (thicket(places) > -0.5)

        site.scatter(kind, bushes, count, rng=rng, allowed=allowed, scales=(0.75, 1.15), tint=0.1, tries=9000)


def sow_grass(
    site: Site, shore: Shore, water_level: float, share: float, individuals: int, rng: np.random.Generator
) -> None:
    """Reeds and cattails stand in the shallow water, sedges along it, long grass and herbs in swathes of the meadow."""
    beds, swathe, thin = (patches(site.size, wavelength, rng) for wavelength in (16.0, 9.0, 5.0))

    def depth(p: Array) -> Array:
        return np.asarray(water_level - site.field.height_at(*p.T))

    def inland(p: Array) -> Array:
        return shore.inland.at(*p.T)

    def turf(p: Array, start: float, thick: Array) -> Array:
        return np.asarray(np.clip(inland(p) / 2.0 - start, 0, 1) * np.clip(thick, 0, 1))

    # Kinds by share; radius [m] of a clump, 0 for single tufts; tufts per m2 of a clump; clumps or tufts per m2; where.
    sowing: tuple[tuple[dict[str, float], float, float, float, Density], ...] = (
        ({"reed": 1.0}, 0.5, 13.0, 1.6, lambda p: _within(depth(p), -0.05, 0.5) * np.clip(2.0 * beds(p) - 0.3, 0, 1)),
        (
            {"cattail": 1.0},
            0.35,
            9.0,
            1.2,
            lambda p: _within(depth(p), 0.02, 0.35) * np.clip(-1.5 * beds(p) - 0.6, 0, 1),
        ),
        ({"sedge": 1.0}, 0.35, 7.0, 1.6, lambda p: _within(inland(p), 0.45, 2.4) * np.clip(0.55 + 0.7 * thin(p), 0, 1)),
        ({"meadow": 0.9, "dock": 0.1}, 0.9, 9.0, 0.55, lambda p: turf(p, 0.5, 0.3 + 0.7 * swathe(p) + 0.25 * thin(p))),
        ({"dry": 0.7, "meadow": 0.3}, 0.8, 6.0, 0.35, lambda p: turf(p, 2.0, -0.15 - 0.7 * swathe(p) + 0.4 * thin(p))),
        ({"nettle": 1.0}, 0.7, 9.0, 0.45, lambda p: turf(p, 2.0, 1.3 * beds(p) - 1.2)),
        ({"meadow": 1.0}, 0.0, 1.0, 0.7, lambda p: turf(p, 0.5, 0.6 - 0.3 * swathe(p))),
    )
    for row, (kinds, radius, tufts_per_m2, per_m2, density) in enumerate(sowing):
        name = f"{next(iter(kinds))}_{row + 1}"
        if radius > 0:
            meshes = _clumps(kinds, name, radius, tufts_per_m2, individuals, rng)
        else:
            meshes = _tufts(kinds, name, individuals, rng)
        site.strew(
            f"high_grass_{name}", "high_grass", meshes, per_m2=per_m2 * share, rng=rng, density=density, tilt=1.0,
            scales=(0.75, 1.2), clear=0.3 + 0.7 * radius,
        )  # fmt: skip


def _tufts(kinds: Mapping[str, float], name: str, individuals: int, rng: np.random.Generator) -> list[Mesh]:
    """Single tufts of the one kind, from small to large."""
    (kind,) = (GRASSES[n] for n in kinds)
    heights = np.linspace(*kind.height, 2 * individuals)
    return [
        grow_tuft(kind, name=f"{name}_{k}", height=float(height), rng=rng, detail=TUFT_DETAIL)
        for k, height in enumerate(heights)
    ]


def _clumps(
    kinds: Mapping[str, float], name: str, radius: float, per_m2: float, individuals: int, rng: np.random.Generator
) -> list[Mesh]:
    shares = {GRASSES[kind]: share for kind, share in kinds.items()}
    return [
        grow_clump(shares, name=f"{name}_{k}", radius=radius, per_m2=per_m2, rng=rng, detail=TUFT_DETAIL)
        for k in range(individuals + 1)
    ]


def grow_beyond(
    site: Site, backdrop: Mesh, basin: Land, line: PowerLine, water_level: float, rng: np.random.Generator
) -> list[tuple[Swarm, Sequence[Mesh]]]:
    """What grows beyond the edge: groves and grass near it, woods along the far shore and up its hills."""
    sorts = {**WATERSIDE_TREES, **MEADOW_TREES}
    woods, trees = (
        [
            grow_tree(TREES[n], name=f"{name}_{n}_{k}", height=float(rng.uniform(*heights)), rng=rng, detail=detail)
            for k in range(2)
            for n, heights in sorts.items()
        ]
        for name, detail in (("far", FAR_DETAIL), ("beyond", BEYOND_DETAIL))
    )
    grass = _clumps({"meadow": 0.7, "dry": 0.3}, "far_grass", 0.7, 7.0, 2, rng)
    reach = (900.0, 900.0)
    grove, wood = patches(reach, 45.0, rng), patches(reach, 110.0, rng)

    def above(places: Array) -> Array:
        return np.asarray(basin(*places.T) - water_level)

    def near(places: Array) -> Array:
        height, thick = above(places), grove(places)
        stands = ((height > 0.5) & (height < 1.6) & (thick > 0.1)) | ((height > 2.0) & (thick > 0.35))
        return (stands & (line.distance(places) > BELOW_WIRES + 1.0)).astype(np.float64)

    def turf(places: Array) -> Array:
        return np.asarray((above(places) > 0.8) * np.clip(0.45 + 0.4 * grove(places), 0.0, 1.0))

    field, size = site.field, site.size
    return [
        strew_beyond(
            field, size, backdrop, "high_grass_beyond", "high_grass", grass, per_m2=0.9, rng=rng, within=14.0,
            margin=0.6, density=turf, tilt=1.0,
        ),
        strew_beyond(
            field, size, backdrop, "trees_beyond", "tree", trees, per_m2=0.035, rng=rng, within=90.0, margin=3.0,
            density=near, scales=(0.55, 1.3), sink=0.1,
        ),
        _far_woods(woods, basin, water_level, grove, wood, rng),
    ]  # fmt: skip


def _far_woods(
    trees: Sequence[Mesh], basin: Land, water_level: float, grove: Density, wood: Density, rng: np.random.Generator
) -> tuple[Swarm, Sequence[Mesh]]:
    """Trees in a belt along the far water and in woods above it, where the land is the basin's own."""
    cells = np.stack(np.meshgrid(np.arange(-FAR_REACH, FAR_REACH, 7.0), np.arange(-FAR_REACH, FAR_REACH, 7.0)), axis=-1)
    places = cells.reshape(-1, 2) + rng.uniform(0.0, 7.0, (cells.size // 2, 2))
    height = basin(*places.T)
    above, away = height - water_level, np.hypot(*places.T)
    thick = np.where(above < 3.2, 0.75 + 0.3 * grove(places), 0.45 + 0.5 * wood(places))
    stands = (above > 0.3) & (away > 115.0) & (away < FAR_REACH) & (rng.random(len(places)) < np.clip(thick, 0.04, 1))
    places, height = places[stands], height[stands]
    n = len(places)
    scale = np.exp(rng.uniform(np.log(0.6), np.log(1.4), n))
    poses = upright_poses(places, rng.uniform(0.0, 2 * np.pi, n), scale)
    poses[:, 2, 3] = height - 0.4  # the land's triangles are wide there
    swarm = Swarm(
        name="woods_beyond", kind="tree", object_id=0, meshes=tuple(mesh.name for mesh in trees),
        mesh=rng.integers(len(trees), size=n).astype(np.int32), world_from_object=poses,
        tint=random_tints(rng, 0.12, n),
    )  # fmt: skip
    return swarm, trees


def patches(size: tuple[float, float], wavelength: float, rng: np.random.Generator) -> Density:
    """Noise about the origin over an area (along x, along y) [m]: above 0 is thick, below is thin."""
    spacing = wavelength / 16
    x, y = grid_axes(size, spacing)
    values = fractal_noise(x, y, wavelength=wavelength, octaves=3, rng=rng).astype(np.float32)
    raster = Raster(values=values, spacing=float(x[1] - x[0]), x0=float(x[0]), y0=float(y[0]))
    return lambda places: raster.at(*places.T)


def _within(value: Array, low: float, high: float) -> Array:
    """1 between two bounds, 0 beyond them."""
    return np.asarray((value > low) & (value < high), np.float64)
