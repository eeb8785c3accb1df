# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Plants of the forest: trees of all ages, bushes and grass where there is light, ferns in the shade, the understorey.

Each tree of the closed stand is where its crown catches most of the light that the others let pass. Crowns of real
stands grow into gaps and away from neighbours (Muth and Bazzaz 2003, from memory), so that they close the canopy;
crowns at random positions with the same leaf area leave a quarter of the ground without any.

Below the trees are natural regeneration, bilberry, brambles and fallen twigs. The forest is a woodrush beech forest
(Luzulo-Fagetum, habitat 9110) that was planted with spruce and pine and turns back: beech and spruce germinate in
groups where some light falls, thousands to the hectare; dwarf shrubs, ferns and grass cover a part of the acid soil,
needles and leaves the rest.

Beyond the world's edge are some rows of trees, and behind them the canopy over the hills.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Index, Mask
from fieldtruth.world.backdrop import Cover, Land, height_beyond, rolling_hills, scatter_beyond
from fieldtruth.world.environments.forest.config import Config
from fieldtruth.world.grids import distance_beyond, noise_map
from fieldtruth.world.model import Mesh, Raster
from fieldtruth.world.placement import Density, FarSwarm, ObjectGroup, WorldBuilder, random_tint
from fieldtruth.world.plants import TREES, grow_tree, grow_twigs

CELL: Final = 0.5  # [m]
EXTINCTION: Final = 0.5
"""Of leaves in all directions: light below is exp(-0.5 leaf area index) (Monsi and Saeki 1953, from memory)."""

LIGHT_BEYOND: Final = 0.3
"""Light that is left beyond the world's edge, where other trees stand."""

CHOICES: Final = 12
"""Free positions among which a tree has the best; more would make rows."""

ROUNDS: Final = 60
"""Sets of random positions that are drawn for a tree before the stand is full."""


class Stand:
    """The light that is left for further trees, from above, on a grid."""

    def __init__(self, builder: WorldBuilder) -> None:
        self._builder = builder
        self._inside = np.ceil(np.array(builder.size) / CELL).astype(int)
        self._margin = 24  # cells: half of the widest crown
        self._light = np.full(self._inside + 2 * self._margin, LIGHT_BEYOND)
        self._light[self._margin : -self._margin, self._margin : -self._margin] = 1.0

    def plant(self, group: ObjectGroup, rng: np.random.Generator, allowed: Callable[[Array], Mask]) -> None:
        """Add the trees of a group, in steps of 90 deg: the bounding box of a tall tree, which each passing ray enters,
        stays as narrow as the tree (7 to 11 % of the time for an image of a dense forest).

        Raises:
            CrowdedWorldError: too few positions are free.
        """
        turned = {mesh.name: _turned(_shade(mesh, self._margin)) for mesh in group.meshes}
        placed = []
        for number in range(group.count):
            mesh, scale = group.mesh(number), float(rng.uniform(*group.scales))
            free = self._free(mesh.footprint * scale, rng, allowed)
            if not len(free):
                break
            shades = turned[mesh.name]
            gains = np.stack([(self._window(xy) * shades).reshape(4, -1).sum(axis=1) for xy in free])
            best, turn = np.unravel_index(int(gains.argmax()), gains.shape)
            self._window(free[best])[...] *= 1.0 - shades[turn]
            tint = random_tint(rng, group.tint)
            pose = {"yaw": float(turn) * np.pi / 2, "scale": scale}
            placed.append(self._builder.add_upright(group.kind, mesh, free[best], **pose, tint=tint))
        group.check_complete(placed)

    def _free(self, radius: float, rng: np.random.Generator, allowed: Callable[[Array], Mask]) -> Array:
        """Up to ``CHOICES`` free positions (n, 2)."""
        found: list[Array] = []
        for _ in range(ROUNDS):
            darts = self._builder.random_positions(2 * CHOICES, rng)
            for xy in darts[allowed(darts)]:
                if self._builder.is_free(xy, radius):
                    found.append(xy)
                    if len(found) == CHOICES:
                        return np.array(found)
        return np.array(found).reshape(-1, 2)

    def _window(self, xy: Array) -> Array:
        """The light about a position, as wide as the shade of a crown."""
        i, j = np.rint((xy + np.array(self._builder.size) / 2) / CELL).astype(int)
        return self._light[i : i + 2 * self._margin, j : j + 2 * self._margin]


def _turned(shade: Array) -> Array:
    """The shade in the four steps of 90 deg (4, 2 half, 2 half)."""
    return np.stack([np.rot90(shade, k) for k in range(4)])


def _shade(mesh: Mesh, half: int) -> Array:
    """Share of the light from above that the mesh takes (2 half, 2 half) in the cells about its foot."""
    corner = mesh.vertices[mesh.faces].astype(np.float64)
    area = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    edges = CELL * np.arange(-half, half + 1)
    middle = corner[..., :2].mean(axis=1)
    index, _, _ = np.histogram2d(middle[:, 0], middle[:, 1], bins=[edges, edges], weights=area / CELL**2)
    return np.asarray(1.0 - np.exp(-EXTINCTION * index))


def plant_trees(builder: WorldBuilder, config: Config, growth: np.random.Generator, rng: np.random.Generator) -> None:
    """Plant old trees, then younger ones between them, each where some light is left, none on a trail."""
    stand = Stand(builder)
    counts = {"old": config.old_trees, "grown": config.grown_trees, "young": config.young_trees}
    total = sum(config.species.values())

    def off_trails(xy: Array) -> Mask:
        return builder.trail_distance(xy) > 0.55

    for age, left in counts.items():
        for k, (name, share) in enumerate(config.species.items()):
            count = left if k == len(config.species) - 1 else min(left, round(counts[age] * share / total))
            left -= count
            trees = config.planter.grow(age, growth, count=min(config.individuals, count), species=[name])
            if trees:
                group = ObjectGroup(kind=name, meshes=trees, count=count, scales=(0.88, 1.15), tint=0.1)
                stand.plant(group, rng, off_trails)


def plant_bushes(builder: WorldBuilder, config: Config, rng: np.random.Generator) -> None:
    """Plant hazel and bramble where trails and glades let light in."""

    def allowed(xy: Array) -> Mask:
        away = builder.trail_distance(xy)
        return (away > 0.9) & (rng.random(len(xy)) < np.exp(-away / 6.0))

    names = config.planter.species("bush")
    for k, name in enumerate(names):
        bushes = config.planter.grow("bush", rng, species=[name])
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

    planter = config.planter
    clumps = {group: planter.grow(group, rng) for group in ("grass", "nettles", "ferns")}
    grass_per_m2, ferns_per_m2 = config.grass_per_m2 / TUFTS_PER_M2, config.ferns_per_m2 / planter.tufts("ferns")
    builder.scatter_swarm(planter.swarm("forest_grass", clumps["grass"], per_m2=grass_per_m2), rng, grass)
    builder.scatter_swarm(planter.swarm("ferns", clumps["ferns"], per_m2=ferns_per_m2), rng, ferns)
    builder.scatter_swarm(planter.swarm("nettles", clumps["nettles"]), rng, nettles)


TUFTS_PER_M2: Final = 8.0
"""Density of tufts in a clump of grass."""
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

    planter = config.planter
    grown: dict[str, Sequence[Mesh]] = {name: planter.grow(name, rng) for name in ("seedlings", "bilberries")}
    grown["brambles"] = [replace(mesh, colliders=()) for mesh in planter.grow("brambles", rng)]  # a robot drives over
    grown["twigs"] = [grow_twigs(name=f"twigs_{k}", radius=0.8, count=TWIGS_PER_CLUMP, rng=rng) for k in range(6)]
    swarms: tuple[tuple[str, float, Density], ...] = (
        ("seedlings", config.seedlings_per_m2 / SEEDLINGS_PER_TUFT / planter.tufts("seedlings"), groups),
        ("bilberries", config.bilberries_per_m2 / planter.tufts("bilberries"), mats),
        ("brambles", config.brambles_per_m2, light),
        ("twigs", config.twigs_per_m2 / TWIGS_PER_CLUMP, lambda xy: off_trails(xy, 0.1)),
    )
    for name, wanted, density in swarms:
        per_m2 = _before_thinning(wanted, density, builder)
        builder.scatter_swarm(planter.swarm(name, grown[name], per_m2=per_m2), rng, density)
    saplings, per_m2 = _saplings(rng), _before_thinning(config.saplings_per_m2, groups, builder)
    builder.scatter_swarm(planter.swarm("saplings", saplings, per_m2=per_m2), rng, groups)


def _before_thinning(per_m2: float, density: Density, builder: WorldBuilder) -> float:
    """Density of positions of which ``density`` leaves about ``per_m2`` in the mean over the world; at most 20."""
    axes = (np.arange(-s / 2 + 0.5, s / 2, 1.0) for s in builder.size)
    mean = float(density(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)).mean())
    return min(per_m2 / max(mean, 1e-3), 20.0)


def _saplings(rng: np.random.Generator) -> list[Mesh]:
    names = [f"{species}_{k}" for species, count in SAPLINGS.items() for k in range(count)]
    scales = rng.permutation(np.geomspace(*SAPLING_SCALES, len(names)))
    return [_sapling(name, float(scale), rng) for name, scale in zip(names, scales, strict=True)]


def _sapling(name: str, scale: float, rng: np.random.Generator) -> Mesh:
    species = TREES[name.rpartition("_")[0]]
    tree = grow_tree(species, name=f"sapling_{name}", height=SAPLING_HEIGHT, rng=rng, detail=scale**2)
    vertices = np.float32(scale) * tree.vertices
    return replace(tree, vertices=vertices, footprint=scale * tree.footprint, colliders=())


FAR_TREES: Final = 12.0
"""Distance [m] from the edge within which single trees stand; behind them the canopy closes the view."""


def canopy(size: tuple[float, float], rng: np.random.Generator) -> Land:
    """Level ground below the trees, then a step of 14 m up to the canopy, over hills that rise to the horizon."""
    hills = rolling_hills(size, rng, height=16.0)
    waves = [
        (*rng.normal(0.0, 0.5 / length, 2), rng.uniform(0, 6.3), 0.16 * length**0.7)
        for length in rng.uniform(2.0, 14.0, 24)
    ]

    def land(x: Array, y: Array) -> Array:
        outside = distance_beyond(size, x, y)
        bumps = sum(height * np.cos(6.3 * (kx * x + ky * y) + phase) for kx, ky, phase, height in waves)
        roof = 13.0 + 0.25 * np.minimum(outside - FAR_TREES, 40.0) + bumps
        return np.asarray(hills(x, y) + np.where(outside > FAR_TREES + 1.0, roof, 0.0))

    return land


def far_cover(size: tuple[float, float]) -> Cover:
    """Forest floor below the trees, canopy behind them."""

    def cover(x: Array, y: Array, slope: Array) -> Index:
        return (distance_beyond(size, x, y) > FAR_TREES - 1.0).astype(np.intp)

    return cover


def scatter_far_trees(
    builder: WorldBuilder, config: Config, backdrop: Mesh, growth: np.random.Generator, rng: np.random.Generator
) -> list[FarSwarm]:
    """Trees of little detail around the world, with young ones at the edge."""
    planter = config.planter
    trees = planter.swarm("far_trees", planter.grow("far", growth, species=config.species))
    young = planter.swarm("far_young_trees", planter.grow("far_young", growth))
    ground = height_beyond(builder.field, config.size, backdrop)
    return [
        scatter_beyond(config.size, ground, trees, rng, within=FAR_TREES, margin=0.8),
        scatter_beyond(config.size, ground, young, rng, within=10.0, margin=0.8),
    ]
