# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Terrain below the robot: slope, mean height, and bumps between the wheels that would touch the chassis."""

from collections.abc import Callable
from typing import Final

import numpy as np
from scipy.ndimage import uniform_filter

from fieldtruth.core.arrays import Array
from fieldtruth.drive.husky import CHASSIS_WIDTH, OUTLINE
from fieldtruth.experiment.rig import Rig
from fieldtruth.world.model import Heightfield

CHASSIS_CLEARANCE: Final = -Rig().base_footprint.xyz[2]
"""Height [m] of the chassis above the plane through the wheels' contact points."""
_HEADINGS: Final = 8
_MAX_NODES: Final = 200_000
_WHEELS: Final = Rig().wheels
_CHASSIS_POINTS: Final = [
    (x * OUTLINE[0], y * CHASSIS_WIDTH) for x in (-0.5, -0.25, 0.0, 0.25, 0.5) for y in (-0.35, 0.0, 0.35)
]


def bump_height(ground: Callable[[Array, Array], Array], heading: Array) -> Array:
    """Height [m] of the ground below the chassis above the plane through the ground below the wheels.

    ``ground`` returns the heights at offsets x, y [m] in the world frame; ``heading`` [rad].
    """
    cos, sin = np.cos(heading), np.sin(heading)

    def below(x: float, y: float) -> Array:
        return ground(cos * x - sin * y, sin * x + cos * y)

    a, b = _WHEELS.half_wheelbase, _WHEELS.half_track
    front_left, front_right, rear_left, rear_right = below(a, b), below(a, -b), below(-a, b), below(-a, -b)
    middle = (front_left + front_right + rear_left + rear_right) / 4
    along = (front_left + front_right - rear_left - rear_right) / (4 * a)
    across = (front_left - front_right + rear_left - rear_right) / (4 * b)
    bump = below(0.0, 0.0) - middle
    for x, y in _CHASSIS_POINTS:
        bump = np.maximum(bump, below(x, y) - (middle + along * x + across * y))
    return bump


def bump_height_on_path(field: Heightfield, poses: Array) -> Array:
    """Bump height [m], (n,), at poses (n, 3) of x, y [m] and heading [rad]."""
    x, y, heading = poses.T
    return bump_height(lambda dx, dy: field.height_at(x + dx, y + dy), heading)


def max_bump_height(field: Heightfield) -> Array:
    """Greatest bump height [m] over all headings at each node (nx, ny); large fields are sampled every 2 nodes."""
    stride = 1 if field.heights.size <= _MAX_NODES else 2
    heights = field.heights[::stride, ::stride]
    nx, ny = heights.shape
    spacing = field.spacing * stride
    pad = 2 + int(OUTLINE[0] / spacing)
    padded = np.pad(heights, pad, mode="edge")

    def shifted(dx: Array, dy: Array) -> Array:
        (i, u), (j, v) = (divmod(float(d) / spacing, 1.0) for d in (dx, dy))
        rows, columns = slice(pad + int(i), pad + int(i) + nx + 1), slice(pad + int(j), pad + int(j) + ny + 1)
        part = padded[rows, columns]
        part = part[:-1] * np.float32(1 - u) + part[1:] * np.float32(u)
        return np.asarray(part[:, :-1] * np.float32(1 - v) + part[:, 1:] * np.float32(v))

    headings = np.arange(_HEADINGS) * np.pi / _HEADINGS
    bump = np.max([bump_height(shifted, heading) for heading in headings], axis=0)
    return np.asarray(
        bump.repeat(stride, axis=0).repeat(stride, axis=1)[: field.heights.shape[0], : field.heights.shape[1]]
    )


def slopes(field: Heightfield, length: float) -> tuple[Array, Array]:
    """Rise per metre along x and y, (nx, ny) each, of the mean ground over a square of about ``length`` [m]."""
    along_x, along_y = np.gradient(mean_ground(field, length), field.spacing)
    return np.asarray(along_x), np.asarray(along_y)


def mean_ground(field: Heightfield, length: float) -> Array:
    """Mean height [m], (nx, ny), of the ground over a square of about ``length`` [m]."""
    nodes = 2 * max(1, round(length / 2 / field.spacing)) + 1
    return np.asarray(uniform_filter(field.heights.astype(np.float64), nodes, mode="nearest"))
