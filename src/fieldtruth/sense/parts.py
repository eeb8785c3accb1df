# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Meshes in two parts, such as trunk and crown, whose boxes enclose less air than one box of both.

A ray that enters the box of an instance is transformed into its frame and starts at the top of its hierarchy. Below a
canopy it would do so at every tree whose crown is above it.
"""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.world.model import Mesh

_GAIN: Final = 0.85
"""Share of the area of the whole mesh's box below which the boxes of two parts are worth a second instance."""


def parts_of(mesh: Mesh) -> list[Mask]:
    """Which faces (f,) belong to each part: all to one, or those below and those above the best height to two.

    The chance that a ray hits a box is proportional to the box's area; the best height is where the sum is least.
    """
    corners = mesh.vertices[mesh.faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    order = np.argsort(low[:, 2] + high[:, 2], kind="stable")
    low, high = low[order], high[order]
    below = _area(np.maximum.accumulate(high) - np.minimum.accumulate(low))
    above = _area(np.maximum.accumulate(high[::-1]) - np.minimum.accumulate(low[::-1]))[::-1]
    if len(order) < 2 or (below[:-1] + above[1:]).min() > _GAIN * below[-1]:
        return [np.ones(len(order), np.bool_)]
    lower = np.zeros(len(order), np.bool_)
    lower[order[: int(np.argmin(below[:-1] + above[1:])) + 1]] = True
    return [lower, ~lower]


def _area(size: Array) -> Array:
    """Half the area (n,) of boxes of a size (n, 3)."""
    return np.asarray((size * np.roll(size, 1, axis=1)).sum(axis=1))
