# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Fallen branches and twigs on a forest's floor, as several to a mesh."""

from dataclasses import replace
from typing import Final

import numpy as np

from fieldtruth.world.model import Mesh
from fieldtruth.world.plants.growth import Stems, extend, sideways, taper
from fieldtruth.world.plants.meshing import merged, tubes
from fieldtruth.world.plants.species import Order

FLAT: Final = np.array([1.0, 1.0, 0.3])
"""Shape of branches that lie, relative to those that grow."""
_BRANCH = Order(number=1, length=1, angle=(0, 0), lift=(0.05, -0.15), wander=0.7, bend=0.4, segments=4)
_TWIG = Order(number=1, length=1, angle=(0, 0), lift=(-0.1, -0.3), wander=0.5, bend=0.3, segments=2)


def grow_twigs(*, name: str, radius: float, count: int, rng: np.random.Generator) -> Mesh:
    """``count`` dry branches of 0.2 to 1.3 m that lie in a disc of ``radius`` [m], each with a few twigs.

    They are 0.6 to 2.6 cm thick and rise at most a hand's breadth above the ground z = 0. No colliders; the footprint
    [m] is the radius.
    """
    out, turn = radius * np.sqrt(rng.random(count)), rng.uniform(0, 2 * np.pi, count)
    heading, rise = rng.uniform(0, 2 * np.pi, count), np.radians(rng.uniform(-1, 7, count))
    length = np.exp(rng.uniform(np.log(0.2), np.log(1.3), count))
    ahead = np.stack([np.cos(rise) * np.cos(heading), np.cos(rise) * np.sin(heading), np.sin(rise)], axis=1)
    middle = np.stack([out * np.cos(turn), out * np.sin(turn), np.full(count, 0.012)], axis=1)
    foot = middle - 0.5 * length[:, None] * ahead * [1, 1, 0]
    branches = Stems(
        axis=extend(foot, ahead, length, _BRANCH, rng),
        radius=taper(0.01 * np.clip(length, 0.3, 1.3) * rng.uniform(0.6, 1.0, count), _BRANCH),
        length=length,
        parent=np.full(count, -1, np.intp),
        joint=np.zeros(count),
        limb=np.arange(count, dtype=np.intp),
    )
    parent = np.repeat(np.arange(count, dtype=np.intp), 3)
    joint = rng.uniform(0.3, 0.95, len(parent))
    position, tangent, thickness = branches.at(parent, joint)
    side = sideways(tangent, parent, np.arange(len(parent), dtype=np.intp) % 3, 180.0, 25.0, rng)
    own = length[parent] * (1.1 - joint) * rng.uniform(0.3, 0.7, len(parent))
    twigs = Stems(
        axis=extend(position, 0.7 * tangent + 0.7 * side, own, _TWIG, rng),
        radius=taper(0.6 * thickness, _TWIG),
        length=own,
        parent=parent,
        joint=joint,
        limb=parent,
    )
    surfaces = [tubes(replace(stems, axis=stems.axis * FLAT), sides) for stems, sides in ((branches, 4), (twigs, 3))]
    rows = np.zeros(sum(len(faces) for *_, faces in surfaces), np.int32)
    return merged(name, surfaces, rows, ["bark_dead"], footprint=radius)
