# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A tree or bush of a species: stems and leaves in one mesh, with its collider and footprint."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.world.model import Collider, Mesh
from fieldtruth.world.plants.bloom import in_bloom
from fieldtruth.world.plants.growth import ROOT_DEPTH, Stems, dry_branches, grow_skeleton
from fieldtruth.world.plants.leaves import leaf_mesh, place_leaves
from fieldtruth.world.plants.meshing import Surface, merged, trunk, tubes
from fieldtruth.world.plants.species import GrownIn, Habit, Order, Species
from fieldtruth.world.plants.variation import at_detail, individual

WOOD, FOLIAGE, UPPER_WOOD = 0, 1, 2
LEAST_DETAIL: Final = 0.005
LOW: Final = 1.4  # [m], height below which branches can touch a robot
TREE_COLLIDER_HEIGHT: Final = 2.0  # [m]


def grow_tree(
    species: Species,
    *,
    name: str,
    height: float,
    rng: np.random.Generator,
    detail: float = 1.0,
    grown_in: GrownIn = "open",
) -> Mesh:
    """A tree of the given height [m]; below ``species.young_below`` it grows as a young tree.

    Trees grown in a "stand" have a long clear trunk and a narrow crown, "exposed" ones are stunted, if the species has
    such habits. ``detail`` (0.005 to 1) is the share of the leaves (1: up to 100,000, of real size, with two triangles
    each); the fewer are larger, with the same total area. The same ``rng`` gives the same stems at each detail.

    The collider is the trunk, 2 m high, with 1.1 times the radius at breast height. The footprint [m] is 0.3 m more, or
    the extent of branches below 1.4 m, and in the open at least a third of the crown's radius: furniture may be below a
    crown, neighbouring crowns may touch, and those of a stand interlock.

    Raises ValueError for a height below half or above twice that of the habit.
    """
    _check_detail(detail)
    habit = individual(_habit(species, height, grown_in), rng)
    drawn = at_detail(habit, detail)
    skeleton = grow_skeleton(habit, height, rng)
    dry = dry_branches(skeleton[0], habit, height, rng)
    surfaces = _surfaces(skeleton, drawn, height, rng)
    if dry is not None and len(dry.length) and drawn.dead is not None:
        surfaces.insert(-1, (_tubes(dry, drawn.dead), WOOD))
    stem = skeleton[0]
    _, _, radius = stem.at(np.zeros(1, np.intp), (1.3 + ROOT_DEPTH) / stem.length[:1])
    breast = 1.1 * float(radius[0])
    collider = Collider(shape="cylinder", size=(breast, min(TREE_COLLIDER_HEIGHT, 0.9 * height)))
    footprint = max(breast + 0.3, _low_extent(surfaces))
    if grown_in != "stand":
        tips = np.concatenate([stems.axis[:, -1, :2] for stems in skeleton[1:]])
        footprint = max(footprint, float(np.quantile(np.hypot(*tips.T), 0.98)) / 3)
    return _mesh(name, species, surfaces, _material_rows(species, surfaces, height, rng), collider, footprint)


def _low_extent(surfaces: list[tuple[Surface, int]]) -> float:
    """Radius [m] around 98 % of the vertices of low branches and leaves; 0 without any."""
    vertices = np.concatenate([s[0] for s, _ in surfaces[1:]])
    low = vertices[vertices[:, 2] < LOW]
    return float(np.quantile(np.hypot(low[:, 0], low[:, 1]), 0.98)) if len(low) else 0.0


def grow_bush(species: Species, *, name: str, height: float, rng: np.random.Generator, detail: float = 1.0) -> Mesh:
    """A bush of the given height [m] with foliage down to the ground.

    ``detail`` is as in `grow_tree`. If the species blooms, the share
    ``species.bloom_share`` of the leaves, mostly on the outside, are flowers.

    The footprint [m] is the radius around 98 % of the leaf corners. The collider is a cylinder of 0.7 of that radius,
    so that a wheel may brush the outer twigs.
    """
    _check_detail(detail)
    habit = _habit(species, height)
    surfaces = _surfaces(grow_skeleton(habit, height, rng), at_detail(habit, detail), height, rng)
    (foliage, *_), _ = surfaces[-1]
    radius = float(np.quantile(np.hypot(foliage[:, 0], foliage[:, 1]), 0.98))
    collider = Collider(shape="cylinder", size=(0.7 * radius, 0.9 * height))
    mesh = _mesh(name, species, surfaces, _material_rows(species, surfaces, height, rng), collider, radius)
    return mesh if species.bloom is None else in_bloom(mesh, FOLIAGE, species.bloom, species.bloom_share, rng)


def _check_detail(detail: float) -> None:
    if not LEAST_DETAIL <= detail <= 1:
        raise ValueError(f"detail must be between {LEAST_DETAIL:g} and 1, got {detail}")


def _habit(species: Species, height: float, grown_in: GrownIn = "open") -> Habit:
    """The habit at this height [m]; raises ValueError outside the heights that it is made for."""
    habit = species.habit(height, grown_in)
    low, high = 0.5 * habit.height, 2.0 * habit.height
    if not low <= height <= high:
        raise ValueError(f"height of {species.name} must be between {low:g} and {high:g} m, got {height}")
    return habit


def _surfaces(
    skeleton: tuple[Stems, ...], habit: Habit, height: float, rng: np.random.Generator
) -> list[tuple[Surface, int]]:
    """Surfaces of all stems and leaves, each with its row in the materials."""
    base = skeleton[0].thinned(habit.trunk_segments)
    single = habit.stems == 1
    surfaces = [(trunk(base, habit.trunk_sides, habit.flare, rng) if single else tubes(base, habit.trunk_sides), WOOD)]
    for stems, order in zip(skeleton[1:], habit.orders, strict=True):
        surfaces.append((_tubes(stems, order), WOOD))
    surfaces.append((leaf_mesh(place_leaves(skeleton, habit, height, rng), habit.leaf, rng), FOLIAGE))
    return surfaces


def _tubes(stems: Stems, order: Order) -> Surface:
    """The surface of the stems of one order that are drawn."""
    return tubes(_thickest(stems, order.drawn).thinned(order.segments), order.sides)


def _thickest(stems: Stems, share: float) -> Stems:
    """The thickest stems, in the given order; ``share`` is their share of the number."""
    if share >= 1:
        return stems
    order = np.argsort(-stems.radius[:, 0], kind="stable")
    return stems.take(np.sort(order[: round(share * len(order))]))


def _mesh(
    name: str,
    species: Species,
    surfaces: list[tuple[Surface, int]],
    rows: NDArray[np.integer],
    collider: Collider,
    footprint: float,
) -> Mesh:
    materials = [species.wood, species.foliage, *([] if species.upper_wood is None else [species.upper_wood])]
    faces = [surface for surface, _ in surfaces]
    own = (species.name,)
    return merged(name, faces, rows, materials, colliders=(collider,), footprint=footprint, species=own)


def _material_rows(
    species: Species, surfaces: list[tuple[Surface, int]], height: float, rng: np.random.Generator
) -> NDArray[np.integer]:
    """Material row of each face; wood above a ragged line around the trunk has the upper bark."""
    rows = np.concatenate([np.full(len(surface[3]), row) for surface, row in surfaces])
    if species.upper_wood is not None:
        limit = species.upper_from * height
        middle = np.concatenate([vertices[faces, 2].mean(1) for (vertices, _, _, faces), _ in surfaces])
        rows[(rows == WOOD) & (middle > limit + rng.normal(0, 0.05 * limit, len(rows)))] = UPPER_WOOD
    return rows
