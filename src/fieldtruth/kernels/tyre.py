# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Wheels on the ground: vectors, the plane that presses a tyre as the ground does, and the hull's clearance.

``drive.surroundings`` says how the plane is found.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import kernel

Vector = tuple[float, float, float]
Axes = tuple[Vector, Vector, Vector]
"""Columns of a rotation matrix: the axes of a frame, seen from another one."""


@kernel
def axes_of(w: float, x: float, y: float, z: float) -> Axes:
    """Return the columns of the rotation matrix of a unit quaternion."""
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )


@kernel
def turned(axes: Axes, v: Vector) -> Vector:
    """Return the rotation of ``axes`` times ``v``."""
    along_x = (axes[0][0] * v[0], axes[0][1] * v[0], axes[0][2] * v[0])
    return plus(plus(along_x, v[1], axes[1]), v[2], axes[2])


@kernel
def plus(a: Vector, share: float, b: Vector) -> Vector:
    """Return a + share * b."""
    return a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2]


@kernel
def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


_CLEAR: Final = 0.1  # [m] from a tyre in the air to its plane
_STEP: Final = math.radians(2.0)
_ROWS: Final = np.arange(-36, 37) * _STEP  # angles of the tread's points, from straight down
_SINES, _COSINES = np.sin(_ROWS), np.cos(_ROWS)
# Gauss-Legendre across the tread: points in half widths, shares of the width. Three would be too few where bumps are
# higher than the tyre's deflection: 15 % more acceleration than with nine; five have 3 % or less.
_ACROSS, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_SHARE: Final = _WEIGHTS / 2
Weights = tuple[float, float, float, float]


class SmoothGround(NamedTuple):
    """The spline: its control value (i, j) belongs to x0 + i / per_metre, y0 + j / per_metre.

    ``ceiling`` [m] is the greatest of the control values that shape cell (i, j): the surface there is never higher;
    ``around`` is the same for all cells that a row of the tread can cross whose middle is in cell (i, j).
    """

    control: Array  # (nx, ny) [m]
    ceiling: NDArray[np.float32]
    around: NDArray[np.float32]
    x0: float
    y0: float
    per_metre: float  # nodes


class Patches(NamedTuple):
    """Contact patches of n wheels in the world frame, as ``press`` writes them.

    ``position`` (n, 3) [m] and ``quaternion_wxyz`` (n, 4) of the equivalent plane, its z axis upwards; ``forward``
    (n, 3), unit vector along it in the wheel's plane; ``velocity`` (n, 2) [m/s] of the chassis at the contact, forwards
    and to the left; ``rolling`` (n,) [m/s], wheel speed times radius.
    """

    position: Array
    quaternion_wxyz: Array
    forward: Array
    velocity: Array
    rolling: Array


@kernel
def surface_height(ground: SmoothGround, i: int, j: int, u: float, v: float) -> float:
    """Height [m] at the point u, v (0 to 1) of cell (i, j)."""
    return _sum(ground, i, j, _weights(u), _weights(v))


@kernel
def surface_slopes(ground: SmoothGround, i: int, j: int, u: float, v: float) -> tuple[float, float]:
    """Slopes along x and y at the point u, v (0 to 1) of cell (i, j)."""
    along_x = _sum(ground, i, j, _slopes(u), _weights(v))
    along_y = _sum(ground, i, j, _weights(u), _slopes(v))
    return along_x * ground.per_metre, along_y * ground.per_metre


@kernel
def _sum(ground: SmoothGround, i: int, j: int, wx: Weights, wy: Weights) -> float:
    """Weighted sum of the control values that shape cell (i, j)."""
    first, column = np.uint64(i - 1), np.uint64(j - 1)  # an index with a sign could count from the end: a test each
    total = 0.0
    for m in range(4):
        c = ground.control[first + np.uint64(m)]
        total += wx[m] * (
            wy[0] * c[column]
            + wy[1] * c[column + np.uint64(1)]
            + wy[2] * c[column + np.uint64(2)]
            + wy[3] * c[column + np.uint64(3)]
        )
    return total


@kernel
def _weights(u: float) -> Weights:
    """Of the four control values around u (0 to 1) in a cubic B-spline."""
    a = 1.0 - u
    return a * a * a / 6, (0.5 * u - 1.0) * u * u + 2 / 3, (0.5 * a - 1.0) * a * a + 2 / 3, u * u * u / 6


@kernel
def _slopes(u: float) -> Weights:
    """Derivatives of ``_weights``."""
    a = 1.0 - u
    return -0.5 * a * a, (1.5 * u - 2.0) * u, (2.0 - 1.5 * a) * a, 0.5 * u * u


@kernel
def _pressure(ground: SmoothGround, hub: Vector, axes: Axes, r: float, w: float) -> Vector:
    """Sum over a tread of radius ``r`` and half width ``w`` [m] of depth times normal [m^2 per width].

    ``axes`` are those of the wheel's frame in the world, x forwards and y along the axle.
    """
    ahead, axle, up = axes
    nx, ny = ground.control.shape
    px, py, pz = 0.0, 0.0, 0.0
    drop = w * abs(axle[2])
    for n in range(len(_SINES)):
        row = plus(plus(hub, r * _SINES[n], ahead), -r * _COSINES[n], up)
        i = int(min(max((row[0] - ground.x0) * ground.per_metre, 1.0), nx - 2.001))
        j = int(min(max((row[1] - ground.y0) * ground.per_metre, 1.0), ny - 2.001))
        if ground.around[i, j] <= row[2] - drop:
            continue
        for m in range(len(_SHARE)):
            x, y, z = plus(row, w * _ACROSS[m], axle)
            u = min(max((x - ground.x0) * ground.per_metre, 1.0), nx - 2.001)
            v = min(max((y - ground.y0) * ground.per_metre, 1.0), ny - 2.001)
            i, j = int(u), int(v)
            if ground.ceiling[i, j] > z:
                h = surface_height(ground, i, j, u - i, v - j)
                if h > z:
                    hx, hy = surface_slopes(ground, i, j, u - i, v - j)
                    # Depth at right angles to the ground, times its normal: both have the factor 1 / sqrt(1 + slope^2).
                    share = _SHARE[m] * _STEP * r * (h - z) / (1.0 + hx * hx + hy * hy)
                    px, py, pz = px - hx * share, py - hy * share, pz + share
    return px, py, pz


@kernel
def press(
    ground: SmoothGround, treads: Array, mounts: Array, qpos: Array, qvel: Array, sinkage: Array, patches: Patches
) -> None:
    """Lay the equivalent plane below each wheel; ``mounts`` (n, 3) are the hubs in base_link, ``sinkage`` (n,) [m].

    ``treads`` (n, 3) are rows of ``Tread``; the last wheels may be casters, whose speed is not measured.
    A plane under a wheel without ground is out of its reach. A state that is not finite leaves the planes as they are:
    the physics keeps it, and the drive ends.
    """
    if not math.isfinite(qpos.sum()):
        return
    axes = axes_of(qpos[3], qpos[4], qpos[5], qpos[6])
    axle = axes[1]
    spin, origin = turned(axes, (qvel[3], qvel[4], qvel[5])), (qpos[0], qpos[1], qpos[2])
    for k in range(len(mounts)):
        r, w, deflection = treads[k, 0], treads[k, 1], treads[k, 2]
        hub = plus(origin, 1.0, turned(axes, (mounts[k, 0], mounts[k, 1], mounts[k, 2])))
        raised = (hub[0], hub[1], hub[2] + sinkage[k])  # above ground that is lowered
        force = _pressure(ground, raised, axes, r + deflection, w)
        size = math.sqrt(dot(force, force))
        normal = (force[0] / size, force[1] / size, force[2] / size) if size > 0.0 else (0.0, 0.0, 1.0)
        # A plane at depth d presses in the parabola d - x^2 / (2 r): its sum is 4 / 3 d sqrt(2 r d).
        depth = (0.75 * size / math.sqrt(2 * (r + deflection))) ** (2.0 / 3.0) if size > 0.0 else -_CLEAR
        tilt = dot(axle, normal)
        squash = (w * w - r * r) * tilt
        reach = -1.0 / math.sqrt(r * r + squash * tilt)
        point = plus(plus(hub, reach * r * r, normal), reach * squash, axle)  # lowest of the ellipsoid
        place, turn = patches.position, patches.quaternion_wxyz
        place[k, 0], place[k, 1], place[k, 2] = plus(point, depth - deflection, normal)
        c = math.sqrt((1 + normal[2]) * 2)  # the shortest turn that brings z onto the normal
        turn[k, 0], turn[k, 1], turn[k, 2], turn[k, 3] = c / 2, -normal[1] / c, normal[0] / c, 0.0
        forward = cross(axle, normal)
        length = math.sqrt(dot(forward, forward))
        forward = (forward[0] / length, forward[1] / length, forward[2] / length)
        lever = plus(point, -1.0, origin)
        velocity = plus((qvel[0], qvel[1], qvel[2]), 1.0, cross(spin, lever))
        patches.forward[k, 0], patches.forward[k, 1], patches.forward[k, 2] = forward
        patches.velocity[k, 0], patches.velocity[k, 1] = dot(velocity, forward), dot(velocity, cross(normal, forward))
        patches.rolling[k] = r * qvel[6 + k] if 6 + k < len(qvel) else 0.0


@kernel
def clearance(highest: Float32Array, x0: float, y0: float, spacing: float, points: Array, qpos: Array) -> float:
    """Least height [m] of ``points`` (n, 3) of base_link above the nearest nodes of ``highest``."""
    nx, ny = highest.shape
    axes = axes_of(qpos[3], qpos[4], qpos[5], qpos[6])
    least = np.inf
    for k in range(len(points)):
        point = (points[k, 0], points[k, 1], points[k, 2])
        x, y, z = plus((qpos[0], qpos[1], qpos[2]), 1.0, turned(axes, point))
        i = min(max(round((x - x0) / spacing), 0), nx - 1)
        j = min(max(round((y - y0) / spacing), 0), ny - 1)
        least = min(least, z - highest[i, j])
    return least
