# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rays that meet the robot: its boxes and cylinders are intersected exactly, in double precision and in base_link.

They are convex, so that a ray is inside one between where it enters and where it leaves: a box is the intersection of
three slabs (Kay and Kajiya 1986), a cylinder that of a slab and an endless cylinder. A part that contains the ray's
origin is not met, so that no sensor sees the inside of what it is built into.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.robot_body import Box, Cylinder
from fieldtruth.kernels.robot import BOX, CYLINDER, FACES, HUB, Surface, meet_parts

PAINT, RUBBER, METAL = range(3)
"""Materials."""


def part_table(parts: Sequence[Box | Cylinder]) -> Array:
    """Rows (p, 7) as kernels take them: kind, centre and half the size along x, y and z [m]."""
    rows = []
    for part in parts:
        half = (part if isinstance(part, Box) else part.box).size / 2
        rows.append([BOX if isinstance(part, Box) else CYLINDER, *part.centre, *half])
    return np.array(rows, np.float64).reshape(-1, 7)


def meet(table: Array, origin: ArrayLike, directions: Array) -> Surface:
    """Trace rays from ``origin`` (3,) along unit ``directions`` (n, 3) in base_link; NaN directions meet nothing."""
    rays = np.ascontiguousarray(directions, np.float64)
    found = Surface(np.empty(len(rays)), np.empty(len(rays), np.int32), np.empty((len(rays), 3)))
    meet_parts(table, np.asarray(origin, np.float64), rays, found)
    return found


def material_of(table: Array, face: NDArray[np.int32]) -> NDArray[np.int32]:
    """Material (n,) of faces that were met."""
    part, own = np.divmod(face, FACES)
    wheel = np.where(own >= HUB, METAL, RUBBER)
    return np.where(table[part, 0] == BOX, PAINT, wheel).astype(np.int32)
