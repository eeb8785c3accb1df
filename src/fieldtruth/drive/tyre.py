# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tyres on the ground: one contact per wheel, with the plane that presses the tyre as the uneven ground does.

Ground. The cubic B-spline through the nodes of a heightfield: height, slope and curvature have no jumps, while the
triangles between the same nodes, which the sensors see, have an edge every cell. A control value lies beyond the
heights of the nodes around it by no more than a bump as curved as the wheel needs, so the spline does not swing beside
a step: there it rounds the edge by up to a cell instead of passing through the nodes.

Tyre. A pneumatic tyre envelops what is smaller than its contact patch. Here each tyre is a bed of springs: at points of
the unloaded tread, every 2 deg along and five across, the depth below the ground at right angles to it is a pressure
along the ground's normal. Their sum is the force of the bed. The equivalent ground plane (Davis 1975, A radial-spring
terrain-enveloping tire model, Vehicle System Dynamics 4, 55-69) has the direction of that force and lies as deep in the
tyre as a plane that makes the same force; on a plane it is that plane, whatever the number of points. The patch moves
over an edge bit by bit, so the plane has no jumps, and a wheel that loses the ground has no contact.

Stiffness. A thin tyre of radius R and section radius s that is pressed in by d has a contact area of about
2 pi sqrt(R s) d (two crossing circles), so at a pressure p its stiffness is 2 pi p sqrt(R s) (Hadekel 1952, The
mechanical characteristics of pneumatic tyres, quoted from memory). A Husky's tyre is 13 x 5.00-6: R = 0.165 m,
s = 0.064 m; at 90 kPa (13 psi, as mowers on tyres of this size have it) 58 kN/m. The carcass with its lugs is assumed
to add a fifth. Under 123 N it yields by 1.8 mm, in a patch of 5 cm. The radius of the rig's wheels is the loaded one.
Damping: a tenth of the critical one; free vibrations of tractor tyres decay with 0.05 to 0.15 (quoted from memory). So
the robot, which has no other springs, heaves at 12 Hz.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter, spline_filter

from fieldtruth.core.arrays import Array
from fieldtruth.drive.vectors import Axes, Vector, axes_of, cross, dot, plus, turned
from fieldtruth.kernels.compile import kernel
from fieldtruth.world.model import Heightfield

DAMPING_RATIO: Final = 0.1

_MARGIN: Final = 3  # nodes added around the heightfield, with the heights of its edge
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


class Tread(NamedTuple):
    """Loaded radius, half width and deflection under the load at rest, each [m]."""

    radius: float
    half_width: float
    deflection: float


class Patches(NamedTuple):
    """What ``press`` writes for each of n wheels, in the world frame.

    ``position`` (n, 3) [m] and ``quaternion_wxyz`` (n, 4) of the equivalent plane, its z axis upwards; ``forward``
    (n, 3), unit vector along it in the wheel's plane; ``velocity`` (n, 2) [m/s] of the chassis at the contact, forwards
    and to the left; ``rolling`` (n,) [m/s], wheel speed times radius.
    """

    position: Array
    quaternion_wxyz: Array
    forward: Array
    velocity: Array
    rolling: Array


def smooth_ground(field: Heightfield, tread: Tread) -> SmoothGround:
    """Return the spline through the nodes of ``field``; the radius of ``tread`` bounds its overshoot."""
    heights = np.pad(field.heights.astype(np.float64), _MARGIN, mode="edge")
    beyond = field.spacing**2 / (6 * tread.radius)
    lowest, highest = minimum_filter(heights, 3) - beyond, maximum_filter(heights, 3) + beyond
    control = np.clip(spline_filter(heights, order=3, mode="mirror"), lowest, highest)
    # Cell (i, j) is shaped by the control values i - 1 to i + 2. Rounded up to single precision.
    ceiling = np.nextafter(maximum_filter(control, 4, origin=-1, mode="nearest").astype(np.float32), np.float32(np.inf))
    around = maximum_filter(ceiling, 2 * math.ceil(tread.half_width / field.spacing) + 1, mode="nearest")
    shift = _MARGIN * field.spacing
    return SmoothGround(control, ceiling, around, field.x0 - shift, field.y0 - shift, 1 / field.spacing)


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
        patches.position[k] = plus(point, depth - deflection, normal)
        c = math.sqrt((1 + normal[2]) * 2)  # the shortest turn that brings z onto the normal
        patches.quaternion_wxyz[k] = (c / 2, -normal[1] / c, normal[0] / c, 0.0)
        forward = cross(axle, normal)
        length = math.sqrt(dot(forward, forward))
        forward = (forward[0] / length, forward[1] / length, forward[2] / length)
        lever = plus(point, -1.0, origin)
        velocity = plus((qvel[0], qvel[1], qvel[2]), 1.0, cross(spin, lever))
        patches.forward[k] = forward
        patches.velocity[k] = (dot(velocity, forward), dot(velocity, cross(normal, forward)))
        patches.rolling[k] = r * qvel[6 + k] if 6 + k < len(qvel) else 0.0
