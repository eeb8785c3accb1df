# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Force of stems that the edges of a robot's hull push over, in a step of the physics.

Columns of ``stems`` are those of ``world.stems.StemRows``; those of ``table`` are ``drive.stems.elastica``. A stem is
pushed by the lower edge of the front or of the rear, whichever it is nearer to.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.kernels.compile import inlined, kernel

X, Y, Z, COUNT, RIGIDITY, BREAKS, HEIGHT, RECOVERS, SECONDS = range(9)
"""Columns of stems."""
AHEAD, UP, LENGTH, MOMENT, ENERGY = range(5)
"""Columns of the table."""
NEVER: Final = -np.inf
KINKED: Final = 1e300
BROKEN: Final = np.inf
"""Times at which a stem was pressed down: of one that has not been; of one that has a kink at its foot, and lies.

What happened to a stem last has the greatest, so that of several robots the greatest time counts.
"""
RESIDUAL: Final = 0.4
"""Share of the breaking moment that a kink keeps while it turns (assumed; thin tubes keep a third to a half)."""
_LOWEST: Final = 0.04
"""Height [m] of an edge above a stem's foot at least: on rough ground it may be below."""


class Edges(NamedTuple):
    """The hull in base_link: x of front and rear, half the width, z of the underside [m]."""

    front: float
    rear: float
    half_width: float
    low: float


class Cells(NamedTuple):
    """Stems by squares: the first row of square i * ny + j and one more, and x0, y0, squares per metre, nx, ny."""

    first: NDArray[np.int64]
    grid: tuple[float, float, float, int, int]


@kernel
def standing(pressed: float, time: float, recovers: float, seconds: float) -> float:
    """Share of its resistance that a stem has again at a time [s], which was pressed down at another."""
    if pressed == NEVER:
        return 1.0
    if pressed >= KINKED:
        return 0.0
    return recovers * -math.expm1(-(time - pressed) / seconds)


@kernel
def look_up(table: Array, per_unit: float, u: float, column: int) -> float:
    """Value of a column at u, linear between the rows."""
    at = u * per_unit
    row = min(int(at), len(table) - 2)
    share = at - row
    return float(table[row, column] * (1.0 - share) + table[row + 1, column] * share)


@kernel
def push_stem(stem: Array, table: Array, most: float, edge: tuple[float, float], share: float, out: Array) -> float:
    """Set ``out`` to the force [N] against the push and up; return 1 of a stem in contact, 2 pressed down, 3 kinked.

    ``edge`` is its travel behind the stem's foot and its height above it [m]; ``share`` is that of ``standing``, below
    0 of a stem with a kink: the force of a moment that does not change.
    """
    travel, height = edge
    out[0], out[1] = 0.0, 0.0
    u, per_unit = travel / height, (len(table) - 1) / most
    if share < 0.0 and u < most and math.hypot(u, 1.0) * height < stem[HEIGHT]:
        moment = RESIDUAL * stem[COUNT] * stem[BREAKS] / (height * (1.0 + u * u))
        out[0], out[1] = moment, moment * u
        return 3.0
    if share < 0.0 or u >= most or look_up(table, per_unit, u, LENGTH) * height >= stem[HEIGHT]:
        return 2.0
    stiffness = stem[RIGIDITY] / (height * height)
    if share == 1.0 and look_up(table, per_unit, u, MOMENT) * stiffness * height >= stem[BREAKS]:
        return 3.0
    factor = share * stem[COUNT] * stiffness
    out[0] = factor * look_up(table, per_unit, u, AHEAD)
    out[1] = factor * look_up(table, per_unit, u, UP)
    return 1.0


@inlined
def _squares(at: float, radius: float, origin: float, per_metre: float, count: int) -> tuple[int, int]:
    """First and last square of a grid of ``count`` along an axis that are within a radius [m] of a position."""
    first, last = math.floor((at - radius - origin) * per_metre), math.floor((at + radius - origin) * per_metre)
    return max(first, 0), min(last, count - 1)


@kernel(allocates=True)
def push_stems(
    stems: Array,
    cells: Cells,
    table: tuple[Array, float],
    edges: Edges,
    state: tuple[Array, Array, float],
    pressed: Array,
    force: Array,
) -> None:
    """Set the generalized force (6,) on base_link, [N] in the world and [N m] in base_link, and what is pressed down.

    ``state`` is position and quaternion_wxyz of base_link, its rotation (3, 3), and the time [s]; ``pressed`` (n,) are
    the times at which stems were pressed down.
    """
    qpos, rotation, time = state
    x0, y0, per_metre, nx, ny = cells.grid
    fx, fz, mx, my, mz = 0.0, 0.0, 0.0, 0.0, 0.0
    out, b = np.empty(2), np.empty(3)
    radius = math.hypot(max(edges.front, -edges.rear), edges.half_width) + 0.1
    i0, i1 = _squares(qpos[0], radius, x0, per_metre, nx)
    j0, j1 = _squares(qpos[1], radius, y0, per_metre, ny)
    if i1 < i0 or j1 < j0:  # beyond the world's edge
        force[:] = 0.0
        return
    middle = 0.5 * (edges.front + edges.rear)
    for i in range(i0, i1 + 1):
        for k in range(cells.first[i * ny + j0], cells.first[i * ny + j1 + 1]):
            dx, dy, dz = stems[k, X] - qpos[0], stems[k, Y] - qpos[1], stems[k, Z] - qpos[2]
            for axis in range(3):
                b[axis] = rotation[0, axis] * dx + rotation[1, axis] * dy + rotation[2, axis] * dz
            if abs(b[1]) > edges.half_width or b[0] > edges.front or b[0] < edges.rear or pressed[k] == BROKEN:
                continue
            sign = 1.0 if b[0] > middle else -1.0
            x = edges.front if sign > 0 else edges.rear
            kinked = pressed[k] == KINKED
            share = -1.0 if kinked else standing(pressed[k], time, stems[k, RECOVERS], stems[k, SECONDS])
            edge = (sign * (x - b[0]), max(edges.low - b[2], _LOWEST))
            found = push_stem(stems[k], table[0], table[1], edge, share, out)
            if found == 2.0:
                pressed[k] = BROKEN if kinked else time
            elif found == 3.0:
                pressed[k] = KINKED
            ahead = -sign * out[0]
            fx += ahead
            fz += out[1]
            mx += b[1] * out[1]
            my += edges.low * ahead - x * out[1]
            mz -= b[1] * ahead
    for axis in range(3):
        force[axis] = rotation[axis, 0] * fx + rotation[axis, 2] * fz
    force[3], force[4], force[5] = mx, my, mz
