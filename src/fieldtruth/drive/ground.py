# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Terrain below the robot: slope, mean height, and bumps between the wheels that would touch the chassis."""

import dataclasses
from collections.abc import Callable
from typing import Final

import numpy as np
from scipy.ndimage import maximum_filter, uniform_filter

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.drive.husky import CHASSIS_WIDTH, OUTLINE
from fieldtruth.experiment.rig import Rig
from fieldtruth.world.model import Heightfield

CHASSIS_CLEARANCE: Final = -Rig().base_footprint.xyz[2]
"""Height [m] of the chassis above the plane through the wheels' contact points."""
_HEADINGS: Final = 8
_WHEELS: Final = Rig().wheels
_CHASSIS_POINTS: Final = [
    (x * OUTLINE[0], y * CHASSIS_WIDTH) for x in (-0.5, -0.25, 0.0, 0.25, 0.5) for y in (-0.35, 0.0, 0.35)
]
_AROUND: Final = 0.1
"""Half the distance [m] between the points of the chassis, less half a node of the bearing ground."""

Ground = Callable[[Array, Array], Array]
"""Heights [m] at offsets x, y [m] from the middle of the robot, in the world frame."""


def bump_height(below_wheels: Ground, below_chassis: Ground, heading: Array) -> Array:
    """Height [m] of the ground below the chassis above the plane through the ground below the wheels.

    ``heading`` [rad].
    """
    cos, sin = np.cos(heading), np.sin(heading)

    def at(ground: Ground, x: float, y: float) -> Array:
        return ground(cos * x - sin * y, sin * x + cos * y)

    a, b = _WHEELS.half_wheelbase, _WHEELS.half_track
    corners = [at(below_wheels, x, y) for x in (a, -a) for y in (b, -b)]
    front_left, front_right, rear_left, rear_right = corners
    middle = (front_left + front_right + rear_left + rear_right) / 4
    along = (front_left + front_right - rear_left - rear_right) / (4 * a)
    across = (front_left - front_right + rear_left - rear_right) / (4 * b)
    bump = at(below_chassis, 0.0, 0.0) - middle
    for x, y in _CHASSIS_POINTS:
        bump = np.maximum(bump, at(below_chassis, x, y) - (middle + along * x + across * y))
    return bump


def bump_height_on_path(bearing: Heightfield, highest: Heightfield, poses: Array) -> Array:
    """Bump height [m], (n,), at poses (n, 3) of x, y [m] and heading [rad]; see ``highest_around``."""
    x, y, heading = poses.T

    def of(field: Heightfield) -> Ground:
        return lambda dx, dy: field.height_at(x + dx, y + dy)

    return bump_height(of(bearing), of(highest), heading)


def max_bump_height(bearing: Heightfield, highest: Heightfield, x: Array, y: Array) -> Array:
    """Greatest bump height [m], (nx, ny), over all headings at x (nx,) and y (ny,) [m], from the nearest nodes."""

    def of(field: Heightfield) -> Ground:
        def heights(dx: Array, dy: Array) -> Array:
            rows, columns = (
                np.clip(np.rint((axis + float(shift) - start) / field.spacing).astype(np.intp), 0, count - 1)
                for axis, shift, start, count in zip(
                    (x, y), (dx, dy), (field.x0, field.y0), field.heights.shape, strict=True
                )
            )
            return np.asarray(field.heights[rows][:, columns])

        return heights

    headings = np.arange(_HEADINGS) * np.pi / _HEADINGS
    return np.asarray(np.max([bump_height(of(bearing), of(highest), heading) for heading in headings], axis=0))


def highest_around(soil: Heightfield, raised: Float32Array, step: float) -> Heightfield:
    """The soil with the highest of the stones on it between neighbouring points of the chassis: these miss none.

    Args:
        soil: without stones.
        raised: (nx, ny) [m] by which stones raise it.
        step: height [m] above which a stone is an obstacle of its own and counts no further here.
    """
    nodes = 2 * round(_AROUND / soil.spacing) + 1
    stones = maximum_filter(np.minimum(raised, step), nodes, mode="nearest")
    return dataclasses.replace(soil, heights=(soil.heights + stones).astype(np.float32))


def slopes(field: Heightfield, length: float) -> tuple[Array, Array]:
    """Rise per metre along x and y, (nx, ny) each, of the mean ground over a square of about ``length`` [m]."""
    along_x, along_y = np.gradient(mean_ground(field, length), field.spacing)
    return np.asarray(along_x), np.asarray(along_y)


def mean_ground(field: Heightfield, length: float) -> Array:
    """Mean height [m], (nx, ny), of the ground over a square of about ``length`` [m]."""
    nodes = 2 * max(1, round(length / 2 / field.spacing)) + 1
    return np.asarray(uniform_filter(field.heights.astype(np.float64), nodes, mode="nearest"))
