# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Trees and bushes of a species: stems, leaves and flowers in one mesh, with its collider and footprint.

Leaves are single blades on stalks along the twigs, each of two or four triangles, and sprays of needles. At full detail
leaves have their real size and number: 60,000 to 100,000 on a large tree. With less detail they are fewer and larger,
of the same form and total area, each in the middle of those that it stands for. A blade turns its upper side up and
outwards to the light and droops a little. Shading normals are the blade's own, blended with the outward normals of the
crown and of the limb's leaves, so that a crown looks like lit volumes and not like noise (Luft, Balzer and Deussen,
"Expressive Illumination of Foliage Based on Implicit Surfaces", Natural Phenomena 2007, with ellipsoids instead of
their implicit surfaces).

A bush in bloom: some of its leaves, in patches on the outside, become flowers.
"""

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Index
from fieldtruth.core.classes import PlantPart
from fieldtruth.world.model import Collider, Mesh
from fieldtruth.world.plants.growth import (
    ROOT_DEPTH,
    Stems,
    Surface,
    dry_branches,
    gathered,
    grow_skeleton,
    merged,
    sideways,
    spread_along,
    trunk,
    tubes,
    unit,
)
from fieldtruth.world.plants.species import (
    SIDE_PRONG,
    GrownIn,
    Habit,
    Leaf,
    Order,
    Species,
    at_detail,
    heights_of,
    individual,
    outline_corners,
)

CURL = 0.14  # mean sine of the angle by which a leaf's tip bends out of its plane
OUTWARD_BLEND = 0.45  # weight of the outward normal in a leaf's shading normal


@dataclass(frozen=True, kw_only=True)
class Leaves:
    """The ``m`` leaves of a plant: the base of each stalk, and each blade's frame."""

    twig: Array  # (m, 3) [m] on the twig's axis
    base: Array  # (m, 3) [m] base of the blade
    midrib: Array  # (m, 3) unit, from base to tip
    normal: Array  # (m, 3) unit, out of the upper side
    length: Array  # (m,) [m]
    outward: Array  # (m, 3) unit, away from the middle of crown and limb
    limb: Index  # (m,) number of the limb that it grows on


class _Skin(NamedTuple):
    """A surface of equal shapes, its row in the materials, and the limb (n,) of each shape, -1 for the trunk."""

    surface: Surface
    row: int
    limb: Index


def place_leaves(skeleton: tuple[Stems, ...], habit: Habit, height: float, rng: np.random.Generator) -> Leaves:
    """Leaves along the twigs of all orders with foliage, above the clear height."""
    leafy = [(s, o) for s, o in zip(skeleton[1:], habit.orders, strict=True) if o.foliage > 0 and len(s.length)]
    limbs = int(skeleton[1].limb.max(initial=-1)) + 1
    live = rng.random(limbs) >= habit.dead_limbs  # first, so that the same limbs are alive at each detail
    number = habit.leaf.number * height / habit.height
    shares = np.array([o.foliage * (1 - o.leaf_start) * s.length.sum() for s, o in leafy])
    parts = [
        _along(stems, order, habit.leaf, share, rng)
        for (stems, order), share in zip(leafy, number * shares / shares.sum(), strict=True)
    ]
    twig, tangent, side = (np.concatenate([part[k] for part in parts]) for k in range(3))
    limb = np.concatenate([part[3] for part in parts])
    alive = live[limb]
    twig, tangent, side, limb = twig[alive], tangent[alive], side[alive], limb[alive]
    leaves = _oriented(habit.leaf, twig, tangent, side, limb, rng)
    half = 0.5 * habit.leaf.width * leaves.length
    lowest = np.minimum(leaves.base[:, 2], leaves.base[:, 2] + leaves.midrib[:, 2] * leaves.length) - half
    rows = np.flatnonzero(lowest > habit.clear)
    return Leaves(**{key: value[rows] for key, value in vars(leaves).items()})


def _along(
    stems: Stems, order: Order, form: Leaf, number: float, rng: np.random.Generator
) -> tuple[Array, Array, Array, Index]:
    """Leaf positions [m] on the stems of one order, the stems' tangents, the leaves' directions, and the limbs."""
    start = np.full(len(stems.length), order.leaf_start)
    parent, rank, joint = spread_along(stems, start, number, rng)
    position, tangent, _ = stems.at(parent, joint)
    return position, tangent, sideways(tangent, parent, rank, form.arrangement, 40.0, rng), stems.limb[parent]


def _oriented(form: Leaf, twig: Array, tangent: Array, side: Array, limb: Index, rng: np.random.Generator) -> Leaves:
    """Leaves with their upper sides turned to the light."""
    n = len(twig)
    outward = _outward(twig, limb)
    stalk = unit(form.forward * tangent + side + rng.normal(0, 0.25, (n, 3)))
    midrib = unit(stalk + 0.35 * outward - [0, 0, form.droop] + rng.normal(0, 0.25, (n, 3)))
    light = form.flatness * np.array([0, 0, 1.0]) + outward + rng.normal(0, 0.45, (n, 3))
    normal = unit(light - (light * midrib).sum(1, keepdims=True) * midrib)
    length = form.length * np.exp(rng.normal(0, form.size_spread, n).clip(-0.5, 0.4))
    # A leaf that stands for several has its middle where theirs would be.
    base = twig + form.stalk * stalk - 0.5 * (1 - form.stands_for**-0.5) * length[:, None] * midrib
    return Leaves(twig=twig, base=base, midrib=midrib, normal=normal, length=length, outward=outward, limb=limb)


def _outward(points: Array, limb: Index) -> Array:
    """Unit vectors away from the middle of the crown (an ellipsoid's normal) and of each limb's leaves, averaged."""
    middle = points.mean(0)
    spread = points.std(0) + 1e-9
    crown = unit((points - middle) / spread**2)
    count = np.maximum(np.bincount(limb), 1)
    centre = np.stack([np.bincount(limb, points[:, k]) / count for k in range(3)], 1)
    clump = unit(points - centre[limb])
    return unit(crown + clump)


def leaf_mesh(leaves: Leaves, form: Leaf, rng: np.random.Generator) -> Surface:
    """Vertices (k m, 3) [m], normals, uv and faces of blades with k corners: base, left, tip, right downwards.

    A kite has 4 corners, a rounded blade 6. v is along the midrib. Outlines vary between blades and
    between the halves of a blade. Sprays have three corners per prong: left, right, tip.
    """
    if form.prongs:
        return _spray_mesh(leaves, form, rng)
    m, side = len(leaves.length), outline_corners(form)
    corners = 2 * len(side) + 2
    left = np.cross(leaves.normal, leaves.midrib)
    fold = np.radians(form.fold * rng.uniform(0.2, 1.6, (m, 1)))
    scale = leaves.length[:, None]
    tip = len(side) + 1
    vertices, uv = np.empty((m, corners, 3)), np.empty((corners, 2))
    # The tip bends down, seldom up; narrow leaves less, whose area this would change.
    curl = min(form.width / 0.6, 1.0) * rng.normal(CURL, 0.6 * CURL, (m, 1)).clip(-CURL, 3 * CURL)
    vertices[:, 0] = leaves.base
    vertices[:, tip] = leaves.base + scale * (np.sqrt(1 - curl**2) * leaves.midrib - curl * leaves.normal)
    uv[0], uv[tip] = (0.5, 0.03), (0.5, 0.97)
    for sign in (1.0, -1.0):
        broad, shift = rng.uniform(0.8, 1.15, (m, 1)), rng.uniform(-0.07, 0.07, (m, 1))
        across = sign * np.cos(fold) * left + np.sin(fold) * leaves.normal
        for k, (along, half) in enumerate(side, start=1):
            corner = k if sign > 0 else corners - k
            out = form.width * half * broad * scale
            vertices[:, corner] = leaves.base + (along + shift) * scale * leaves.midrib + out * across
            uv[corner] = 0.5 - sign * 0.92 * half, along

    tilt, bow = np.sin(fold) * left, curl * leaves.midrib
    inclined = [
        leaves.normal - bow, *len(side) * [leaves.normal - tilt],
        leaves.normal + 2 * bow, *len(side) * [leaves.normal + tilt],
    ]  # fmt: skip
    own = unit(np.stack(inclined, 1))
    outward = leaves.outward[:, None]
    # A blade that faces inwards keeps its own normal: a blend would point to its lower side.
    blend = np.where((own * outward).sum(2, keepdims=True) < -0.3, 0.0, OUTWARD_BLEND)
    normals = unit((1 - blend) * own + blend * outward)
    fan = [[0, k + 1, k] for k in range(1, corners - 1)]
    return gathered(vertices, normals, np.broadcast_to(uv, (m, corners, 2)), fan)


def _spray_mesh(leaves: Leaves, form: Leaf, rng: np.random.Generator) -> Surface:
    """Sprays: pointed prongs side by side, the outer ones shorter and bent a little off the plane."""
    m, k = len(leaves.length), form.prongs
    rank = np.arange(k) - 0.5 * (k - 1)
    left = np.cross(leaves.normal, leaves.midrib)[:, None]
    angle = np.radians(form.splay * rank + rng.normal(0, 0.25 * form.splay, (m, k)))[..., None]
    rise = np.tan(np.radians(form.fold)) * rng.normal(0, 1, (m, k, 1)).clip(-1.5, 1.5)
    along = unit(np.cos(angle) * leaves.midrib[:, None] + np.sin(angle) * left + rise * leaves.normal[:, None])
    size = leaves.length[:, None, None] * np.where(np.abs(rank) < 0.6, 1.0, SIDE_PRONG)[:, None]
    size = size * rng.uniform(0.85, 1.15, (m, k, 1))
    across = unit(np.cross(leaves.normal[:, None], along))
    half = 0.5 * form.width * leaves.length[:, None, None] * across
    apart = form.stagger * (np.abs(rank) + 0.35 * rank) * (np.abs(rank) > 0.6)
    base = leaves.base[:, None] + leaves.length[:, None, None] * apart[:, None] * leaves.midrib[:, None]
    vertices = np.stack([base + half, base - half, base + size * along], 2)
    own = np.cross(along, across)
    outward = leaves.outward[:, None]
    blend = np.where((own * outward).sum(2, keepdims=True) < -0.3, 0.0, OUTWARD_BLEND)
    normals = np.repeat(unit((1 - blend) * own + blend * outward)[:, :, None], 3, 2)
    uv = np.broadcast_to([[0.08, 0.03], [0.92, 0.03], [0.5, 0.97]], (m, k, 3, 2))
    faces = np.arange(3 * m * k).reshape(-1, 3)[:, [0, 1, 2]]
    return vertices.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2), faces.astype(np.int32)


FLOWER_SIZE: Final = 0.6
"""Length of a flower relative to the leaf that it replaces."""


def in_bloom(mesh: Mesh, foliage: int, flower: str, share: float, rng: np.random.Generator) -> Mesh:
    """The mesh with a ``share`` of the leaves of material row ``foliage`` replaced by flowers.

    The triangles of a leaf share their first vertex. Leaves far from the middle bloom first, some patches more than
    others.
    """
    of_leaf = np.flatnonzero(mesh.material == foliage)
    first, number = np.unique(mesh.faces[of_leaf, 0], return_inverse=True)
    middle = np.zeros((len(first), 3))
    np.add.at(middle, number, mesh.vertices[mesh.faces[of_leaf]].mean(axis=1))
    middle /= np.bincount(number)[:, None]
    centre, spread = middle.mean(0), middle.std(0) + 1e-9
    outwards = np.linalg.norm((middle - centre) / spread, axis=1) + 0.5 * (middle[:, 2] - centre[2]) / spread[2]
    waves = rng.normal(0, 2.2, (3, 3)) / spread.mean()
    patch = np.cos(middle @ waves.T + rng.uniform(0, 2 * np.pi, 3)).sum(axis=1)
    score = outwards + 0.5 * patch + rng.normal(0, 0.5, len(first))
    blooming = score > np.quantile(score, 1 - share)
    rows = of_leaf[blooming[number]]
    material, part = mesh.material.copy(), mesh.face_parts.copy()
    material[rows], part[rows] = len(mesh.materials), PlantPart.FLOWER
    vertices = mesh.vertices.copy()
    corner, base = mesh.faces[rows, 1:].ravel(), mesh.vertices[mesh.faces[rows, 0]].repeat(2, axis=0)
    vertices[corner] = base + np.float32(FLOWER_SIZE) * (mesh.vertices[corner] - base)
    return replace(mesh, vertices=vertices, material=material, materials=(*mesh.materials, flower), part=part)


WOOD, FOLIAGE, UPPER_WOOD = 0, 1, 2
LEAST_DETAIL: Final = 0.005
LOW: Final = 1.4  # [m], height below which branches can touch a robot
TREE_COLLIDER_HEIGHT: Final = 2.0  # [m]
COLLIDER: Final = 1.1
"""Radius of a tree's collider over that of its trunk at breast height."""


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

    The collider is the trunk, 2 m high, with ``COLLIDER`` times the radius at breast height. The footprint [m] is 0.3 m
    more, or the extent of branches below 1.4 m, and in the open at least a third of the crown's radius: furniture may
    be below a crown, neighbouring crowns may touch, and those of a stand interlock.

    Raises ValueError for a height below half or above twice that of the habit.
    """
    _check_detail(detail)
    habit = individual(_habit(species, height, grown_in), rng)
    drawn = at_detail(habit, detail)
    skeleton = grow_skeleton(habit, height, rng)
    dry = dry_branches(skeleton[0], habit, height, rng)
    surfaces = _surfaces(skeleton, drawn, height, rng)
    if dry is not None and len(dry.length) and drawn.dead is not None:
        surfaces.insert(-1, _tubes(dry, drawn.dead)._replace(limb=_OF_TRUNK))
    stem = skeleton[0]
    _, _, radius = stem.at(np.zeros(1, np.intp), (1.3 + ROOT_DEPTH) / stem.length[:1])
    breast = COLLIDER * float(radius[0])
    collider = Collider(shape="cylinder", size=(breast, min(TREE_COLLIDER_HEIGHT, 0.9 * height)))
    footprint = max(breast + 0.3, _low_extent(surfaces))
    if grown_in != "stand":
        tips = np.concatenate([stems.axis[:, -1, :2] for stems in skeleton[1:]])
        footprint = max(footprint, float(np.quantile(np.hypot(*tips.T), 0.98)) / 3)
    mesh = _mesh(name, species, surfaces, _material_rows(species, surfaces, height, rng), collider, footprint)
    return mesh if habit.stems > 1 else _with_limbs(mesh, surfaces, skeleton[1])


def _with_limbs(mesh: Mesh, surfaces: list[_Skin], limbs: Stems) -> Mesh:
    """The mesh with the limb of each face, and where limbs leave the trunk."""
    joints = np.zeros((int(limbs.limb.max(initial=-1)) + 1, 3), np.float32)
    joints[limbs.limb] = limbs.axis[:, 0]
    of_faces = [each.limb.repeat(len(each.surface[3]) // max(len(each.limb), 1)) for each in surfaces]
    return replace(mesh, limb=np.concatenate(of_faces).astype(np.int16), joints=joints)


def _low_extent(surfaces: list[_Skin]) -> float:
    """Radius [m] around 98 % of the vertices of low branches and leaves; 0 without any."""
    vertices = np.concatenate([each.surface[0] for each in surfaces[1:]])
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
    foliage = surfaces[-1].surface[0]
    radius = float(np.quantile(np.hypot(foliage[:, 0], foliage[:, 1]), 0.98))
    collider = Collider(shape="cylinder", size=(0.7 * radius, 0.9 * height))
    mesh = _mesh(name, species, surfaces, _material_rows(species, surfaces, height, rng), collider, radius)
    return mesh if species.bloom is None else in_bloom(mesh, FOLIAGE, species.bloom, species.bloom_share, rng)


def _check_detail(detail: float) -> None:
    if not LEAST_DETAIL <= detail <= 1:
        raise ValueError(f"detail must be between {LEAST_DETAIL:g} and 1, got {detail}")


def _habit(species: Species, height: float, grown_in: GrownIn = "open") -> Habit:
    """The habit at this height [m]; raises ValueError outside the heights that it is made for."""
    low, high = heights_of(species, height, grown_in)
    if not low <= height <= high:
        raise ValueError(f"height of {species.name} must be between {low:g} and {high:g} m, got {height}")
    return species.habit(height, grown_in)


_OF_TRUNK: Final = np.full(1, -1, np.intp)
"""Limb of a surface that is the trunk's as a whole."""


def _surfaces(skeleton: tuple[Stems, ...], habit: Habit, height: float, rng: np.random.Generator) -> list[_Skin]:
    """Surfaces of the stems from the ground, of branches and of leaves."""
    base = skeleton[0].thinned(habit.trunk_segments)
    single = habit.stems == 1
    foot = trunk(base, habit.trunk_sides, habit.flare, rng) if single else tubes(base, habit.trunk_sides)
    surfaces = [_Skin(foot, WOOD, _OF_TRUNK)]
    for stems, order in zip(skeleton[1:], habit.orders, strict=True):
        surfaces.append(_tubes(stems, order))
    leaves = place_leaves(skeleton, habit, height, rng)
    surfaces.append(_Skin(leaf_mesh(leaves, habit.leaf, rng), FOLIAGE, leaves.limb))
    return surfaces


def _tubes(stems: Stems, order: Order) -> _Skin:
    """The surface of the stems of one order that are drawn."""
    drawn = _thickest(stems, order.drawn)
    return _Skin(tubes(drawn.thinned(order.segments), order.sides), WOOD, drawn.limb)


def _thickest(stems: Stems, share: float) -> Stems:
    """The thickest stems, in the given order; ``share`` is their share of the number."""
    if share >= 1:
        return stems
    order = np.argsort(-stems.radius[:, 0], kind="stable")
    return stems.take(np.sort(order[: round(share * len(order))]))


def _mesh(
    name: str,
    species: Species,
    surfaces: list[_Skin],
    rows: NDArray[np.integer],
    collider: Collider,
    footprint: float,
) -> Mesh:
    materials = [species.wood, species.foliage, *([] if species.upper_wood is None else [species.upper_wood])]
    faces = [each.surface for each in surfaces]
    parts = [PlantPart.STEM, *[PlantPart.BRANCH] * (len(faces) - 2), PlantPart.LEAF]
    own = (species.name,)
    return merged(name, faces, rows, materials, parts=parts, colliders=(collider,), footprint=footprint, species=own)


def _material_rows(
    species: Species, surfaces: list[_Skin], height: float, rng: np.random.Generator
) -> NDArray[np.integer]:
    """Material row of each face; wood above a ragged line around the trunk has the upper bark."""
    rows = np.concatenate([np.full(len(surface[3]), row) for surface, row, _ in surfaces])
    if species.upper_wood is not None:
        limit = species.upper_from * height
        middle = np.concatenate([vertices[faces, 2].mean(1) for (vertices, _, _, faces), *_ in surfaces])
        rows[(rows == WOOD) & (middle > limit + rng.normal(0, 0.05 * limit, len(rows)))] = UPPER_WOOD
    return rows
