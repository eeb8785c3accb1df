# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""From the world of summer to that of another season.

In early spring anemones flower where herbs, ferns and seedlings of a wood grow, before the leaves shade them.

Snow lies as a layer above the soil that bears wheels and objects: a robot's wheels press it down to the soil, and its
friction and rolling resistance are those of the ground without snow. What is higher than the snow rises out of it.
"""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.classes import Label
from fieldtruth.world.assembly import tidied
from fieldtruth.world.grids import fractal_noise, grid_axes, make_raster
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import FALLEN, Material, Mesh, Raster, Swarm, Terrain, World, node_axes
from fieldtruth.world.placement import make_swarm, random_scales, upright_poses
from fieldtruth.world.plants import BUSHES, GRASSES, TREES, grow_clump
from fieldtruth.world.seasons import SUMMER, USUAL, Change, changes, tinted
from fieldtruth.world.seasons.leaves import COLOUR, lay_leaves, leaf_falls, strewn, twigs_of, variant
from fieldtruth.world.seasons.leaves import in_season as mesh_in_season
from fieldtruth.world.textures import make_texture

DRIFT: Final = 0.2
"""Standard deviation of the depth in the open relative to its mean, at most twice that from it."""
DRIFT_LENGTH: Final = 6.0  # [m]
RIPPLE: Final = 0.06
"""Likewise of small unevenness."""
RIPPLE_LENGTH: Final = 0.9  # [m]
HOLDS: Final = 35.0
"""Slope [deg] up to which all snow lies."""
SLIDES: Final = 55.0
"""Slope [deg] from which none lies."""
SMOOTH: Final = 0.12
"""Standard deviation [m] of the Gaussian with which snow levels small relief."""
CELL: Final = 0.25
"""[m] of the grid on which roofs and crowns are found."""
FINE: Final = CELL**2 / 8
"""Area [m^2] of a triangle, seen from above, for each point that stands for it."""
LEAF_EXTINCTION: Final = 0.5
"""Of falling snow by leaves and twigs, per projected leaf area index."""
BURIED: Final = 0.15
"""Share of the ground that snow hides from which fallen leaves are below it."""
HIDES: Final = 0.02
"""Depth [m] above grass and litter from which nothing below is seen."""
SHORE: Final = 0.03
"""Height [m] above open water below which none lies."""


def snowed_in(world: World, depth: float) -> World:
    """The world with snow of a mean ``depth`` [m] in the open, thinner below crowns and on steep ground.

    None lies on ground steeper than ``SLIDES``, below roofs, and in water.
    """
    terrain = world.terrain
    field, (x, y) = terrain.field, node_axes(terrain.field)
    rng = np.random.default_rng([world.seed, 44])
    drift = 1 + sum(
        deviation * fractal_noise(x, y, wavelength=length, octaves=3, rng=rng).clip(-2, 2)
        for deviation, length in ((DRIFT, DRIFT_LENGTH), (RIPPLE, RIPPLE_LENGTH))
    )
    heights = field.heights.astype(np.float64)
    level = gaussian_filter(heights, SMOOTH / field.spacing, mode="nearest")
    slope = np.degrees(np.arctan(np.hypot(*np.gradient(level, field.spacing))))
    holds = np.clip((SLIDES - slope) / (SLIDES - HOLDS), 0, 1)
    fallen = depth * drift * holds * _open_share(world, x, y)
    filled = fallen + np.clip(level - heights, -fallen, fallen)
    if world.water_level is not None:
        filled *= heights > world.water_at(x[:, None], y) + SHORE
    snow = np.clip(filled, 0, 2 * depth).astype(np.float16).astype(np.float32)
    layer = snow if terrain.layer is None else np.maximum(terrain.layer, snow)
    terrain = replace(terrain, layer=layer, snow=snow)
    lying = {name for swarm in world.swarms if swarm.kind == FALLEN for name in swarm.meshes}
    meshes = {name: _in_sight(mesh, terrain) if name in lying else mesh for name, mesh in world.meshes.items()}
    return replace(world, terrain=terrain, meshes=meshes)


def _in_sight(mesh: Mesh, terrain: Terrain) -> Mesh:
    """A mesh of fallen leaves, in the world's frame, without those that snow hides; one is left."""
    middle = mesh.vertices[mesh.faces].mean(axis=1).astype(np.float64)
    bare = hidden_share(terrain).at(*middle[:, :2].T) < BURIED
    bare = bare.reshape(-1, 2).any(axis=1).repeat(2)  # two triangles a leaf
    bare[:2] |= not bare.any()
    return replace(mesh, faces=mesh.faces[bare], material=mesh.material[bare])


def hidden_share(terrain: Terrain) -> Raster:
    """Share of the ground that snow hides, where its depth is known; 0 without snow."""
    field, snow = terrain.field, terrain.snow
    if snow is None:
        return Raster(values=np.zeros((2, 2), np.float32), spacing=1.0, x0=0.0, y0=0.0)
    grass = np.zeros_like(snow) if terrain.layer is None else terrain.layer - snow  # what rises out of it
    share = np.clip((snow - grass) / HIDES, 0.0, 1.0).astype(np.float32)
    return Raster(values=share, spacing=field.spacing, x0=field.x0, y0=field.y0)


def _open_share(world: World, x: Array, y: Array) -> Array:
    """Share (nx, ny) of the falling snow that reaches the ground at nodes x, y between crowns and roofs."""
    axes = grid_axes(world.size, CELL)
    solid, leaves = np.zeros([len(a) for a in axes]), np.zeros([len(a) for a in axes])
    dry = [instance for instance in world.instances if instance.kind != "water"]
    parts = {name: _flat_parts(world.meshes[name], world) for name in {instance.mesh for instance in dry}}
    for instance in dry:
        points, area, leafy = parts[instance.mesh]
        pose = instance.world_from_object
        at = points @ pose[:2, :3].T + pose[:2, 3]
        scale = float(np.cbrt(np.linalg.det(pose[:3, :3])))
        i, j = np.rint((at + np.array(world.size) / 2) / CELL).astype(int).T
        inside = (i >= 0) & (j >= 0) & (i < len(axes[0])) & (j < len(axes[1]))
        for grid, own in ((leaves, inside & leafy), (solid, inside & ~leafy)):
            np.add.at(grid, (i[own], j[own]), area[own] * scale**2 / CELL**2)
    share = (1 - np.minimum(0.5 * solid, 1.0)) * np.exp(-LEAF_EXTINCTION * leaves)  # solids have an underside, too
    share = gaussian_filter(share, 0.4, mode="nearest")
    return make_raster(share, CELL, *axes).at(*np.meshgrid(x, y, indexing="ij"))


def _flat_parts(mesh: Mesh, world: World) -> tuple[Array, Array, Mask]:
    """Points (n, 3) [m] over the triangles, the area [m^2] from above of each, and whether it is a leaf's.

    A triangle has points enough for the grid: a quasi-random sequence (Roberts 2018), folded into the triangle.
    """
    corner = mesh.vertices[mesh.faces].astype(np.float64)
    area = 0.5 * np.abs(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2])
    count = np.maximum(1, np.ceil(area / FINE).astype(int))
    row = np.repeat(np.arange(len(area)), count)
    number = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    u, v = (0.5 + number * 0.7548776662) % 1, (0.5 + number * 0.5698402910) % 1
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    points = corner[row, 0] + u[:, None] * (corner[row, 1] - corner[row, 0])
    points += v[:, None] * (corner[row, 2] - corner[row, 0])
    leafy = np.array([world.materials[n].label in (Label.TREETOP, Label.BUSH) for n in mesh.materials])
    return points, (area / count)[row], leafy[mesh.material[row]]


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
    change = table.get(FALLEN, Change())
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
