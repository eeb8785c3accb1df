# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Leaves: single blades on stalks along the twigs, each a kite of two triangles folded along its midrib.

A real tree of ten metres has some 200,000 leaves of 6 cm; we draw fewer and larger ones of the same form. A blade turns
its upper side up and outwards to the light and hangs a little. Shading normals are the blade's own, blended with the
outward normal of the crown and of the limb's clump, so that a crown reads as lit volumes and not as noise (Luft, Balzer
and Deussen, "Expressive Illumination of Foliage Based on Implicit Surfaces", Natural Phenomena 2007, with ellipsoids
in place of their implicit surfaces).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fieldtruth.world.plants.growth import Array, Stems, sideways, spread_along, unit
from fieldtruth.world.plants.species import Habit, Leaf

OUTWARD_BLEND = 0.55  # weight of the crown's and clump's normal in a leaf's shading normal


@dataclass(frozen=True, kw_only=True)
class Leaves:
    """The ``m`` leaves of a plant: where the stalk leaves the twig, and each blade's frame."""

    twig: Array  # (m, 3) [m] on the twig's axis
    base: Array  # (m, 3) [m] where the blade begins
    midrib: Array  # (m, 3) unit, from base to tip
    normal: Array  # (m, 3) unit, out of the upper side
    length: Array  # (m,) [m]
    outward: Array  # (m, 3) unit, away from crown and clump


def place_leaves(skeleton: tuple[Stems, ...], habit: Habit, rng: np.random.Generator) -> Leaves:
    """Leaves along the twigs of all orders that bear some."""
    twigs, tangents, sides, limbs = [], [], [], []
    for stems, order in zip(skeleton[1:], habit.orders, strict=True):
        if order.leaf_spacing == 0 or len(stems.length) == 0:
            continue
        start = np.full(len(stems.length), order.leaf_start)
        parent, rank, joint = spread_along(stems, start, order.leaf_spacing, rng)
        position, tangent, _ = stems.at(parent, joint)
        twigs.append(position)
        tangents.append(tangent)
        sides.append(sideways(tangent, parent, rank, order.divergence, 40.0, rng))
        limbs.append(stems.limb[parent])
    twig, tangent, side = (np.concatenate(part) for part in (twigs, tangents, sides))
    leaves = _turned(habit.leaf, twig, tangent, side, np.concatenate(limbs), rng)
    lowest = np.minimum(leaves.base[:, 2], leaves.base[:, 2] + leaves.midrib[:, 2] * leaves.length)
    rows = np.flatnonzero(lowest - 0.5 * leaves.length * np.abs(leaves.normal[:, :2]).max(1) > habit.clear)
    return Leaves(**{key: value[rows] for key, value in vars(leaves).items()})


def _turned(
    form: Leaf, twig: Array, tangent: Array, side: Array, limb: NDArray[np.intp], rng: np.random.Generator
) -> Leaves:
    """Blades turned to the light."""
    n = len(twig)
    outward = _outward(twig, limb)
    reach = unit(0.5 * tangent + side + rng.normal(0, 0.25, (n, 3)))
    midrib = unit(reach + 0.35 * outward - [0, 0, form.droop] + rng.normal(0, 0.25, (n, 3)))
    light = form.flatness * np.array([0, 0, 1.0]) + outward + rng.normal(0, 0.45, (n, 3))
    normal = unit(light - (light * midrib).sum(1, keepdims=True) * midrib)
    length = form.length * np.exp(rng.normal(0, form.size_spread, n).clip(-0.5, 0.4))
    return Leaves(
        twig=twig, base=twig + form.stalk * reach, midrib=midrib, normal=normal, length=length, outward=outward
    )


def _outward(points: Array, limb: NDArray[np.intp]) -> Array:
    """Unit vectors away from the crown's middle (an ellipsoid's normal) and from that of each limb's leaves, halved."""
    middle = points.mean(0)
    spread = points.std(0) + 1e-9
    crown = unit((points - middle) / spread**2)
    count = np.maximum(np.bincount(limb), 1)
    centre = np.stack([np.bincount(limb, points[:, k]) / count for k in range(3)], 1)
    clump = unit(points - centre[limb])
    return unit(crown + clump)


def leaf_mesh(leaves: Leaves, form: Leaf) -> tuple[Array, Array, Array, NDArray[np.int32]]:
    """Vertices (4 m, 3) [m], normals, uv and faces (2 m, 3), in the order base, left, tip, right; v is along the midrib."""
    m = len(leaves.length)
    left = np.cross(leaves.normal, leaves.midrib)
    fold = np.radians(form.fold)
    scale = leaves.length[:, None]
    half = 0.5 * form.width / form.length * scale
    waist = leaves.base + form.widest * scale * leaves.midrib + half * np.sin(fold) * leaves.normal
    tip = leaves.base + scale * leaves.midrib
    reach = half * np.cos(fold) * left
    vertices = np.stack([leaves.base, waist + reach, tip, waist - reach], 1)

    tilt = np.sin(fold) * left
    own = np.stack([leaves.normal, leaves.normal - tilt, leaves.normal, leaves.normal + tilt], 1)
    outward = leaves.outward[:, None]
    facing = np.where((own * outward).sum(2, keepdims=True) < -0.3, 0.0, OUTWARD_BLEND)
    normals = unit((1 - facing) * unit(own) + facing * outward)
    uv = np.broadcast_to([[0.5, 0.03], [0.04, form.widest], [0.5, 0.97], [0.96, form.widest]], (m, 4, 2))
    faces = 4 * np.arange(m)[:, None, None] + np.array([[0, 2, 1], [0, 3, 2]])
    return vertices.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2), faces.reshape(-1, 3).astype(np.int32)
