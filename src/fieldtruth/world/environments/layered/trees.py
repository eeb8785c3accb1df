# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Effects of trees on their environment: shade below crowns, roots in the ground; and shares of species."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.world.environments.layered.fields import FAR
from fieldtruth.world.grids import grid_axes, make_raster, under_circles
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Instance, Mesh, Raster
from fieldtruth.world.placement import ObjectGroup, WorldBuilder
from fieldtruth.world.plants import BUSHES, TREES
from fieldtruth.world.relief import Axes, root_swells

CANOPY: Final = 0.8
"""Distance [m] over which a crown's share of the ground fades at its rim."""
FOOT: Final = 0.08
"""Distance [m] between positions of an object's foot."""
SOLE: Final = 0.15
"""Height [m] of the part of an object that is its foot."""
ROOTS: Final = 0.1
"""Largest spacing [m] of the terrain's nodes on which roots can be seen."""
SPECIES: Final = "{species}"
"""Place of the species in the name of a kind."""


def crowns(builder: WorldBuilder, axes: Axes) -> dict[str, Raster]:
    """Share to which nodes are below crowns of trees and bushes, below those with needles, and those with leaves."""
    shapes = {name: (_crown(builder, mesh), _has_needles(mesh)) for name, mesh in builder.meshes.items()}
    circles: dict[bool, list[tuple[float, float, float]]] = {False: [], True: []}
    for each in builder.instances:
        (radius, needles), pose = shapes[each.mesh], each.world_from_object
        if radius > 0:
            circles[needles].append((*pose[:2, 3].tolist(), radius * float(np.linalg.norm(pose[:3, 0]))))
    kinds = {"crown": circles[False] + circles[True], "crown_needles": circles[True], "crown_leaves": circles[False]}
    spacing = float(axes[0][1] - axes[0][0])
    return {name: make_raster(under_circles(own, axes, CANOPY), spacing, *axes) for name, own in kinds.items()}


def feet(builder: WorldBuilder) -> Array:
    """Positions (n, 2) [m] of trunks, posts and legs at the ground, ``FOOT`` apart; bushes, wires, water have none."""
    cells = [np.full((1, 2), FAR)]
    for each in builder.instances:
        mesh, pose = builder.meshes[each.mesh], each.world_from_object
        if not {Label.BUSH, Label.CABLE, Label.WATER}.isdisjoint(_labels(builder, mesh)):
            continue
        low = mesh.vertices[mesh.vertices[:, 2] < mesh.vertices[:, 2].min() + SOLE].astype(np.float64)
        cells.append(np.unique(np.round((low @ pose[:3, :3].T + pose[:3, 3])[:, :2] / FOOT), axis=0) * FOOT)
    return np.concatenate(cells)


def _labels(builder: WorldBuilder, mesh: Mesh) -> list[int]:
    """Classes of a mesh's materials."""
    return [int((builder.materials.get(name) or MATERIALS[name]).label) for name in mesh.materials]


def _crown(builder: WorldBuilder, mesh: Mesh) -> float:
    """Radius [m] about the stem that holds 90 % of the leaves' triangles; 0 without leaves."""
    leafy = [k for k, label in enumerate(_labels(builder, mesh)) if label in (Label.TREETOP, Label.BUSH)]
    faces = mesh.faces[np.isin(mesh.material, leafy)]
    return float(np.quantile(np.hypot(*mesh.vertices[faces[:, 0], :2].T), 0.9)) if len(faces) else 0.0


def _has_needles(mesh: Mesh) -> bool:
    woody = [TREES[name] if name in TREES else BUSHES[name] for name in mesh.species if name in TREES or name in BUSHES]
    return any(species.grown.leaf.prongs for species in woody)


def raise_roots(builder: WorldBuilder, trunks: Sequence[Instance], rng: np.random.Generator) -> None:
    """Raise the ground over the roots of trunks, on trails as in the litter.

    Roots are narrower than the nodes of a coarse terrain; there is only the swell about a trunk.
    """
    field, found = builder.field, []
    for each in trunks:
        scale = float(np.linalg.norm(each.world_from_object[:3, 0]))
        cylinders = [c for c in builder.meshes[each.mesh].colliders if c.shape == "cylinder" and not c.points]
        found += [(*each.world_from_object[:2, 3], scale * trunk.size[0]) for trunk in cylinders[:1]]
    swells = root_swells(*grid_axes(builder.size, field.spacing), found, rng if field.spacing <= ROOTS else None)
    builder.field = replace(field, heights=field.heights + swells.astype(np.float32))


def grouped(
    kind: str, meshes: Sequence[Mesh], count: int, shares: Mapping[str, float], **own: Any
) -> list[ObjectGroup]:
    """Objects by kind; species are as frequent as their ``shares`` say, or equally without any."""
    if not shares and SPECIES not in kind:
        return [ObjectGroup(kind=kind, meshes=meshes, count=count, **own)]
    found = by_species(meshes)
    counts = divided(count or _ANY, {name: shares.get(name, 1.0) for name in found})
    if SPECIES in kind:
        return [
            ObjectGroup(kind=kind.replace(SPECIES, name), meshes=each, count=counts[name], **own)
            for name, each in found.items()
        ]
    mixed = [each[k % len(each)] for name, each in found.items() for k in range(counts[name])]
    return [ObjectGroup(kind=kind, meshes=mixed, count=count, **own)]


def by_species(meshes: Sequence[Mesh]) -> dict[str, list[Mesh]]:
    """Individuals of each species, in the order of their first ones."""
    found: dict[str, list[Mesh]] = {}
    for mesh in meshes:
        found.setdefault(mesh.species[0] if mesh.species else "", []).append(mesh)
    return found


_ANY: Final = 100
"""Meshes by share of which objects in rows draw theirs."""


def divided(count: int, shares: Mapping[str, float]) -> dict[str, int]:
    """Divide a count by shares; the last one gets what rounding leaves."""
    total, left, parts = sum(shares.values()), count, dict[str, int]()
    for k, (name, share) in enumerate(shares.items(), 1):
        parts[name] = left if k == len(shares) else min(left, round(count * share / total))
        left -= parts[name]
    return parts
