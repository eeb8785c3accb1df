# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Where rays meet the robot, found without the formulas by which its sensors find it.

How far a point is outside a box or a cylinder (the largest excess over its limits) is a convex function along a ray.
Its least value is searched by sections, and then where the ray has come so near before.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.rig import Rig

_GOLDEN: Final = (math.sqrt(5.0) - 1.0) / 2.0
_SECTIONS: Final = 60
_HALVINGS: Final = 45
"""Each divides an interval by 1.618, or by 2: together by 1e12, so that 10 m become 1e-11 m."""
_SKIN: Final = 1e-3  # [m] of air at a part from which it is not seen
_BLUR: Final = 2e-5  # [m] by which single precision may move rays and surfaces

Outside = Callable[[float, float, float], float]
"""Distance [m] of x, y, z in base_link from a part, at least: 0 at its surface, below 0 inside."""


class RobotHit(NamedTuple):
    """Where a ray meets a part of the robot [m]; ``sure`` unless it grazes the part and may pass."""

    range_m: float
    tolerance: float
    sure: bool


def robot_parts(rig: Rig) -> Sequence[Outside]:
    """The parts of a rig's robot that its sensors see."""
    if not rig.visible:
        return ()
    robot, wheels, mounts = rig.robot, rig.robot.wheels, rig.mounts()
    (length, _, _), deck = robot.outline, robot.chassis_top
    parts: list[Outside] = [
        lambda x, y, z: max(abs(x) - length / 2, abs(y) - robot.chassis_width / 2, -z, z - deck),
        *(_round(mounts[f"{name}_wheel"].xyz, wheels.radius, wheels.width) for name in wheels.names),
    ]
    if (caster := robot.caster) is not None:
        parts.append(_round((caster.x, 0.0, caster.radius - robot.ground_clearance), caster.radius, caster.width))
    return parts


def _round(centre: tuple[float, float, float], radius: float, width: float) -> Outside:
    a, b, c = centre
    return lambda x, y, z: max(math.hypot(x - a, z - c) - radius, abs(y - b) - width / 2)


def robot_hits(parts: Sequence[Outside], origin: Array, direction: Array) -> list[RobotHit]:
    """Where a ray from ``origin`` (3,) along the unit vector ``direction`` (3,), both in base_link, meets each part."""
    found = []
    (x, y, z), (dx, dy, dz) = origin.tolist(), direction.tolist()
    for outside in parts:

        def along(t: float, outside: Outside = outside) -> float:
            return outside(x + t * dx, y + t * dy, z + t * dz)

        if along(0.0) <= _SKIN:
            continue
        nearest = _least(along, float(np.linalg.norm(origin)) + 10.0)
        if (closest := along(nearest)) <= _BLUR:
            first, last = _reached(along, nearest, _BLUR), _reached(along, nearest, max(-_BLUR, closest))
            middle = (first + last) / 2
            found.append(RobotHit(middle, (last - first) / 2 + 1e-6 * middle, closest < -_BLUR))
    return found


def _least(along: Callable[[float], float], end: float) -> float:
    """Where a convex function is least between 0 and ``end`` (golden sections)."""
    low, high = 0.0, end
    for _ in range(_SECTIONS):
        left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        if along(left) <= along(right):
            high = right
        else:
            low = left
    return (low + high) / 2


def _reached(along: Callable[[float], float], end: float, level: float) -> float:
    """Where a function that falls from 0 to ``end`` reaches a level."""
    low, high = 0.0, end
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if along(middle) <= level else (middle, high)
    return high
