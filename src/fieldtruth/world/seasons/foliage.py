# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Leaves and blades of a mesh in a season: fewer, of several colours, withered; and the twigs that they hid.

A leaf is what its triangles connect. Every leaf has a rank by which it falls, with the same random numbers in all
seasons, so that those of winter are some of those of autumn.
"""

import zlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fieldtruth.core.arrays import Array, Index, Mask
from fieldtruth.world.model import Mesh
from fieldtruth.world.plants import BUSHES, TREES, Species
from fieldtruth.world.seasons.table import Change
from fieldtruth.world.seasons.twigs import hidden_twigs

PATCHY: Final = 0.6
"""How much leaves that are near each other fall and turn together, against 1 for each leaf on its own."""
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
    vertices, normals, uv, faces = hidden_twigs(
        summer.vertices[summer.faces[wood]], blades.mean(axis=1), length, gone, rng
    )
    names, start = list(changed.materials), len(changed.vertices)
    row = _row_of(names, twigs_of(species))
    return replace(
        changed,
        materials=tuple(names),
        vertices=np.concatenate([changed.vertices, vertices]),
        normals=np.concatenate([changed.normals, normals]),
        uv=np.concatenate([changed.uv, uv]),
        faces=np.concatenate([changed.faces, faces + np.int32(start)]),
        material=np.concatenate([changed.material, np.full(len(faces), row, np.int32)]),
    ), len(faces)


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
    )
