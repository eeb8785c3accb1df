# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Leaves: single blades on stalks along the twigs, each of two or four triangles, and sprays of needles.

At full detail leaves have their real size and number: 60,000 to 100,000 on a large tree. With less detail they are
fewer and larger, of the same form and total area, each in the middle of those that it stands for. A blade turns its
upper side up and outwards to the light and droops a little. Shading normals are the blade's own, blended with the
outward normals of the crown and of the limb's leaves, so that a crown looks like lit volumes and not like noise (Luft,
Balzer and Deussen, "Expressive Illumination of Foliage Based on Implicit Surfaces", Natural Phenomena 2007, with
ellipsoids instead of their implicit surfaces).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Index
from fieldtruth.world.plants.growth import Stems, sideways, spread_along, unit
from fieldtruth.world.plants.species import Habit, Leaf, Order
from fieldtruth.world.plants.variation import SIDE_PRONG, outline_corners

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
    return Leaves(twig=twig, base=base, midrib=midrib, normal=normal, length=length, outward=outward)


def _outward(points: Array, limb: Index) -> Array:
    """Unit vectors away from the middle of the crown (an ellipsoid's normal) and of each limb's leaves, averaged."""
    middle = points.mean(0)
    spread = points.std(0) + 1e-9
    crown = unit((points - middle) / spread**2)
    count = np.maximum(np.bincount(limb), 1)
    centre = np.stack([np.bincount(limb, points[:, k]) / count for k in range(3)], 1)
    clump = unit(points - centre[limb])
    return unit(crown + clump)


def leaf_mesh(leaves: Leaves, form: Leaf, rng: np.random.Generator) -> tuple[Array, Array, Array, NDArray[np.int32]]:
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
    faces = corners * np.arange(m)[:, None, None] + np.array(fan)
    uvs = np.broadcast_to(uv, (m, corners, 2))
    return vertices.reshape(-1, 3), normals.reshape(-1, 3), uvs.reshape(-1, 2), faces.reshape(-1, 3).astype(np.int32)


def _spray_mesh(leaves: Leaves, form: Leaf, rng: np.random.Generator) -> tuple[Array, Array, Array, NDArray[np.int32]]:
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
