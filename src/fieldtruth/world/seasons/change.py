# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""From the world of summer to that of another season.

In early spring anemones flower where herbs, ferns and seedlings of a wood grow, before the leaves shade them.
"""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from fieldtruth.world.assembly import tidied
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Material, Mesh, Swarm, World
from fieldtruth.world.placement import make_swarm, random_scales, upright_poses
from fieldtruth.world.plants import BUSHES, GRASSES, TREES, grow_clump
from fieldtruth.world.seasons import SUMMER, USUAL, Change, changes, tinted
from fieldtruth.world.seasons.leaves import COLOUR, lay_leaves, leaf_falls, strewn, twigs_of, variant
from fieldtruth.world.seasons.leaves import in_season as mesh_in_season
from fieldtruth.world.seasons.snow import snowed_in
from fieldtruth.world.textures import make_texture

WHERE: Final = ("fern", "herb", "seedling")
"""Kinds of swarms beside whose members they grow."""

NEAR: Final = 0.7
"""Standard deviation [m] of the distance along x and along y."""

OFF_TRAIL: Final = 0.3  # [m]


def spring_flowers(world: World) -> tuple[Swarm, list[Mesh]] | None:
    """Clumps of anemones; None where nothing grows that they grow beside."""
    poses = [swarm.world_from_object for swarm in world.swarms if swarm.kind in WHERE]
    if not poses:
        return None
    rng = np.random.default_rng([world.seed, 43])
    xy = np.concatenate(poses)[:, :2, 3]
    xy = xy + rng.normal(0, NEAR, xy.shape)
    inside = (np.abs(xy) < np.array(world.size) / 2 - 0.5).all(axis=1)
    xy = xy[inside & (world.terrain.trail_distance.at(*xy.T) > OFF_TRAIL)]
    meshes = [
        grow_clump({GRASSES["anemone"]: 1.0}, name=f"anemones_{k}", radius=0.35, per_m2=16.0, rng=rng, size=0.5)
        for k in range(4)
    ]
    poses_here = upright_poses(xy, rng.uniform(0, 2 * np.pi, len(xy)), random_scales(rng, (0.8, 1.2), len(xy)))
    poses_here[:, 2, 3] = world.terrain.field.height_at(*xy.T)
    return make_swarm("anemones", "flower", meshes, poses_here, rng), meshes


FLOWERS_IN = "spring"


def in_season(world: World, season: str = SUMMER, drought: float = USUAL, snow_depth: float = 0.0) -> World:
    """The world in a season, after a drought, under snow of a mean depth [m] in the open.

    Each change is a function of the world of summer and its seed. Without any the world itself is returned.
    """
    table = changes(season, drought)
    if table:
        world = _changed(world, table, season)
    return snowed_in(world, snow_depth) if snow_depth > 0 else world


def _changed(summer: World, table: Mapping[str, Change], season: str) -> World:
    used = {name: table[name] for name in table if name in summer.materials}
    world = recoloured(summer, used)
    falls = leaf_falls(summer, used)
    new: list[tuple[Swarm, Sequence[Mesh]]] = []
    if falls:
        terrain, materials = strewn(world.terrain, falls, table, world.seed)
        world = _with_materials(replace(world, terrain=terrain), {n: _coloured(m, table) for n, m in materials.items()})
        laid = lay_leaves(world, falls, season)
        if laid is not None:
            new.append(laid[:2])
            world = _with_materials(world, laid[2])
    if season == FLOWERS_IN and (flowers := spring_flowers(world)) is not None:
        new.append(flowers)
    return tidied(_with_swarms(world, new))


def recoloured(world: World, table: Mapping[str, Change]) -> World:
    """The world with leaves, blades and ground as the table has them; nothing new lies or grows in it."""
    materials: dict[str, Material] = {}
    for name, material in world.materials.items():
        change = table.get(name, Change())
        through = material.translucency if change.translucency is None else change.translucency
        own = replace(material, translucency=through)
        for k, (_, *rgb) in enumerate(change.colours):
            materials[variant(name, k)] = replace(tinted(own, (rgb[0], rgb[1], rgb[2])), name=variant(name, k))
        materials.setdefault(name, own)
    for species in {s.wood: s for s in (*TREES.values(), *BUSHES.values()) if s.wood in world.materials}.values():
        twigs = replace(MATERIALS[species.wood], name=twigs_of(species))
        materials[twigs.name] = tinted(twigs, COLOUR)
    backdrop = None if world.backdrop is None else mesh_in_season(world.backdrop, table, world.seed)
    meshes = {name: mesh_in_season(mesh, table, world.seed) for name, mesh in world.meshes.items()}
    return replace(world, meshes=meshes, backdrop=backdrop, materials=materials)


def _coloured(material: Material, table: Mapping[str, Change]) -> Material:
    """The ground below fallen leaves, which turn brown until spring."""
    change = table.get("fallen_leaves", Change())
    return tinted(material, change.colours[0][1:]) if change.colours else material


def _with_materials(world: World, materials: Mapping[str, Material]) -> World:
    """The world with more materials, and textures for them."""
    textures = dict(world.textures)
    for material in materials.values():
        if material.texture not in textures:
            seed = np.random.SeedSequence([world.seed, zlib.crc32(material.texture.encode())])
            textures[material.texture] = make_texture(material.texture, seed)
    return replace(world, materials={**world.materials, **materials}, textures=textures)


def _with_swarms(world: World, new: Sequence[tuple[Swarm, Sequence[Mesh]]]) -> World:
    """The world with more swarms, whose instance ids follow the others."""
    meshes, swarms, names = dict(world.meshes), list(world.swarms), list(world.object_names)
    for swarm, own in new:
        meshes |= {mesh.name: mesh for mesh in own}
        swarms.append(replace(swarm, object_id=len(names)))
        names.append(swarm.name)
    missing = {n for mesh in meshes.values() for n in mesh.materials} - set(world.materials)
    world = replace(world, meshes=meshes, swarms=tuple(swarms), object_names=tuple(names))
    return _with_materials(world, {name: MATERIALS[name] for name in MATERIALS if name in missing})
