# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Fallen leaves: single ones on the ground below the crowns that lost them, and a share of them in its texture.

A fallen leaf has the class of the ground that its middle lies on: trail on a trail, ground elsewhere.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Array, Index
from fieldtruth.core.classes import Label
from fieldtruth.world.grids import grid_axes, make_raster
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Material, Mesh, Raster, Swarm, Terrain, World
from fieldtruth.world.noise import noise_map
from fieldtruth.world.plants import Species
from fieldtruth.world.seasons.foliage import kept_share, woody
from fieldtruth.world.seasons.table import Change, changes, tinted

NAME: Final = "fallen_leaves"
"""Material of the ground where leaves lie close, kind of the swarm; ``kept`` of it scales the number of leaves."""
FALL: Final = "autumn"
"""Season in which leaves fall."""
MOST: Final = 22.0
"""Leaves per square metre below a closed canopy that has lost all."""
CELL: Final = 0.5  # [m]
TILE: Final = 12.5  # [m] along the side of one mesh
BROWN: Final = (0.12, 0.08, 0.046)
"""Albedo that the colour of fallen leaves turns to."""
ROT: Final = 0.2
"""Share of brown in a leaf that fell this season; later leaves are nearly all brown."""
OLD: Final = 0.8
_CORNERS: Final = np.array([[-0.5, 0.0], [0.0, 0.5], [0.5, 0.0], [0.0, -0.5]])  # along, across: stalk, left, tip, right
_UV: Final = np.array([[0.5, 0.03], [0.04, 0.45], [0.5, 0.97], [0.96, 0.45]], np.float32)


@dataclass(frozen=True)
class LeafFall:
    """Where the leaves of a species fell: share (nx, ny) of a closed canopy's leaves."""

    species: Species
    density: Raster


def leaf_falls(world: World, table: Mapping[str, Change]) -> list[LeafFall]:
    """Leaf fall by species, from the trees and bushes of the world of summer."""
    x, y = grid_axes(world.size, CELL)
    total: dict[str, tuple[Species, NDArray[np.float64]]] = {}
    crowns = {name: _crown(mesh, table) for name, mesh in world.meshes.items()}
    for instance in world.instances:
        crown = crowns[instance.mesh]
        if crown is None:
            continue
        species, radius, lost = crown
        pose = instance.world_from_object
        reach = float(np.cbrt(np.linalg.det(pose[:3, :3]))) * radius
        values = total.setdefault(species.name, (species, np.zeros((len(x), len(y)))))[1]
        i, j = (np.flatnonzero(np.abs(axis - at) < 2 * reach) for axis, at in ((x, pose[0, 3]), (y, pose[1, 3])))
        away2 = (x[i, None] - pose[0, 3]) ** 2 + (y[None, j] - pose[1, 3]) ** 2
        values[np.ix_(i, j)] += lost * np.exp(-1.2 * away2 / reach**2)
    return [LeafFall(species, make_raster(v.clip(0, 1), CELL, x, y)) for species, v in total.values()]


def _crown(mesh: Mesh, table: Mapping[str, Change]) -> tuple[Species, float, float] | None:
    """Species, radius [m] within which leaves fall, and share of them that fell; None without."""
    species = woody(mesh)
    if species is None or species.foliage not in table:
        return None
    lost = 1.0 - kept_share(mesh, species.foliage, table[species.foliage])
    leaves = mesh.vertices[np.unique(mesh.faces[mesh.material == mesh.materials.index(species.foliage)])]
    return (species, 0.8 + 1.4 * float(np.quantile(np.hypot(*leaves[:, :2].T), 0.9)), lost) if lost > 0 else None


def strewn(
    terrain: Terrain, falls: list[LeafFall], table: Mapping[str, Change], seed: int
) -> tuple[Terrain, dict[str, Material]]:
    """The terrain with leaves mixed into its cover, and the materials for it; kinds of ground stay the same."""
    cover = terrain.cover
    nx, ny = cover.values.shape[:2]
    nodes = (cover.x0 + cover.spacing * np.arange(nx), cover.y0 + cover.spacing * np.arange(ny))
    x, y = np.meshgrid(*nodes, indexing="ij")
    share = np.sum([fall.density.at(x, y) for fall in falls], axis=0)
    size = (cover.spacing * (nx - 1), cover.spacing * (ny - 1))
    rng = np.random.default_rng([seed, 41])
    patch = noise_map(size, 1.3, rng)(np.stack([x - nodes[0].mean(), y - nodes[1].mean()], -1).reshape(-1, 2))
    share = np.clip(1.6 * share * (1 + 0.5 * patch.reshape(nx, ny)), 0, 1)
    values, names, new = [cover.values], list(terrain.ground_materials), dict[str, Material]()
    for row, name in enumerate(terrain.ground_materials):
        covered = table[name].covered if name in table else 0.0
        if covered > 0:
            leaves = (covered * share * cover.values[..., row]).astype(np.float32)
            values[0] = values[0].copy()
            values[0][..., row] -= leaves
            values.append(leaves[..., None])
            names.append(f"{NAME}_on_{name}")
            new[names[-1]] = replace(MATERIALS[NAME], name=names[-1], ground_type=MATERIALS[name].ground_type)
    cover = replace(cover, values=np.concatenate(values, axis=-1))
    return replace(terrain, cover=cover, ground_materials=tuple(names)), new


def lay_leaves(
    world: World, falls: list[LeafFall], season: str
) -> tuple[Swarm, list[Mesh], dict[str, Material]] | None:
    """A swarm of single leaves with its meshes, one per tile, and its materials; None where no leaf fell.

    They have the colours of ``FALL``, in later seasons nearly all brown.
    """
    rng, autumn = np.random.default_rng([world.seed, 42]), changes(FALL)
    most, rot = MOST * changes(season).get(NAME, Change()).kept, ROT if season == FALL else OLD
    materials, parts = dict[str, Material](), []
    for fall in falls:
        xy = _positions(world, fall.density, most, rng)
        if len(xy):
            colours = autumn.get(fall.species.foliage, Change()).colours or ((1.0, *BROWN),)
            rotten = tuple((c[0], *((1 - rot) * np.array(c[1:]) + rot * np.array(BROWN)).tolist()) for c in colours)
            parts.append(_leaves(world, fall.species, xy, rotten, materials, rng))
    if not parts:
        return None
    corners, normals, rows = (np.concatenate([part[k] for part in parts]) for k in range(3))
    tile = np.floor((corners[:, 0, :2] + np.array(world.size) / 2) / TILE).astype(int)
    meshes = []
    for number, key in enumerate(np.unique(tile, axis=0)):
        own = (tile == key).all(axis=1)
        meshes.append(_mesh(f"{NAME}_{number}", corners[own], normals[own], rows[own], tuple(materials)))
    n = len(meshes)
    poses, tint = np.tile(np.eye(4), (n, 1, 1)), np.ones((n, 3), np.float32)
    names = tuple(mesh.name for mesh in meshes)
    swarm = Swarm(
        name=NAME, kind=NAME, object_id=0, meshes=names, mesh=np.arange(n, dtype=np.int32), world_from_object=poses,
        tint=tint,
    )  # fmt: skip
    return swarm, meshes, materials


def _positions(world: World, density: Raster, most: float, rng: np.random.Generator) -> Array:
    """Positions (n, 2) [m] with ``most`` times the density per square metre, in drifts of a hand's breadth, on land."""
    cells = density.values[:-1, :-1]
    blown = gaussian_filter(rng.standard_normal(cells.shape), 0.8) * 2.8
    count = rng.poisson(np.clip(cells * most * CELL**2 * (1 + 0.6 * blown), 0, None))
    i, j = (np.repeat(axis.ravel(), count.ravel()) for axis in np.indices(cells.shape))
    xy = np.stack([density.x0 + CELL * i, density.y0 + CELL * j], axis=1) + CELL * rng.random((len(i), 2))
    inside = (np.abs(xy) < np.array(world.size) / 2 - 0.1).all(axis=1)
    if world.water_level is not None:
        inside &= world.terrain.field.height_at(*xy.T) > world.water_level + 0.03
    return xy[inside]


def _leaves(
    world: World,
    species: Species,
    xy: Array,
    colours: Sequence[tuple[float, ...]],
    materials: dict[str, Material],
    rng: np.random.Generator,
) -> tuple[Array, Array, Index]:
    """Corners (n, 4, 3) [m] and normals (n, 4, 3) of leaves at positions, and the rows of their materials."""
    n, form = len(xy), species.grown.leaf
    turn = rng.uniform(0, 2 * np.pi, n)
    ahead = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    length = form.length / form.stands_for**0.5 * rng.uniform(0.7, 1.2, n)
    along, across = length[:, None] * _CORNERS[:, 0], (length * form.width)[:, None] * _CORNERS[:, 1]
    flat = xy[:, None] + along[..., None] * ahead[:, None] + across[..., None] * (ahead[:, ::-1] * [-1, 1])[:, None]
    lift = length[:, None] * rng.uniform([0.02, 0.0, 0.02, 0.0], [0.06, 0.3, 0.3, 0.3], (n, 4)) ** 1.3
    z = world.terrain.surface.height_at(*flat.T).T + 0.003 + lift
    corners = np.concatenate([flat, z[..., None]], axis=2)
    own = np.cross(corners[:, 2] - corners[:, 0], corners[:, 1] - corners[:, 3])
    own *= np.where(own[:, 2:] < 0, -1.0, 1.0)
    normals = own / np.linalg.norm(own, axis=1, keepdims=True)
    label = world.terrain.label_at(*xy.T)
    ends = np.cumsum([part[0] for part in colours])
    chosen = np.searchsorted(ends[:-1] / ends[-1], rng.random(n))
    rows = np.zeros(n, np.intp)
    for k, (_, red, green, blue) in enumerate(colours):
        for ground in (Label.GROUND, Label.TRAIL):
            own_rows = (chosen == k) & (label == ground)
            if own_rows.any():
                name = f"fallen_{species.foliage}_{k + 1}_{ground.name.lower()}"
                leaf = replace(MATERIALS[species.foliage], name=name, label=ground, translucency=0.0, gloss=0.02)
                materials[name] = tinted(leaf, (red, green, blue))
                rows[own_rows] = list(materials).index(name)
    return corners, np.repeat(normals[:, None], 4, axis=1), rows


def _mesh(name: str, corners: Array, normals: Array, rows: Index, materials: tuple[str, ...]) -> Mesh:
    n = len(corners)
    used, own = np.unique(rows, return_inverse=True)
    faces = 4 * np.arange(n)[:, None, None] + np.array([[0, 2, 1], [0, 3, 2]])
    return Mesh(
        name=name,
        vertices=corners.reshape(-1, 3).astype(np.float32),
        normals=normals.reshape(-1, 3).astype(np.float32),
        uv=np.tile(_UV, (n, 1)),
        faces=faces.reshape(-1, 3).astype(np.int32),
        material=np.repeat(own, 2).astype(np.int32),
        materials=tuple(materials[k] for k in used),
        footprint=TILE,
    )
