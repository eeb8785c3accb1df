# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Leaves in a season: fewer, of several colours, withered; the fine twigs that they hid; and those that fell.

A leaf is what its triangles connect. Every leaf has a rank by which it falls, with the same random numbers in all
seasons, so that those of winter are some of those of autumn.

Meshes have a surface for the thickest twigs only, and a bare crown needs the others. Each carries a leaf in summer: it
grows from the wood nearest to it, out to where the leaf was.

Fallen leaves are single ones on the ground below the crowns that lost them, and a share of them in its texture. A
fallen leaf has the class of the ground that its middle lies on: trail on a trail, ground elsewhere.
"""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Index, Mask
from fieldtruth.core.classes import Label, PlantPart
from fieldtruth.world.grids import grid_axes, make_raster, noise_map
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import (
    FALLEN,
    Material,
    Mesh,
    Raster,
    Swarm,
    Terrain,
    World,
    make_mesh,
    merge_meshes,
    node_axes,
)
from fieldtruth.world.placement import make_swarm
from fieldtruth.world.plants import BUSHES, TREES, Species
from fieldtruth.world.plants.growth import Surface, gathered, unit
from fieldtruth.world.seasons import Change, changes, tinted

MOST_TWIGS: Final = 20_000
"""Twigs of a mesh."""
COLOUR: Final = (0.105, 0.076, 0.058)
"""Albedo of young bark, which is brown and smooth in all species; even that of birches."""
LONGEST: Final = 1.1  # [m]
SLIM: Final = 0.006
"""Radius of a twig at its base relative to its length."""
THINNEST: Final = 0.022
"""Radius that is added, relative to a leaf, and at most ``THIN``."""
THIN: Final = 0.0024  # [m]
REACH: Final = (0.6, 1.8)
"""Least and greatest length of a twig that starts beside its leaf, relative to the leaf."""


def hidden_twigs(
    wood: Array, leaves: Array, leaf: float, gone: Mask, rng: np.random.Generator, per_leaf: float
) -> Surface:
    """Vertices, normals, uv and faces of pointed three-sided twigs to leaves that are ``gone``.

    ``wood`` (f, 3, 3) [m] are the triangles of the drawn stems, ``leaves`` (n, 3) [m] positions of leaves of a length
    ``leaf`` [m], ``per_leaf`` for each; leaves of meshes with less detail stand for several. Numbers are drawn for all
    leaves, so that a twig is the same in each season.
    """
    chance, length, bow = (
        rng.random(len(leaves)),
        leaf * rng.uniform(*REACH, len(leaves)),
        rng.normal(0, 1, leaves.shape),
    )
    share = min(per_leaf, MOST_TWIGS / max(len(leaves), 1))
    rows = np.flatnonzero(gone & (chance < share))
    if not len(rows) or not len(wood):
        return _needles(np.zeros((0, 3)), np.zeros((0, 3)), THIN)
    foot, tip = _axes(wood, leaves[rows], length[rows], bow[rows])
    return _needles(foot, tip, min(THINNEST * leaf, THIN))


def _axes(wood: Array, leaves: Array, least: Array, bow: Array) -> tuple[Array, Array]:
    """Feet and tips (n, 3) [m]."""
    wood = wood.astype(np.float64)
    points = np.concatenate([wood[:, 0] + t * (wood[:, 2] - wood[:, 0]) for t in (0.1, 0.35, 0.6, 0.85)])
    distance, nearest = cKDTree(points).query(leaves)
    away, foot = np.asarray(distance), points[nearest]
    ahead = unit(leaves - foot + 0.12 * away[:, None] * bow + 1e-6 * bow)
    reach = np.maximum(away * 1.08, least)
    tip = foot + reach[:, None] * ahead
    return tip - np.minimum(reach, LONGEST)[:, None] * ahead, tip


def _needles(foot: Array, tip: Array, thinnest: float) -> Surface:
    axis = tip - foot
    length = np.linalg.norm(axis, axis=1)
    ahead = axis / length[:, None]
    across = unit(np.cross(ahead, [0.31, 0.2, 0.93]))
    over = np.cross(ahead, across)
    turn = 2 * np.pi * np.arange(3) / 3
    spoke = np.cos(turn)[:, None] * across[:, None] + np.sin(turn)[:, None] * over[:, None]
    radius = thinnest + SLIM * length
    vertices = np.concatenate([foot[:, None] + radius[:, None, None] * spoke, tip[:, None]], axis=1)
    normals = np.concatenate([spoke, ahead[:, None]], axis=1)
    v = np.stack([0 * length, 0 * length, 0 * length, length / 0.15], axis=1)
    uv = np.stack([np.broadcast_to([0.0, 0.33, 0.67, 0.5], v.shape), v], axis=-1)
    return gathered(vertices, normals, uv, [[0, 1, 3], [1, 2, 3], [2, 0, 3]])


PATCHY: Final = 0.6
"""Weight with which neighbouring leaves fall and turn together, against 1 for each leaf on its own."""
MOST_SWAPS: Final = 3  # waves of the noise


def in_season(mesh: Mesh, changes: Mapping[str, Change], seed: int) -> Mesh:
    """The mesh with the leaves, colours and twigs of a season; its wood keeps its vertices and their order.

    Leaves of the k-th colour of a material have ``variant(material, k)``.
    """
    if not any(name in changes for name in mesh.materials):
        return mesh
    seeds = np.random.SeedSequence([seed, zlib.crc32(mesh.name.encode())]).spawn(len(mesh.materials) + 1)
    vertices, material, names = mesh.vertices.copy(), mesh.material.copy(), list(mesh.materials)
    kept = np.ones(len(mesh.faces), np.bool_)
    for row, name in enumerate(mesh.materials):
        change, of_row = changes.get(name), np.flatnonzero(mesh.material == row)
        if change is None or not len(of_row):
            continue
        rng = np.random.default_rng(seeds[row])
        leaf, count = _leaves(mesh.faces[of_row])
        middle = _middles(mesh, of_row, leaf, count)
        fall, colour = _ranks(middle, rng), _ranks(middle, rng)
        kept[of_row] = (fall < round(kept_share(mesh, name, change) * count))[leaf]
        chosen = _chosen(change, colour)
        rows = [row, *(_row_of(names, variant(name, k)) for k in range(1, len(change.colours)))]
        material[of_row] = np.array(rows, np.int32)[chosen][leaf]
        low = np.unique(mesh.faces[of_row])
        low = low[vertices[low, 2] > 0]
        vertices[low, 2] *= np.float32(change.low)
    if not kept.any():
        kept[0] = True  # a mesh has at least one triangle
    changed = replace(mesh, vertices=vertices, material=material, materials=tuple(names))
    return _compacted(_with_twigs(changed, mesh, kept, np.random.default_rng(seeds[-1])), kept)


def variant(name: str, number: int) -> str:
    """Name of the material of leaves of colour ``number``; the first keeps the name."""
    return name if number == 0 else f"{name}_{number + 1}"


def kept_share(mesh: Mesh, material: str, change: Change) -> float:
    """Share of the leaves that a mesh keeps: young trees often hold dead leaves until spring."""
    species = woody(mesh)
    if change.kept_young is None or species is None or species.foliage != material or species.young is None:
        return change.kept
    return change.kept_young if mesh.vertices[:, 2].max() < species.young_below else change.kept


def woody(mesh: Mesh) -> Species | None:
    """Species of a tree or bush; None for all else."""
    name = mesh.species[0] if len(mesh.species) == 1 else ""
    species = TREES.get(name) or BUSHES.get(name)
    return species if species is not None and species.foliage in mesh.materials else None


def twigs_of(species: Species) -> str:
    """Name of the material of the twigs that leaves hide; its class is that of the wood."""
    return f"{species.wood}_twigs"


def _row_of(names: list[str], name: str) -> int:
    if name not in names:
        names.append(name)
    return names.index(name)


def _leaves(faces: NDArray[np.int32]) -> tuple[Index, int]:
    """Number of the leaf of each triangle, and the count of leaves; they are counted by their first vertices."""
    used, number = np.unique(faces, return_inverse=True)
    a, b, c = number.reshape(-1, 3).T
    edges = coo_array((np.ones(2 * len(a), np.int8), (np.r_[a, a], np.r_[b, c])), shape=(len(used), len(used)))
    count, leaf = connected_components(edges, directed=False)
    return np.asarray(leaf[a], np.intp), int(count)


def _middles(mesh: Mesh, faces: Index, leaf: Index, count: int) -> Array:
    """Middle (count, 3) [m] of each leaf."""
    corner = mesh.vertices[mesh.faces[faces]].astype(np.float64).mean(axis=1)
    number = np.maximum(np.bincount(leaf, minlength=count), 1)
    return np.stack([np.bincount(leaf, corner[:, k], count) / number for k in range(3)], axis=1)


def _ranks(middle: Array, rng: np.random.Generator) -> Index:
    """A random order of leaves at positions (n, 3) in which neighbours are often near each other."""
    spread = float(np.maximum(middle.std(axis=0), 0.02).mean())
    waves = rng.normal(0, 1.5 / spread, (MOST_SWAPS, 3))
    patch = np.cos(middle @ waves.T + rng.uniform(0, 2 * np.pi, MOST_SWAPS)).mean(axis=1)
    order = np.argsort(rng.random(len(middle)) + PATCHY * patch, kind="stable")
    rank = np.empty(len(order), np.intp)
    rank[order] = np.arange(len(order))
    return rank


def _chosen(change: Change, rank: Index) -> Index:
    """Number of the colour of each leaf, in the shares of the change."""
    if not change.colours:
        return np.zeros(len(rank), np.intp)
    ends = np.cumsum([part[0] for part in change.colours])
    return np.searchsorted(ends[:-1] / ends[-1], (rank + 0.5) / len(rank))


def _with_twigs(changed: Mesh, summer: Mesh, kept: Mask, rng: np.random.Generator) -> tuple[Mesh, int]:
    """The mesh with twigs where leaves are gone, and the number of triangles that were added."""
    species = woody(summer)
    if species is None:
        return changed, 0
    foliage = np.flatnonzero(summer.material == summer.materials.index(species.foliage))
    leaf, count = _leaves(summer.faces[foliage])
    gone = np.ones(count, np.bool_)
    gone[leaf[kept[foliage]]] = False
    first = np.full(count, -1, np.intp)
    first[leaf[::-1]] = foliage[::-1]
    wood = summer.material == summer.materials.index(species.wood)
    if species.upper_wood in summer.materials:
        wood |= summer.material == summer.materials.index(species.upper_wood)
    blades = summer.vertices[summer.faces[first]]
    length = float(np.median(np.linalg.norm(blades[:, :1] - blades, axis=2).max(axis=1)))
    twigs = hidden_twigs(
        summer.vertices[summer.faces[wood]], blades.mean(axis=1), length, gone, rng, species.hidden_twigs
    )
    grown = make_mesh("twigs", *twigs, (twigs_of(species),))
    part, limb = np.full(len(grown.faces), PlantPart.BRANCH, np.uint8), None
    if summer.limb is not None and len(grown.faces):  # a twig is on the limb of the leaf that is nearest to its tip
        tips = grown.vertices[grown.faces.max(axis=1)]
        limb = summer.limb[first[cKDTree(blades.mean(axis=1)).query(tips)[1]]]
    made = merge_meshes(changed.name, [changed, replace(grown, part=part)], footprint=changed.footprint)
    if limb is not None:
        made = replace(made, limb=np.concatenate([changed.face_limbs, limb]))
    return made, len(grown.faces)


def _compacted(grown: tuple[Mesh, int], kept: Mask) -> Mesh:
    """The mesh without the triangles that are not kept, and without vertices and materials that no triangle has."""
    mesh, added = grown
    if kept.all() and not added:
        return mesh
    rows = np.r_[kept, np.ones(added, np.bool_)]
    used, faces = np.unique(mesh.faces[rows], return_inverse=True)
    own, material = np.unique(mesh.material[rows], return_inverse=True)
    return replace(
        mesh,
        vertices=mesh.vertices[used],
        normals=mesh.normals[used],
        uv=mesh.uv[used],
        faces=faces.reshape(-1, 3).astype(np.int32),
        material=material.astype(np.int32),
        materials=tuple(mesh.materials[k] for k in own),
        part=None if mesh.part is None else mesh.part[rows],
        limb=None if mesh.limb is None else mesh.limb[rows],
    )


FALL: Final = "autumn"
"""Season in which leaves fall."""
MOST_LEAVES: Final = 22.0
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
    """Fallen leaves of a species: share (nx, ny) of a closed canopy's leaves."""

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
    nodes = node_axes(cover)
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
            names.append(f"{FALLEN}_on_{name}")
            new[names[-1]] = replace(MATERIALS[FALLEN], name=names[-1], ground_type=MATERIALS[name].ground_type)
    cover = replace(cover, values=np.concatenate(values, axis=-1))
    return replace(terrain, cover=cover, ground_materials=tuple(names)), new


def lay_leaves(
    world: World, falls: list[LeafFall], season: str
) -> tuple[Swarm, list[Mesh], dict[str, Material]] | None:
    """A swarm of single leaves with its meshes, one per tile, and its materials; None where no leaf fell.

    They have the colours of ``FALL``, in later seasons nearly all brown.
    """
    rng, autumn = np.random.default_rng([world.seed, 42]), changes(FALL)
    most, rot = MOST_LEAVES * changes(season).get(FALLEN, Change()).kept, ROT if season == FALL else OLD
    materials, parts = dict[str, Material](), []
    for fall in falls:
        xy = _positions(world, fall.density, most, rng)
        if len(xy):
            colours = autumn.get(fall.species.foliage, Change()).colours or ((1.0, *BROWN),)
            rotten = tuple((c[0], *((1 - rot) * np.array(c[1:]) + rot * np.array(BROWN)).tolist()) for c in colours)
            parts.append(_lying(world, fall.species, xy, rotten, materials, rng))
    if not parts:
        return None
    corners, normals, rows = (np.concatenate([part[k] for part in parts]) for k in range(3))
    tile = np.floor((corners[:, 0, :2] + np.array(world.size) / 2) / TILE).astype(int)
    meshes = []
    for number, key in enumerate(np.unique(tile, axis=0)):
        own = (tile == key).all(axis=1)
        meshes.append(_mesh(f"{FALLEN}_{number}", corners[own], normals[own], rows[own], tuple(materials)))
    poses = np.tile(np.eye(4), (len(meshes), 1, 1))
    return make_swarm(FALLEN, FALLEN, meshes, poses, None), meshes, materials


def _positions(world: World, density: Raster, most: float, rng: np.random.Generator) -> Array:
    """Positions (n, 2) [m] with ``most`` times the density per square metre, in drifts of a hand's breadth, on land."""
    cells = density.values[:-1, :-1]
    blown = gaussian_filter(rng.standard_normal(cells.shape), 0.8) * 2.8
    count = rng.poisson(np.clip(cells * most * CELL**2 * (1 + 0.6 * blown), 0, None))
    i, j = (np.repeat(axis.ravel(), count.ravel()) for axis in np.indices(cells.shape))
    xy = np.stack([density.x0 + CELL * i, density.y0 + CELL * j], axis=1) + CELL * rng.random((len(i), 2))
    inside = (np.abs(xy) < np.array(world.size) / 2 - 0.1).all(axis=1)
    if world.water_level is not None:
        inside &= world.terrain.field.height_at(*xy.T) > world.water_at(*xy.T) + 0.03
    return xy[inside]


def _lying(
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
    return make_mesh(
        name, corners, normals, np.tile(_UV, (n, 1)), faces, [materials[k] for k in used], np.repeat(own, 2),
        footprint=TILE,
    )  # fmt: skip
