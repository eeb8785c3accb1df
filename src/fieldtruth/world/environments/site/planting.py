# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Plants of a site: the trees of its maps, hedges, orchards, scrub, heath and wetland, and what grows between them.

A tree stands where the map has it, with its height; of some individuals of its species the one is taken whose crown is
nearest in width for its height, in a copy as wide and as thick as the tree. Both go by steps, so that fifty thousand
trees are a few hundred meshes.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.progress import Advance
from fieldtruth.maps.osm import Feature
from fieldtruth.world.environments.site.config import Config
from fieldtruth.world.environments.site.sources import Stem, along, filled
from fieldtruth.world.environments.site.structures import Gaps
from fieldtruth.world.environments.site.surfaces import LandUse
from fieldtruth.world.grids import noise_map
from fieldtruth.world.model import Mesh, Raster, water_at
from fieldtruth.world.placement import Density, SwarmSpec, WorldBuilder, jittered_grid, random_tint
from fieldtruth.world.plants import TREES, grow_tree
from fieldtruth.world.plants.species import GrownIn, heights_of
from fieldtruth.world.plants.trees import COLLIDER

HEIGHTS: Final = 1.3
"""Ratio of the heights of a species' meshes, of which a tree takes the nearest."""
SCRUB: Final = 0.35
"""Bushes to the square metre of scrub, before those that have no room are left out."""
HEDGE: Final = 0.75
"""Distance [m] between the plants of a hedge, and its height where the map says nothing is twice that."""
MOST, NEAR = 150_000, 20.0
"""Members of a swarm, about, from which it thins out away from trails, and the distance [m] over which it does."""
TUFTS: Final = 4.0
"""Tufts that a clump of grass counts for; it has more, which overlap with those around it."""
WITHIN: Final = 0.9
"""Share of a crown's leaves, seen from above, that are within its radius; some branches reach out of any crown."""
WIDTHS: Final = (1.2, 1.9)
"""Ratio of the widths of a tree's copies, and the greatest factor by which one is wider or slimmer than it grew."""
THICK: Final = (1.2, 2.2)
"""As ``WIDTHS``, of the thickness of trunks."""
LEAST: Final = 3.0
"""Height [m] below which a tree's trunk is as thick as it grew: at breast height there is little of it."""
CLEAR: Final = 0.3
"""Distance [m] from a trunk to the rim of its footprint, at least; see ``grow_tree``."""
BREAST: Final = 1.3  # [m]
AXIS: Final = 0.5
"""Step [m] of height in which the middle of a trunk is followed."""
TRUNK: Final = 0.2
"""Radius [m] of a trunk that must not stand in a building or a wall."""
SHORE: Final = 0.05
"""Height [m] above the water from which land plants grow."""


class _Individual(NamedTuple):
    """A grown tree: its height, the radius about the trunk that holds ``WITHIN`` of its vertices, and that of the trunk
    at breast height [m].
    """

    mesh: Mesh
    height: float
    crown: float
    trunk: float


def plant_trees(
    builder: WorldBuilder, stems: Sequence[Stem], config: Config, rng: np.random.Generator, advance: Advance
) -> None:
    """Plant the trees of the map that are within the world, on dry land; ``advance`` hears of each."""
    half = np.array(config.size) / 2 - 0.5
    grown: dict[tuple[str, int], list[_Individual]] = {}
    shaped: dict[str, _Individual] = {}
    stems = sorted(stems, key=lambda stem: -stem.height)
    at = np.array([(stem.x, stem.y) for stem in stems]).reshape(-1, 2)
    stands = (np.abs(at) <= half).all(axis=1) & dry(builder, at)
    stands &= np.array([not is_taken(builder, xy, TRUNK) for xy in at], np.bool_)
    for number, stem in enumerate(stems, 1):
        if number % 500 == 0:
            advance(500)
        if not stands[number - 1]:
            continue
        step = round(np.log(stem.height) / np.log(HEIGHTS))
        key = stem.species, step
        if key not in grown:
            grown[key] = _individuals(stem.species, step, config.individuals, rng)
        choice = _shaped(shaped, _best(grown[key], stem), stem)
        pose = {"yaw": float(rng.uniform(0.0, 2.0 * np.pi)), "scale": stem.height / choice.height}
        builder.add_upright(stem.species, choice.mesh, (stem.x, stem.y), **pose, tint=random_tint(rng, 0.1))


def _individuals(species: str, step: int, count: int, rng: np.random.Generator) -> list[_Individual]:
    """Trees of a species and of about ``HEIGHTS**step`` [m], grown in the open and in a stand."""
    kind, height, grown = TREES[species], HEIGHTS**step, []
    ways: tuple[GrownIn, ...] = ("open", "stand")
    for way in ways:
        low, high = heights_of(kind, height, way)
        own = min(max(height, low), high)
        for k in range(count):
            name = f"{species}_{way}_{step}_{k}"
            detail = float(np.clip(3.0 / height, 0.14, 1.0))
            mesh = grow_tree(kind, name=name, height=own, rng=rng, detail=detail, grown_in=way)
            crown = float(np.quantile(np.hypot(*mesh.vertices[:, :2].T), WITHIN))
            trunk = mesh.colliders[0].size[0] / COLLIDER
            grown.append(_Individual(mesh, float(mesh.vertices[:, 2].max()), crown, trunk))
    return grown


def _best(grown: Sequence[_Individual], stem: Stem) -> _Individual:
    """The one whose crown at the height of a tree is the nearest in width; any if that is not known."""
    if np.isnan(stem.crown):
        return grown[abs(hash_of(stem)) % len(grown)]
    wanted = max(stem.crown, 0.3) / stem.height
    return min(grown, key=lambda each: abs(np.log(each.crown / each.height / wanted)))


def _shaped(known: dict[str, _Individual], tree: _Individual, stem: Stem) -> _Individual:
    """A copy whose crown and trunk have about the width and the thickness of a tree's, where these are known."""
    size = stem.height / tree.height
    wide = 0 if np.isnan(stem.crown) else _step(max(stem.crown, 0.3) / (size * tree.crown), WIDTHS)
    known_trunk = not np.isnan(stem.diameter) and stem.height >= LEAST
    thick = _step(stem.diameter / (2.0 * size * tree.trunk), THICK) if known_trunk else 0
    name = tree.mesh.name + (f"_w{wide}" if wide else "") + (f"_t{thick}" if thick else "")
    if name != tree.mesh.name and name not in known:
        factor, ratio, joints = WIDTHS[0] ** wide, THICK[0] ** thick, tree.mesh.joints
        vertices = tree.mesh.vertices.astype(np.float64)
        if wide:
            vertices = widened(vertices, tree.trunk, factor)
            joints = (
                None if joints is None else widened(joints.astype(np.float64), tree.trunk, factor).astype(np.float32)
            )
        if thick:
            vertices = thickened(vertices, tree.trunk, ratio)
        colliders = tuple(replace(c, size=(ratio * c.size[0], *c.size[1:])) for c in tree.mesh.colliders)
        footprint = max(tree.mesh.footprint, colliders[0].size[0] + CLEAR)
        mesh = replace(tree.mesh, name=name, vertices=vertices.astype(np.float32), joints=joints, colliders=colliders)
        known[name] = tree._replace(mesh=replace(mesh, footprint=footprint))
    return known.get(name, tree)


def _step(ratio: float, steps: tuple[float, float]) -> int:
    """Number of steps, of which the first is a factor and the second the greatest one, to a ratio."""
    return round(float(np.log(np.clip(ratio, 1.0 / steps[1], steps[1])) / np.log(steps[0])))


def widened(points: Array, radius: float, factor: float) -> Array:
    """Points (n, 3) [m] of a tree, with a trunk of a radius [m], whose crown is ``factor`` times as wide."""
    away = np.hypot(*points[:, :2].T) / (COLLIDER * radius)
    scale = 1.0 + (factor - 1.0) * np.clip(away - 1.5, 0.0, 1.0)
    return np.column_stack([points[:, :2] * scale[:, None], points[:, 2]])


def thickened(vertices: Array, radius: float, ratio: float) -> Array:
    """Vertices (n, 3) [m] of a tree whose trunk of a radius [m] at breast height is ``ratio`` times as thick.

    What is within 1.2 radii of the trunk's middle moves with its surface; what is far from it stays.
    """
    top = float(vertices[:, 2].max())
    reach = max(2.4, 1.8 * ratio)
    heights, middle = np.arange(0.0, top + AXIS, AXIS), [np.zeros(2)]
    for z in heights[1:]:
        reached = 1.5 * float(_taper(z, top, radius))
        near = vertices[np.abs(vertices[:, 2] - z) < AXIS, :2] - middle[-1]
        near = near[np.hypot(*near.T) < reached]
        middle.append(middle[-1] + (near.mean(axis=0) if len(near) > 5 else 0.0))
    axis = np.stack([np.interp(vertices[:, 2], heights, np.array(middle)[:, k]) for k in (0, 1)], axis=-1)
    own = _taper(vertices[:, 2], top, radius)
    away = np.hypot(*(vertices[:, :2] - axis).T) / own
    moved = np.interp(away, [0.0, 1.2, reach], [0.0, 1.2 * ratio, reach])
    grown = np.where(away < reach, moved / np.maximum(away, 1e-9), 1.0)[:, None]
    return np.column_stack([axis + (vertices[:, :2] - axis) * grown, vertices[:, 2]])


def _taper(z: Array | float, top: float, radius: float) -> Array:
    """Radius [m] at heights z [m] of a trunk that is a cone with a ``radius`` at breast height."""
    return np.asarray(radius * np.clip((top - z) / (top - BREAST), 0.1, 1.5))


def hash_of(stem: Stem) -> int:
    """A number that depends on the position of a tree, to the centimetre, and on nothing else."""
    return round(100 * stem.x) * 73_856_093 ^ round(100 * stem.y) * 19_349_663


def dry(builder: WorldBuilder, xy: Array) -> Mask:
    """Mask (n,) of the positions (n, 2) [m] that are above the water."""
    if builder.water_level is None:
        return np.ones(len(xy), np.bool_)
    return np.asarray(builder.field.height_at(*xy.T) > water_at(builder.water_level, *xy.T) + SHORE)


def plant_hedges(
    builder: WorldBuilder, features: Iterable[Feature], gaps: Gaps, config: Config, rng: np.random.Generator
) -> None:
    """Plant hedges along their lines or in their areas, with gaps at gates and trails."""
    hedges = [each for each in features if each.kind == "hedge"]
    bushes = config.planter.grow("hedge", rng) if hedges else []
    for hedge in hedges:
        places = filled(hedge, HEDGE) if hedge.closed else along(hedge.geometry, HEDGE)
        height = hedge.height or 2.0 * HEDGE
        for xy in places:
            mesh = bushes[int(rng.integers(len(bushes)))]
            scale = height / float(mesh.vertices[:, 2].max()) * float(rng.uniform(0.9, 1.1))
            free = (np.abs(xy) < np.array(builder.size) / 2 - 0.5).all() and not gaps.at(xy)
            if free and not is_taken(builder, xy, 0.2):
                turn = float(rng.uniform(0.0, 2.0 * np.pi))
                builder.add_upright("bush", mesh, xy, yaw=turn, scale=scale, tint=random_tint(rng, 0.08))


def is_taken(builder: WorldBuilder, xy: Array, radius: float) -> bool:
    """Whether something but a bush or another neighbour in a row, which may touch, stands at a position."""
    x, y = xy.tolist()
    return any(np.hypot(x - a, y - b) < radius + 0.4 * r for a, b, r in builder.taken.about(x, y, radius))


def plant_scrub(builder: WorldBuilder, land: LandUse, config: Config, rng: np.random.Generator) -> None:
    """Plant bushes in scrub, in thickets, and a few on heath."""
    if not {"scrub", "heath"} & set(land.names):
        return
    bushes, thicket = config.planter.grow("bush", rng), noise_map(config.size, 9.0, rng)

    def density(xy: Array) -> Array:
        clumped = np.clip(0.6 + 0.6 * thicket(xy), 0.05, 1.0)
        return np.asarray(clumped * (land.is_(xy, "scrub") + 0.06 * land.is_(xy, "heath")) * dry(builder, xy))

    for xy in jittered_grid(np.array(config.size), SCRUB, rng, density):
        mesh, scale = bushes[int(rng.integers(len(bushes)))], float(rng.uniform(0.6, 1.15))
        if builder.trail_distance(xy[None])[0] > 0.3 and builder.is_free(xy, 0.55 * mesh.footprint * scale):
            turn = float(rng.uniform(0.0, 2.0 * np.pi))
            builder.add_upright("bush", mesh, xy, yaw=turn, scale=scale, tint=random_tint(rng, 0.1))


def plant_herbs(builder: WorldBuilder, config: Config, land: LandUse, shade: Raster, rng: np.random.Generator) -> None:
    """Scatter grass in the open, ferns, seedlings, bilberry and brambles below trees, heather and reeds in their areas.

    Grass is mown on lawns and in orchards, and sparse on fields; it is high beside the trails of a meadow.
    """
    patch, thick = noise_map(config.size, 9.0, rng), noise_map(config.size, 4.0, rng)

    def on_land(xy: Array) -> Mask:
        return (builder.trail_distance(xy) > 0.1) & dry(builder, xy)

    def use(xy: Array, **shares: float) -> Array:
        """Share by the use of the land, 1 of uses that are not named."""
        total = np.ones(len(xy))
        for name, share in shares.items():
            total[land.is_(xy, name)] = share
        return total

    def grass(xy: Array) -> Array:
        open_ = 1.0 - 0.75 * shade.at(*xy.T)
        kept = use(xy, lawn=0.0, grass=0.0, orchard=0.1, farmland=0.04, soil=0.04, heath=0.35, wood=0.5, wetland=0.5,
                   sand=0.05, bare_rock=0.05, scree=0.05, forest_floor=0.4)  # fmt: skip
        return np.asarray(np.clip(0.6 + 0.4 * patch(xy) + 0.2 * thick(xy), 0.1, 1.0) * open_ * kept * on_land(xy))

    def below(xy: Array, centre: float, width: float) -> Array:
        wild = use(xy, lawn=0.1, grass=0.1, orchard=0.0, farmland=0.0, soil=0.2)
        dark = shade.at(*xy.T)
        edge = np.clip(dark / 0.15, 0.03, 1.0)  # hardly any in the open
        return np.asarray(np.exp(-(((dark - centre) / width) ** 2)) * edge * wild * on_land(xy))

    densities: dict[str, Density] = {
        "herbs": lambda xy: below(xy, 0.6, 0.5) * np.clip(0.5 + 0.5 * patch(xy), 0.05, 1.0),
        "seedlings": lambda xy: (shade.at(*xy.T) > 0.3) * below(xy, 0.8, 0.5) * np.clip(thick(xy) - 0.2, 0.0, 1.0),
        "bilberries": lambda xy: (shade.at(*xy.T) > 0.3) * below(xy, 0.9, 0.4) * np.clip(-1.5 * patch(xy), 0.0, 1.0),
        "brambles": lambda xy: below(xy, 0.5, 0.25) * np.clip(0.5 + 0.5 * thick(xy), 0.0, 1.0),
        "heather": lambda xy: np.clip(0.7 + 0.5 * thick(xy), 0.0, 1.0) * (land.is_(xy, "heath") & on_land(xy)),
        "reeds": lambda xy: _wet(builder, land, xy) * np.clip(0.5 + 0.6 * patch(xy), 0.0, 1.0),
    }
    planter = config.planter
    if config.grass_per_m2:
        swarm = planter.swarm("grass", planter.grow("grass", rng), per_m2=config.grass_per_m2 / TUFTS)
        _scatter(builder, swarm, grass, rng)
    needs = {"heather": "heath" in land.names, "reeds": builder.water_level is not None or "wetland" in land.names}
    for name, density in densities.items():
        if needs.get(name, True):
            _scatter(builder, planter.swarm(name, planter.grow(name, rng)), density, rng)


def _scatter(builder: WorldBuilder, spec: SwarmSpec, density: Density, rng: np.random.Generator) -> None:
    """Scatter a swarm; in a large world it is as dense as in a small one beside the trails only."""
    share = min(1.0, MOST / (spec.per_m2 * builder.size[0] * builder.size[1]))

    def thinned(xy: Array) -> Array:
        near = np.exp(-((np.maximum(builder.trail_distance(xy), 0.0) / NEAR) ** 2))
        return np.asarray(density(xy) * np.maximum(share, near))

    builder.scatter_swarm(spec, rng, density if share == 1.0 else thinned)


def _wet(builder: WorldBuilder, land: LandUse, xy: Array) -> Array:
    """Share of reeds: in wetland, and in shallow water."""
    depth = water_at(builder.water_level, *xy.T) - builder.field.height_at(*xy.T)
    return np.asarray(np.maximum(land.is_(xy, "wetland"), (depth > 0.0) & (depth < 0.4)), np.float64)
