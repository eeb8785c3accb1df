# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rays that meet the robot: its boxes and cylinders are intersected exactly, in double precision and in base_link.

They are convex, so that a ray is inside one between where it enters and where it leaves: a box is the intersection of
three slabs (Kay and Kajiya 1986), a cylinder that of a slab and an endless cylinder. A part that contains the ray's
origin is not met, so that no sensor sees the inside of what it is built into.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.robot_body import RIM, Box, Cylinder
from fieldtruth.kernels.compile import inlined, kernel

SKIN: Final = 1e-3
"""Depth [m] of the air at a part from which it is not seen: that of a housing that stands on it."""
NO_FACE: Final = -1
FACES: Final = 8
"""Faces that a part may have: face f of part p is number ``FACES * p + f``. See ``material_of``."""
PAINT, RUBBER, METAL = range(3)
"""Materials."""

_BOX, _CYLINDER = 0.0, 1.0
_TREAD, _SIDE, _HUB = 0, 1, 3  # faces of a cylinder; the second and third exist on the right and on the left


class Surface(NamedTuple):
    """What n rays meet: ``range_m`` (n,) [m], infinite for nothing; ``face`` (n,); unit ``normal`` (n, 3)."""

    range_m: Array
    face: NDArray[np.int32]
    normal: Array


def part_table(parts: Sequence[Box | Cylinder]) -> Array:
    """Rows (p, 7) as kernels take them: kind, centre and half the size along x, y and z [m]."""
    rows = []
    for part in parts:
        half = (part if isinstance(part, Box) else part.box).size / 2
        rows.append([_BOX if isinstance(part, Box) else _CYLINDER, *part.centre, *half])
    return np.array(rows, np.float64).reshape(-1, 7)


def meet(table: Array, origin: ArrayLike, directions: Array) -> Surface:
    """Trace rays from ``origin`` (3,) along unit ``directions`` (n, 3) in base_link; NaN directions meet nothing."""
    rays = np.ascontiguousarray(directions, np.float64)
    found = Surface(np.empty(len(rays)), np.empty(len(rays), np.int32), np.empty((len(rays), 3)))
    _meet(table, np.asarray(origin, np.float64), rays, found)
    return found


def material_of(table: Array, face: NDArray[np.int32]) -> NDArray[np.int32]:
    """Material (n,) of faces that were met."""
    part, own = np.divmod(face, FACES)
    wheel = np.where(own >= _HUB, METAL, RUBBER)
    return np.where(table[part, 0] == _BOX, PAINT, wheel).astype(np.int32)


@inlined
def _contains(table: Array, part: int, x: float, y: float, z: float) -> bool:
    """Whether a part with its skin contains a point in the part's frame."""
    a, b, c = table[part, 4] + SKIN, table[part, 5] + SKIN, table[part, 6] + SKIN
    if abs(y) > b:
        return False
    return x * x + z * z <= a * a if table[part, 0] == _CYLINDER else abs(x) <= a and abs(z) <= c  # type: ignore[no-any-return]


@inlined
def _slab(start: float, step: float, half: float) -> tuple[float, float]:
    """Where a ray enters and leaves |x| <= half."""
    if step == 0.0:
        return (-np.inf, np.inf) if abs(start) <= half else (np.inf, -np.inf)
    first, second = (-half - start) / step, (half - start) / step
    return min(first, second), max(first, second)


@inlined
def _round(x: float, z: float, dx: float, dz: float, radius: float) -> tuple[float, float]:
    """Where a ray enters and leaves an endless cylinder about y."""
    a, b, c = dx * dx + dz * dz, x * dx + z * dz, x * x + z * z - radius * radius
    if a == 0.0:
        return (-np.inf, np.inf) if c <= 0.0 else (np.inf, -np.inf)
    square = b * b - a * c
    if square < 0.0:
        return np.inf, -np.inf
    root = np.sqrt(square)
    return (-b - root) / a, (-b + root) / a


@kernel
def enters(
    table: Array, part: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float
) -> tuple[float, int]:
    """Range at which a ray enters a part, infinite if it does not, and the face."""
    x, y, z = ox - table[part, 1], oy - table[part, 2], oz - table[part, 3]
    if _contains(table, part, x, y, z):
        return np.inf, NO_FACE
    side, side_end = _slab(y, dy, table[part, 5])
    if table[part, 0] == _CYLINDER:
        tread, tread_end = _round(x, z, dx, dz, table[part, 4])
        enter, leave = max(side, tread), min(side_end, tread_end)
        if not (0.0 < enter < leave):
            return np.inf, NO_FACE
        if tread >= side:
            return enter, _TREAD
        px, pz, rim = x + enter * dx, z + enter * dz, RIM * table[part, 4]
        return enter, (_HUB if px * px + pz * pz < rim * rim else _SIDE) + (1 if dy < 0.0 else 0)
    ahead, ahead_end = _slab(x, dx, table[part, 4])
    up, up_end = _slab(z, dz, table[part, 6])
    enter, leave = max(side, ahead, up), min(side_end, ahead_end, up_end)
    if not (0.0 < enter < leave):
        return np.inf, NO_FACE
    if enter == ahead:
        return enter, 1 if dx < 0.0 else 0
    if enter == side:
        return enter, 3 if dy < 0.0 else 2
    return enter, 5 if dz < 0.0 else 4


@kernel
def _meet(table: Array, origin: Array, directions: Array, found: Surface) -> None:
    range_m, faces, normal = found
    ox, oy, oz = origin[0], origin[1], origin[2]
    for k in range(len(directions)):
        dx, dy, dz = directions[k, 0], directions[k, 1], directions[k, 2]
        nearest, face = np.inf, NO_FACE
        for part in range(len(table)):
            enter, own = enters(table, part, ox, oy, oz, dx, dy, dz)
            if enter < nearest:
                nearest, face = enter, FACES * part + own
        range_m[k], faces[k] = nearest, face
        normal[k, 0], normal[k, 1], normal[k, 2] = 0.0, 0.0, 0.0
        if face == NO_FACE:
            continue
        part, own = face // FACES, face % FACES
        if table[part, 0] == _BOX:
            normal[k, own // 2] = 1.0 if own % 2 else -1.0
        elif own == _TREAD:
            radius = table[part, 4]
            normal[k, 0] = (ox + nearest * dx - table[part, 1]) / radius
            normal[k, 2] = (oz + nearest * dz - table[part, 3]) / radius
        else:
            normal[k, 1] = 1.0 if dy < 0.0 else -1.0
