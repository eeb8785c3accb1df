# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A plant from its species: skeleton, skin and leaves in one mesh, with its collider and the room it needs."""

import numpy as np

from fieldtruth.world.model import Collider, Mesh
from fieldtruth.world.plants.growth import ROOT_DEPTH, Stems, grow_skeleton
from fieldtruth.world.plants.leaves import leaf_mesh, place_leaves
from fieldtruth.world.plants.meshing import Surface, trunk, tubes
from fieldtruth.world.plants.species import Habit, Species

WOOD, FOLIAGE = 0, 1


def grow_tree(species: Species, *, name: str, height: float, rng: np.random.Generator) -> Mesh:
    """A tree of the given height [m]; below ``species.young_below`` it grows as a young tree.

    Raises ValueError below half and above twice the height for which the habit's numbers were set.

    The collider is the trunk at breast height and 10 % more, 2 m high. The footprint [m] is the
    trunk with 0.3 m about it or a third of the crown's radius, whichever is larger: furniture may stand below a crown,
    and neighbouring crowns may touch.
    """
    habit = _habit(species, height)
    skeleton = grow_skeleton(habit, height, rng)
    surfaces = _skin(skeleton, habit, height, rng)
    stem = skeleton[0]
    _, _, radius = stem.at(np.zeros(1, np.intp), (1.3 + ROOT_DEPTH) / stem.length[:1])
    breast = 1.1 * float(radius[0])
    tips = np.concatenate([stems.axis[:, -1, :2] for stems in skeleton[1:]])
    crown = float(np.quantile(np.hypot(*tips.T), 0.98))
    collider = Collider(shape="cylinder", size=(breast, 2.0))
    return _assembled(name, species, surfaces, (collider,), max(breast + 0.3, crown / 3))


def grow_bush(species: Species, *, name: str, height: float, rng: np.random.Generator) -> Mesh:
    """A bush of the given height [m]; its foliage reaches down to the ground.

    The collider is a cylinder of 0.7 of the bush's radius, so that a wheel may brush the outer twigs; the footprint
    [m] is the whole radius, within which 98 % of the leaf corners are.
    """
    habit = _habit(species, height)
    surfaces = _skin(grow_skeleton(habit, height, rng), habit, height, rng)
    (foliage, *_), _ = surfaces[-1]
    radius = float(np.quantile(np.hypot(foliage[:, 0], foliage[:, 1]), 0.98))
    collider = Collider(shape="cylinder", size=(0.7 * radius, 0.9 * height))
    return _assembled(name, species, surfaces, (collider,), radius)


def _habit(species: Species, height: float) -> Habit:
    """The habit at this height [m]; raises ValueError where the species' numbers hold no longer."""
    habit = species.habit(height)
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
        surfaces.append((tubes(stems, order.sides), WOOD))
    surfaces.append((leaf_mesh(place_leaves(skeleton, habit, height, rng), habit.leaf, rng), FOLIAGE))
    return surfaces


def _assembled(
    name: str, species: Species, surfaces: list[tuple[Surface, int]], colliders: tuple[Collider, ...], footprint: float
) -> Mesh:
    """One mesh of several surfaces."""
    offsets = np.cumsum([0, *(len(s[0]) for s, _ in surfaces)])
    return Mesh(
        name=name,
        vertices=np.concatenate([s[0] for s, _ in surfaces]).astype(np.float32),
        normals=np.concatenate([s[1] for s, _ in surfaces]).astype(np.float32),
        uv=np.concatenate([s[2] for s, _ in surfaces]).astype(np.float32),
        faces=np.concatenate([s[3] + np.int32(o) for (s, _), o in zip(surfaces, offsets, strict=False)]),
        material=np.concatenate([np.full(len(s[3]), row, np.int32) for s, row in surfaces]),
        materials=(species.wood, species.foliage),
        colliders=colliders,
        footprint=footprint,
    )
