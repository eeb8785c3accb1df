# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A plant from its species: skeleton, skin and leaves in one mesh, with its collider and the room it needs."""

from typing import Final

import numpy as np

from fieldtruth.world.model import Collider, Mesh
from fieldtruth.world.plants.bloom import in_bloom
from fieldtruth.world.plants.growth import ROOT_DEPTH, Stems, dry_branches, grow_skeleton
from fieldtruth.world.plants.leaves import leaf_mesh, place_leaves
from fieldtruth.world.plants.meshing import Surface, trunk, tubes
from fieldtruth.world.plants.species import GrownIn, Habit, Species
from fieldtruth.world.plants.variation import at_detail, individual

WOOD, FOLIAGE, UPPER_WOOD = 0, 1, 2
LEAST_DETAIL: Final = 0.03
REACH_HEIGHT: Final = 1.4  # [m] below which a robot meets branches
TREE_COLLIDER_HEIGHT: Final = 2.0  # [m]


def grow_tree(
    species: Species, *, name: str, height: float, rng: np.random.Generator, detail: float = 1.0,
    grown_in: GrownIn = "open",
) -> Mesh:  # fmt: skip
    """A tree of the given height [m]; below ``species.young_below`` it grows as a young tree.

    ``grown_in`` a "stand" it has a long clear trunk and a narrow crown, "exposed" it is stunted, where the species has
    such forms. ``detail`` (0.03 to 1) is about the share of the triangles (1: some 60,000 for a large tree): leaves
    become fewer and larger, with the same area in all. The same ``rng`` gives other individuals at other details.

    Raises ValueError below half and above twice the height for which the habit's numbers were set.

    The collider is the trunk at breast height and 10 % more, 2 m high. The footprint [m] is the trunk with 0.3 m about
    it or the reach of branches below 1.4 m, and in the open at least a third of the crown's radius: furniture may
    stand below a crown, neighbouring crowns may touch, and those of a stand interlock. A young tree is seen from near
    and has only some 20,000 triangles at detail 1: thin it less than the old ones.
    """
    _check_detail(detail, "a tree")
    habit = at_detail(individual(_habit(species, height, grown_in), rng), detail)
    skeleton = grow_skeleton(habit, height, rng)
    surfaces = _skin(skeleton, habit, height, rng)
    dry = dry_branches(skeleton[0], habit, height, rng)
    if dry is not None and len(dry.length) and habit.dead is not None:
        surfaces.insert(-1, (tubes(_thickest(dry, habit.dead.drawn), habit.dead.sides), WOOD))
    stem = skeleton[0]
    _, _, radius = stem.at(np.zeros(1, np.intp), (1.3 + ROOT_DEPTH) / stem.length[:1])
    breast = 1.1 * float(radius[0])
    collider = Collider(shape="cylinder", size=(breast, min(TREE_COLLIDER_HEIGHT, 0.9 * height)))
    footprint = max(breast + 0.3, _low_reach(surfaces))
    if grown_in != "stand":
        tips = np.concatenate([stems.axis[:, -1, :2] for stems in skeleton[1:]])
        footprint = max(footprint, float(np.quantile(np.hypot(*tips.T), 0.98)) / 3)
    upper = None if species.upper_wood is None else species.upper_from * height
    return _assembled(name, species, surfaces, (collider,), footprint, upper, rng)


def _low_reach(surfaces: list[tuple[Surface, int]]) -> float:
    """Radius [m] within which 98 % of what a robot meets of branches and leaves are; 0 if there is none."""
    vertices = np.concatenate([s[0] for s, _ in surfaces[1:]])
    low = vertices[vertices[:, 2] < REACH_HEIGHT]
    return float(np.quantile(np.hypot(low[:, 0], low[:, 1]), 0.98)) if len(low) else 0.0


def grow_bush(species: Species, *, name: str, height: float, rng: np.random.Generator, detail: float = 1.0) -> Mesh:
    """A bush of the given height [m]; its foliage reaches down to the ground.

    ``detail`` as of `grow_tree` (1: from 8,000 to 40,000 triangles, by species). A share ``species.bloom_share`` of the
    leaves, most of them in the outermost parts, are flowers where the species blooms.

    The collider is a cylinder of 0.7 of the bush's radius, so that a wheel may brush the outer twigs; the footprint
    [m] is the whole radius, within which 98 % of the leaf corners are.
    """
    _check_detail(detail, "a bush")
    habit = at_detail(_habit(species, height), detail)
    surfaces = _skin(grow_skeleton(habit, height, rng), habit, height, rng)
    (foliage, *_), _ = surfaces[-1]
    radius = float(np.quantile(np.hypot(foliage[:, 0], foliage[:, 1]), 0.98))
    collider = Collider(shape="cylinder", size=(0.7 * radius, 0.9 * height))
    mesh = _assembled(name, species, surfaces, (collider,), radius)
    return mesh if species.bloom is None else in_bloom(mesh, FOLIAGE, species.bloom, species.bloom_share, rng)


def _check_detail(detail: float, what: str) -> None:
    if not LEAST_DETAIL <= detail <= 1:
        raise ValueError(f"detail of {what} = {detail}: must be from {LEAST_DETAIL:g} to 1")


def _habit(species: Species, height: float, grown_in: GrownIn = "open") -> Habit:
    """The habit at this height [m]; raises ValueError where the species' numbers hold no longer."""
    habit = species.habit(height, grown_in)
    low, high = 0.5 * habit.height, 2.0 * habit.height
    if not low <= height <= high:
        raise ValueError(f"height of a {species.name} = {height} m: must be from {low:g} to {high:g} m")
    return habit


def _skin(
    skeleton: tuple[Stems, ...], habit: Habit, height: float, rng: np.random.Generator
) -> list[tuple[Surface, int]]:
    """Surfaces of all stems and leaves, each with its row of the materials."""
    base = skeleton[0]
    single = habit.stems == 1
    surfaces = [(trunk(base, habit.trunk_sides, habit.flare, rng) if single else tubes(base, habit.trunk_sides), WOOD)]
    for stems, order in zip(skeleton[1:], habit.orders, strict=True):
        surfaces.append((tubes(_thickest(stems, order.drawn), order.sides), WOOD))
    surfaces.append((leaf_mesh(place_leaves(skeleton, habit, height, rng), habit.leaf, rng), FOLIAGE))
    return surfaces


def _thickest(stems: Stems, share: float) -> Stems:
    """The share of the stems that are drawn, in their order."""
    if share >= 1:
        return stems
    order = np.argsort(-stems.radius[:, 0], kind="stable")
    return stems.take(np.sort(order[: round(share * len(order))]))


def _assembled(
    name: str, species: Species, surfaces: list[tuple[Surface, int]], colliders: tuple[Collider, ...],
    footprint: float, upper: float | None = None, rng: np.random.Generator | None = None,
) -> Mesh:  # fmt: skip
    """One mesh of several surfaces; wood above a ragged line about ``upper`` [m] has the upper bark."""
    offsets = np.cumsum([0, *(len(s[0]) for s, _ in surfaces)])
    vertices = np.concatenate([s[0] for s, _ in surfaces])
    faces = np.concatenate([s[3] + np.int32(o) for (s, _), o in zip(surfaces, offsets, strict=False)])
    material = np.concatenate([np.full(len(s[3]), row, np.int32) for s, row in surfaces])
    materials = [species.wood, species.foliage]
    if upper is not None and rng is not None and species.upper_wood is not None:
        middle = vertices[faces, 2].mean(1)
        material[(material == WOOD) & (middle > upper + rng.normal(0, 0.05 * upper, len(faces)))] = UPPER_WOOD
        materials.append(species.upper_wood)
    return Mesh(
        name=name,
        vertices=vertices.astype(np.float32),
        normals=np.concatenate([s[1] for s, _ in surfaces]).astype(np.float32),
        uv=np.concatenate([s[2] for s, _ in surfaces]).astype(np.float32),
        faces=faces,
        material=material,
        materials=tuple(materials),
        colliders=colliders,
        footprint=footprint,
    )
