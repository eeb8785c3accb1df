# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What lies and sprouts on the ground: leaves, twigs, cones, stones, tufts of short grass, as patches of shared meshes.

Patches lie on the surface that rays meet, in its mean slope. They have the class of the ground they lie on: those of a
trail lie wholly on it, the others wholly beside. Wheels do not feel them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array
from fieldtruth.world.litter_shapes import SHAPES
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import LITTER, Mesh, Swarm, Terrain
from fieldtruth.world.placement import WorldBuilder
from fieldtruth.world.plants.meshing import merged
from fieldtruth.world.poses import random_tints, rotations_to, upright_poses
from fieldtruth.world.swarms import jittered_grid

VARIANTS: Final = 6
"""Patches of each cover; with four quarter turns each is seen in 24 poses."""
NEAR: Final = 5.0
"""Distance [m] from a trail or a corridor within which there are most patches."""
FAR_SHARE: Final = 0.25
"""Share of the patches that remains far from them."""
MOST_AREA: Final = 20_000.0
"""Area [m^2] of a world from which the number of patches stops growing."""
UNDER_TREES: Final = 3.0
"""Distance [m] from a trunk over which fallen leaves become few."""
_TREE: Final = 2.5  # [m] least height
_AT_EDGE: Final = 0.3  # [m] from a trail's edge
_TINT: Final = 0.13
_SCALE: Final = 0.2  # greatest logarithm of a patch's scale
_SAMPLES: Final = 12  # of the surface below a patch
_BEARING: Final = 0.75


@dataclass(frozen=True)
class Item:
    """Leaves, stones or the like in a patch: least and greatest size [m], small ones more frequent; number per m2."""

    shape: str
    material: str
    sizes: tuple[float, float]
    per_m2: float


@dataclass(frozen=True)
class Cover:
    """Patches of items on a type of ground."""

    per_m2: float
    items: tuple[Item, ...]
    radius: float = 0.2  # [m]
    where: Literal["everywhere", "under trees", "at edges"] = "everywhere"


_LEAVES: Final = (Item("leaves", "leaf", (0.025, 0.1), 24.0), Item("leaves", "leaf_grey", (0.025, 0.07), 14.0))
_TWIGS: Final = Item("twigs", "twig", (0.05, 0.3), 7.0)
_FLOOR: Final = (
    *_LEAVES, _TWIGS, Item("stems", "straw", (0.03, 0.09), 30.0),
    Item("cones", "cone", (0.03, 0.09), 2.0), Item("flakes", "bark", (0.02, 0.08), 9.0),
)  # fmt: skip
_FALLEN: Final = Cover(5.0, (*_LEAVES, Item("twigs", "twig", (0.05, 0.2), 4.0)), where="under trees")
_TUFTS: Final = (Item("blades", "blade", (0.035, 0.1), 26.0), Item("blades", "straw", (0.03, 0.09), 12.0))
_GRAVEL: Final = Item("stones", "stone", (0.006, 0.035), 55.0)

LITTER_BY_GROUND: Final[Mapping[str, tuple[Cover, ...]]] = {
    "lawn": (
        Cover(
            3.0,
            (*_TUFTS, Item("clover", "clover", (0.008, 0.014), 22.0), Item("flowers", "daisy", (0.01, 0.02), 1.0)),
        ),
        _FALLEN,
    ),
    "leaf_litter": (Cover(3.6, _FLOOR),),
    "dry_grass": (Cover(3.0, (*_TUFTS, Item("stems", "straw", (0.05, 0.16), 30.0))), _FALLEN),
    "meadow": (Cover(3.0, (*_TUFTS, Item("stems", "straw", (0.05, 0.2), 24.0))), _FALLEN),
    "forest_floor": (Cover(4.0, _FLOOR),),
    "moss": (Cover(2.4, (*_LEAVES, _TWIGS, Item("flakes", "bark", (0.02, 0.06), 6.0))),),
    "mulch": (Cover(3.0, (Item("flakes", "bark", (0.02, 0.07), 70.0), _TWIGS)),),
    "earth": (
        Cover(2.4, (Item("stones", "stone", (0.006, 0.03), 30.0), Item("stems", "straw", (0.03, 0.1), 12.0))),
        _FALLEN,
    ),
    "pebbles": (
        Cover(3.6, (Item("stones", "stone", (0.008, 0.06), 80.0), Item("twigs", "driftwood", (0.06, 0.35), 3.0))),
    ),
    "mud": (Cover(0.5, (Item("stones", "stone", (0.008, 0.03), 14.0), Item("twigs", "driftwood", (0.05, 0.3), 5.0))),),
    "dry_turf": (
        Cover(2.6, (Item("blades", "straw", (0.03, 0.09), 30.0), Item("stems", "straw", (0.05, 0.18), 25.0), _GRAVEL)),
    ),
    "stony_soil": (Cover(3.0, (_GRAVEL, Item("stems", "straw", (0.04, 0.14), 14.0))),),
    "scree": (Cover(1.6, (Item("stones", "stone", (0.01, 0.06), 60.0),)),),
    "gravel": (
        Cover(3.0, (_GRAVEL, Item("leaves", "leaf", (0.025, 0.08), 5.0))),
        Cover(5.0, (Item("stones", "stone", (0.006, 0.03), 90.0), *_LEAVES), 0.12, "at edges"),
    ),
    "trodden_earth": (
        Cover(
            3.0,
            (
                Item("stones", "stone", (0.006, 0.04), 26.0),
                Item("stems", "straw", (0.03, 0.08), 22.0),
                Item("leaves", "leaf", (0.025, 0.09), 26.0),
                Item("leaves", "leaf_grey", (0.02, 0.06), 14.0),
                Item("twigs", "twig", (0.03, 0.15), 4.0),
            ),
        ),
        Cover(8.0, (*_LEAVES, Item("twigs", "twig", (0.04, 0.2), 9.0)), 0.12, "at edges"),
    ),
}
"""Covers by ground type. Ground of other types, paving and rock, is bare."""


def scatter_litter(
    builder: WorldBuilder, terrain: Terrain, amount: float, rng: np.random.Generator
) -> list[tuple[Swarm, list[Mesh]]]:
    """Swarms of patches, off the trails and on them, with their meshes; ``amount`` scales their number."""
    area = builder.size[0] * builder.size[1]
    amount = amount * min(1.0, MOST_AREA / area)
    ground = [MATERIALS[name].ground_type for name in terrain.ground_materials]
    trail = MATERIALS[terrain.trail_material].ground_type if builder.trails else ""
    found: dict[bool, list[tuple[list[Mesh], Array]]] = {False: [], True: []}
    for name in dict.fromkeys([*ground, trail]):
        for row, cover in enumerate(LITTER_BY_GROUND.get(name, ())):
            on_trail = name == trail
            if not on_trail and name not in ground:
                continue
            meshes = [_patch(f"{name}_{row}_{k}", cover, rng, on_trail=on_trail) for k in range(VARIANTS)]
            share = np.array([each == name for each in ground], np.float64)
            xy = _positions(builder, terrain, cover, None if on_trail else share, amount, rng)
            found[on_trail].append((meshes, _poses(terrain, xy, cover.radius, rng)))
    return [
        _swarm("trail_litter" if on_trail else "ground_litter", parts, rng)
        for on_trail, parts in found.items()
        if sum(len(poses) for _, poses in parts)
    ]


def _patch(name: str, cover: Cover, rng: np.random.Generator, *, on_trail: bool) -> Mesh:
    """Items in a disc, denser towards its middle."""
    surfaces, rows, names = [], list[int](), list[str]()
    for item in cover.items:
        n = max(1, int(rng.poisson(item.per_m2 * np.pi * cover.radius**2)))
        low, high = item.sizes
        size = low * (high / low) ** (rng.random(n) ** 1.7)
        out, turn = cover.radius * rng.random(n) ** 0.6, rng.uniform(0.0, 2.0 * np.pi, n)
        foot = np.stack([out * np.cos(turn), out * np.sin(turn), np.zeros(n)], axis=1)
        surface = SHAPES[item.shape](foot, size, rng)
        material = f"{'trail' if on_trail else 'litter'}_{item.material}"
        if material not in names:
            names.append(material)
        surfaces.append(surface)
        rows += [names.index(material)] * len(surface[3])
    return merged(f"litter_{name}", surfaces, np.array(rows), names, footprint=cover.radius)


def _positions(
    builder: WorldBuilder,
    terrain: Terrain,
    cover: Cover,
    share: Array | None,
    amount: float,
    rng: np.random.Generator,
) -> Array:
    """Positions (n, 2) [m] of patches on ground of which ``share`` (materials,) is the type; None: on trails."""
    trees = _trees(builder) if cover.where == "under trees" else None

    def density(xy: Array) -> Array:
        edge = terrain.trail_distance.at(*xy.T)
        if share is None:
            keep = np.where(edge < -(terrain.border_width + cover.radius), 1.0, 0.0)
        else:
            keep = (terrain.cover.at(*xy.T) @ share) * (edge > cover.radius)
        if builder.water_level is not None:
            keep *= terrain.surface.height_at(*xy.T) > builder.water_level + 0.03
        if trees is not None:
            keep *= np.exp(-((trees.query(xy)[0] / UNDER_TREES) ** 2)) if trees.n else 0.0
        if cover.where == "at edges":
            return np.asarray(keep * np.exp((edge + terrain.border_width + cover.radius) / _AT_EDGE))
        return np.asarray(keep * (FAR_SHARE + (1.0 - FAR_SHARE) * _nearness(builder, edge, xy)))

    xy = jittered_grid(np.array(builder.size) - 2.0 * cover.radius, amount * cover.per_m2, rng, density)
    return xy[builder.off_solids(xy, 0.0)]


def _nearness(builder: WorldBuilder, edge: Array, xy: Array) -> Array:
    away = np.maximum(edge, 0.0) if builder.trails else np.full(len(xy), np.inf)
    for line in builder.corridors:
        away = np.minimum(away, line.distance(xy))
    return np.asarray(np.exp(-((away / NEAR) ** 2)))


def _trees(builder: WorldBuilder) -> cKDTree:
    high = {name for name, mesh in builder.meshes.items() if mesh.species and mesh.vertices[:, 2].max() > _TREE}
    return cKDTree(np.array([i.world_from_object[:2, 3] for i in builder.instances if i.mesh in high]).reshape(-1, 2))


def _poses(terrain: Terrain, xy: Array, radius: float, rng: np.random.Generator) -> Array:
    """Poses (n, 4, 4) on the plane through the surface around the patch, in quarter turns: narrow bounding boxes.

    Leaves lie on the bumps of grass and litter, not on their mean: a share of what is around remains above.
    """
    n, turn, x, y = len(xy), 2.0 * np.pi * np.arange(_SAMPLES) / _SAMPLES, xy[:, :1], xy[:, 1:]
    out = radius * np.where(np.arange(_SAMPLES) % 2, 0.4, 0.85)
    dx, dy = out * np.cos(turn), out * np.sin(turn)
    z = terrain.surface.height_at(x + dx, y + dy)
    slopes = z @ np.linalg.pinv(np.column_stack([dx, dy, np.ones(_SAMPLES)])).T  # (n, 3) of the plane through them
    above = np.quantile(z - slopes @ np.stack([dx, dy, np.ones(_SAMPLES)]), _BEARING, axis=1)
    poses = upright_poses(
        xy, (np.pi / 2) * rng.integers(4, size=n).astype(np.float64), np.exp(rng.uniform(-_SCALE, _SCALE, n))
    )
    poses[:, :3, :3] = rotations_to(np.column_stack([-slopes[:, :2], np.ones(n)])) @ poses[:, :3, :3]
    poses[:, 2, 3] = slopes[:, 2] + above
    return poses


def _swarm(name: str, parts: Sequence[tuple[list[Mesh], Array]], rng: np.random.Generator) -> tuple[Swarm, list[Mesh]]:
    meshes = [mesh for own, _ in parts for mesh in own]
    rows = np.concatenate(
        [VARIANTS * k + rng.integers(VARIANTS, size=len(poses)) for k, (_, poses) in enumerate(parts)]
    )
    swarm = Swarm(
        name=name,
        kind=LITTER,
        object_id=0,
        meshes=tuple(mesh.name for mesh in meshes),
        mesh=rows.astype(np.int32),
        world_from_object=np.concatenate([poses for _, poses in parts]),
        tint=random_tints(rng, _TINT, len(rows)),
    )
    return swarm, meshes
