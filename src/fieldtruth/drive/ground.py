# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Terrain below the robot: slope, mean height, and bumps between the wheels that would touch the chassis."""

import dataclasses
from collections.abc import Callable
from typing import Final

import numpy as np
from scipy.ndimage import maximum_filter, uniform_filter

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.world.model import Heightfield

_HEADINGS: Final = 8
_CHASSIS_POINTS: Final = [(x, y) for x in (-0.5, -0.25, 0.0, 0.25, 0.5) for y in (-0.35, 0.0, 0.35)]
"""In lengths and widths of the chassis."""
_AROUND: Final = 0.1
"""Half the distance [m] between the points of the chassis, less half a node of the bearing ground."""

Ground = Callable[[Array, Array], Array]
"""Heights [m] at offsets x, y [m] from the middle of the robot, in the world frame."""


def bump_height(below_wheels: Ground, below_chassis: Ground, heading: Array, robot: RobotConfig) -> Array:
    """Height [m] of the ground below the chassis above the plane through the ground below the wheels.

    ``heading`` [rad].
    """
    cos, sin = np.cos(heading), np.sin(heading)

    def at(ground: Ground, x: float, y: float) -> Array:
        return ground(cos * x - sin * y, sin * x + cos * y)

    corners, length, width = robot.corners, robot.outline[0], robot.chassis_width
    front, rear = corners[0][0], corners[3][0]
    front_left, front_right, rear_left, rear_right = (at(below_wheels, x, y) for x, y in corners)
    middle = (front_left + front_right + rear_left + rear_right) / 4  # at x of the middle between the axles
    along = (front_left + front_right - rear_left - rear_right) / (2 * (front - rear))
    across = (front_left - front_right + rear_left - rear_right) / sum(abs(y) for _, y in corners)
    bump = at(below_chassis, 0.0, 0.0) - (middle - along * ((front + rear) / 2))
    for x, y in ((share_x * length, share_y * width) for share_x, share_y in _CHASSIS_POINTS):
        plane = middle + along * (x - (front + rear) / 2) + across * y
        bump = np.maximum(bump, at(below_chassis, x, y) - plane)
    return bump


def bump_height_on_path(bearing: Heightfield, highest: Heightfield, poses: Array, robot: RobotConfig) -> Array:
    """Bump height [m], (n,), at poses (n, 3) of x, y [m] and heading [rad]; see ``highest_around``."""
    x, y, heading = poses.T

    def of(field: Heightfield) -> Ground:
        return lambda dx, dy: field.height_at(x + dx, y + dy)

    return bump_height(of(bearing), of(highest), heading, robot)


def max_bump_height(bearing: Heightfield, highest: Heightfield, x: Array, y: Array, robot: RobotConfig) -> Array:
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
    return np.asarray(np.max([bump_height(of(bearing), of(highest), heading, robot) for heading in headings], axis=0))


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
