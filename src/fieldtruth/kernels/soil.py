# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Traction, rolling resistance and sinkage of a wheel: the law in closed form, and a step of it on mixed ground.

``tyre`` is (width [m], diameter [m], stiffness [N/m]); ``soil`` is a row of ``drive.soil.soil_rows``.

- Sinkage at rest: Bekker's pressure p = (k_c / b + k_phi) z^n below a rigid wheel,
  z = (3 W / ((3 - n) b (k_c / b + k_phi) sqrt(D)))^(2 / (2 n + 1)) (Bekker 1969; Wong, Theory of Ground Vehicles). The
  tyre stays round: soils in which it sinks by more than 1 mm press it by less than its own 100 kPa.
- Slip-sinkage: z (1 + i) / (1 - 0.5 i) at slip i (Lyasko, Journal of Terramechanics 47, 2010).
- Resistance of compaction: b (k_c / b + k_phi) z^(n + 1) / (n + 1). With the formula above it is
  3 / ((3 - n) (n + 1)) W sqrt(z / D), which also holds in a rut that slip deepens: the load stays the same.
- In a rut of the depth z_1, as ``sense.ruts`` knows it, soil yields again only below it (repetitive loading, Wong): the
  wheel is lowered by z_1 at least, and the resistance of compaction is that from z_1 to z: it has 1 - (z_1 / z)^(n + 1)
  of what it has on fresh soil.
- Traction: (A c + W tan phi) (1 - (K / (i l)) (1 - exp(-i l / K))), Wong's integral of Janosi and Hanamoto's law over a
  patch of length l and area A = b l. The slip i may have any direction; the force is opposite to it.
- Length of the patch: the wheel is lowered by its sinkage z and the tyre's deflection d; it touches soil ahead over
  sqrt(D (z + d)) and behind over sqrt(D d).

And stones on the soil: the ground that bears wheels is raised to them, see ``drive.bearing``.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import kernel
from fieldtruth.kernels.ruts import RutTable, rut_depth


class Wheels(NamedTuple):
    """The n wheels before a step, in the order of their names; friction, drag, torque, sinkage are for a soil to set.

    The arrays are views of the simulation, so they can be read and written in compiled code.
    """

    position: Array
    """Point of contact (n, 3) [m] in the world."""
    load: Array
    """Normal force (n,) [N] of the step before; 0 in the air."""
    velocity: Array
    """Of the chassis at the contact (n, 2) [m/s], forwards and to the left along the ground."""
    rolling: Array
    """Wheel speed times radius (n,) [m/s], positive forwards; it exceeds the velocity by the slip."""
    friction: Array
    """Coefficient of friction (n, 2), the same in both columns."""
    drag: Array
    """Force (n,) [N] on the axle along the ground, positive forwards: negative for ground that resists."""
    torque: Array
    """Torque (n,) [N m] on the wheel, positive forwards: negative resistance for a wheel that rolls forwards."""
    sinkage: Array
    """Depth (n,) [m] by which the ground below a wheel is lowered; the tyre's damper misses 2 N at 1 cm/s."""
    ahead: Array
    """Unit vectors (n, 3) in the world, forwards along the ground."""


OTHER: Final = -1


@kernel
def pull(forward: Array, drag: Array, force: Array) -> None:
    """Set the forces (n, 3) of drags along the wheels' directions."""
    for k in range(len(drag)):
        for axis in range(3):
            force[k, axis] = forward[k, axis] * drag[k]


@kernel
def sort_loads(
    geoms: NDArray[np.int32], rows: NDArray[np.int32], forces: Array, kind: NDArray[np.int64], load: Array
) -> bool:
    """Set the loads of the wheels [N]; return whether anything else is touched."""
    load[:] = 0.0
    other = False
    for k in range(len(geoms)):
        wheel = kind[geoms[k]]
        if 0 <= wheel < len(load) and rows[k] >= 0:
            load[wheel] = forces[rows[k]]  # the first row of an elliptic cone is the normal
        other |= wheel == OTHER
    return other


Tyre = tuple[float, float, float]
Grid = tuple[Float32Array, float, float, float]
"""Values (nx, ny, channels) at nodes, x and y [m] of the first node, nodes per metre."""
Ground = tuple[Grid, Grid, Grid, float]
"""Weights of the cover's soils, signed distance to the nearest trail's edge [m], share of stones; width of borders."""
EDGE: Final = 0.1
"""Distance [m] across the edge of a trail or border over which one soil replaces the other: a tyre's width."""
STANDING: Final = 0.05
"""Speed [m/s] of tread or axle below which a contact holds like one at rest, in proportion."""
RUT: Final = 0.1  # [m] of travel in which sinkage follows slip and ground: the patch that presses the rut is as long
SETTLING: Final = 0.1  # [s] in which a standing wheel sinks
LOAD_SECONDS: Final = 0.02  # [s]: the soil feels the mean load of this time, not the ringing of the contact
_BEFORE: Final = 0.02  # [m] beyond the soil that a wheel touches, at which it meets what was pressed before it came
_SMALL: Final = 0.02  # [m/s] at which resistance changes its sign
_MEAN_LOAD, _MEAN_SLIP, _DEPTH = range(3)  # columns of the state


@kernel
def sinkage(load: float, tyre: Tyre, soil: Array) -> float:
    """Sinkage [m] of a wheel at rest that carries ``load`` [N]."""
    width, diameter, _ = tyre
    k_c, k_phi, n = soil[0], soil[1], soil[2]
    return float((3.0 * load / ((3.0 - n) * (k_c + width * k_phi) * math.sqrt(diameter))) ** (2.0 / (2.0 * n + 1.0)))


@kernel
def slip_factor(slip: float) -> float:
    """Sinkage of a driven wheel over its sinkage at rest; ``slip`` in [0, 1]."""
    return (1.0 + slip) / (1.0 - 0.5 * slip)


@kernel
def compaction(load: float, depth: float, tyre: Tyre, soil: Array) -> float:
    """Resistance [N] of soil that a wheel compacts to ``depth`` [m]."""
    n = soil[2]
    return float(3.0 / ((3.0 - n) * (n + 1.0)) * load * math.sqrt(depth / tyre[1]))


@kernel
def fresh(rut: float, depth: float, soil: Array) -> float:
    """Share of the work of compaction to ``depth`` [m] that a rut has not saved."""
    return 1.0 if rut <= 0.0 else float(max(1.0 - (rut / depth) ** (soil[2] + 1.0), 0.0))


@kernel
def patch_length(load: float, depth: float, tyre: Tyre) -> float:
    """Length [m] of the contact of a wheel at ``depth`` [m]."""
    _, diameter, stiffness = tyre
    deflection = max(load, 0.0) / stiffness
    return math.sqrt(diameter * (depth + deflection)) + math.sqrt(diameter * deflection)


@kernel
def strength(load: float, depth: float, tyre: Tyre, soil: Array) -> float:
    """Traction [N] when all soil of the patch is sheared off."""
    return float(soil[3] * tyre[0] * patch_length(load, depth, tyre) + soil[4] * load)


@kernel
def mobilized(slip: float, load: float, depth: float, tyre: Tyre, soil: Array) -> float:
    """Share of the strength that acts at ``slip`` >= 0: 0 without slip, 1 far beyond K / l."""
    x = slip * patch_length(load, depth, tyre) / soil[5]
    return float(0.5 * x if x < 1e-6 else 1.0 + math.expm1(-x) / x)


@kernel
def traction(slip: float, load: float, depth: float, tyre: Tyre, soil: Array) -> float:
    """Traction [N] at ``slip`` >= 0."""
    return strength(load, depth, tyre, soil) * mobilized(slip, load, depth, tyre, soil)


@kernel
def _bilinear(grid: Grid, x: float, y: float, channel: int) -> float:
    """Value at x, y [m]; outside the grid that of its edge."""
    values, x0, y0, per_metre = grid
    u = min(max((x - x0) * per_metre, 0.0), values.shape[0] - 1.0)
    v = min(max((y - y0) * per_metre, 0.0), values.shape[1] - 1.0)
    i, j = min(int(u), values.shape[0] - 2), min(int(v), values.shape[1] - 2)
    u, v = u - i, v - j
    low = values[i, j, channel] * (1.0 - v) + values[i, j + 1, channel] * v
    high = values[i + 1, j, channel] * (1.0 - v) + values[i + 1, j + 1, channel] * v
    return float(low * (1.0 - u) + high * u)


@kernel
def mix_soils(ground: Ground, x: float, y: float, weights: Array) -> None:
    """Fill ``weights`` (n,) with the shares of soils at x, y [m]: the cover's, the trail's, its border's, stones."""
    cover, edge, stones, border_width = ground
    distance, stone = _bilinear(edge, x, y, 0), _bilinear(stones, x, y, 0)
    on_trail = min(max(0.5 - distance / EDGE, 0.0), 1.0)
    inside = min(max(0.5 - (distance + border_width) / EDGE, 0.0), 1.0)
    count = cover[0].shape[2]
    for m in range(count):
        weights[m] = _bilinear(cover, x, y, m) * (1.0 - on_trail) * (1.0 - stone)
    weights[count], weights[count + 1] = inside * (1.0 - stone), (on_trail - inside) * (1.0 - stone)
    weights[count + 2] = stone


@kernel(allocates=True)
def mix_ruts(ground: Ground, values: Array, x: Array, y: Array, out: Array) -> None:
    """Write to ``out`` (n, k) the means of ``values`` (soils, k) by the shares of soils at x, y (n,) [m]."""
    weights = np.empty(len(values))
    for n in range(len(x)):
        mix_soils(ground, x[n], y[n], weights)
        for k in range(values.shape[1]):
            out[n, k] = 0.0
            for m in range(len(values)):
                out[n, k] += weights[m] * values[m, k]


@kernel
def _rut_ahead(ruts: RutTable, wheels: Wheels, k: int, reach: float) -> float:
    """Depth [m] of the rut that is at a distance [m] before a wheel, on the side to which it moves."""
    if len(ruts.depth) == 0:
        return 0.0
    reach = reach if wheels.velocity[k, 0] >= 0.0 else -reach
    x, y = wheels.position[k, 0] + reach * wheels.ahead[k, 0], wheels.position[k, 1] + reach * wheels.ahead[k, 1]
    return float(rut_depth(ruts, x, y))


class Mixture(NamedTuple):
    """Soils (n, 7), what says where each is, ruts, the tyre that rolls on them, and memory (n,) for their shares."""

    soils: Array
    ground: Ground
    ruts: RutTable
    tyre: Tyre
    weights: Array


@kernel
def step_soil(mixture: Mixture, wheels: Wheels, state: Array, dt: float) -> None:
    """Advance ``state`` (n, 3) of the soil by ``dt`` [s] and set friction, drag, torque and sinkage of the wheels."""
    soils, ground, ruts, tyre, weights = mixture
    count = len(state)
    for k in range(count):
        state[k, _MEAN_LOAD] += (wheels.load[k] - state[k, _MEAN_LOAD]) * min(dt / LOAD_SECONDS, 1.0)
    # How a stiff chassis divides its weight between the two diagonals depends on tenths of a millimetre of the ground.
    # Soil that yields evens it out, so the sinkage is that of the loads without this part.
    twist = 0.0
    if count == 4:
        twist = 0.25 * (state[0, _MEAN_LOAD] - state[1, _MEAN_LOAD] - state[2, _MEAN_LOAD] + state[3, _MEAN_LOAD])
    for k in range(count):
        mix_soils(ground, wheels.position[k, 0], wheels.position[k, 1], weights)
        forward, tread, mean = wheels.velocity[k, 0], wheels.rolling[k], state[k]
        pace = max(abs(forward), abs(tread))
        moving, travel = min(pace / STANDING, 1.0), min(pace * dt / RUT, 1.0)
        driven = max(abs(tread) - (forward if tread > 0 else -forward), 0.0) / max(abs(tread), STANDING)
        slip = math.hypot(tread - forward, wheels.velocity[k, 1]) / max(pace, STANDING)
        mean[_MEAN_SLIP] += (min(driven, 1.0) - mean[_MEAN_SLIP]) * travel
        load = max(mean[_MEAN_LOAD], 1.0)
        even = max(mean[_MEAN_LOAD] - (twist if k == 0 or k == 3 else -twist), 1.0)
        friction, resistance, rolling, depth = 0.0, 0.0, 0.0, 0.0
        rut = _rut_ahead(ruts, wheels, k, math.sqrt(tyre[1] * mean[_DEPTH]) + _BEFORE)
        for m in range(len(soils)):
            if weights[m] > 0.0:
                soil, share = soils[m], weights[m]
                z = sinkage(even, tyre, soil) * slip_factor(mean[_MEAN_SLIP])
                held = 1.0 - moving * (1.0 - mobilized(slip, load, z, tyre, soil))
                friction += share * held * strength(load, z, tyre, soil) / load
                resistance += share * compaction(load, z, tyre, soil) * fresh(rut, z, soil)
                rolling += share * soil[6] * load
                depth += share * z
        depth = max(depth, rut)
        sinking = max(depth - mean[_DEPTH], 0.0) * (1.0 - moving) * min(dt / SETTLING, 1.0)
        mean[_DEPTH] += (depth - mean[_DEPTH]) * travel + sinking
        wheels.friction[k, :] = friction
        wheels.drag[k] = -resistance * math.tanh(forward / _SMALL)
        wheels.torque[k] = -rolling * math.tanh(tread / _SMALL) * 0.5 * tyre[1]
        wheels.sinkage[k] = mean[_DEPTH]


@kernel(allocates=True)
def lay_stones(
    heights: Float32Array,
    soil: Float32Array,
    grid: tuple[float, float, float, float],
    vertices: Array,
    faces: NDArray[np.int32],
    poses: Array,
) -> None:
    """Raise ``heights`` to copies of a mesh at ``poses`` (n, 4, 4); ``grid`` is x0, y0, spacing and reach [m].

    Positions are in spacings from the first node.
    """
    x0, y0, spacing, reach = grid
    nx, ny = soil.shape
    placed = np.empty_like(vertices)
    polygon, spare = np.empty((8, 3)), np.empty((8, 3))
    for pose in poses:
        for k in range(len(vertices)):
            x, y, z = vertices[k]
            placed[k, 0] = (pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z + pose[0, 3] - x0) / spacing
            placed[k, 1] = (pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z + pose[1, 3] - y0) / spacing
            placed[k, 2] = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z + pose[2, 3]
        for a, b, c in faces:
            p, q, r = placed[a], placed[b], placed[c]
            if (q[0] - p[0]) * (r[1] - p[1]) <= (q[1] - p[1]) * (r[0] - p[0]):
                continue  # it faces down; the highest points belong to faces that face up
            first_i = max(0, int(np.floor(min(p[0], q[0], r[0]) + 0.5)))
            last_i = min(nx - 1, int(np.floor(max(p[0], q[0], r[0]) + 0.5)))
            first_j = max(0, int(np.floor(min(p[1], q[1], r[1]) + 0.5)))
            last_j = min(ny - 1, int(np.floor(max(p[1], q[1], r[1]) + 0.5)))
            for i in range(first_i, last_i + 1):
                for j in range(first_j, last_j + 1):
                    for axis in range(3):
                        polygon[0, axis], polygon[1, axis], polygon[2, axis] = p[axis], q[axis], r[axis]
                    count = _cut(polygon, 3, spare, 0, 1.0, i + 0.5)
                    count = _cut(spare, count, polygon, 0, -1.0, 0.5 - i)
                    count = _cut(polygon, count, spare, 1, 1.0, j + 0.5)
                    count = _cut(spare, count, polygon, 1, -1.0, 0.5 - j)
                    for k in range(count):
                        below = _height(soil, polygon[k, 0], polygon[k, 1])
                        if below < polygon[k, 2] <= below + reach:
                            # Uphill of the node the soil itself is higher than there.
                            top = polygon[k, 2] - max(0.0, below - soil[i, j])
                            heights[i, j] = max(heights[i, j], np.float32(top))


@kernel(allocates=True)
def _cut(corners: Array, count: int, kept: Array, axis: int, sign: float, limit: float) -> int:
    """Write to ``kept`` the part of a convex polygon where sign * coordinate <= limit; return its corner count."""
    n = 0
    for k in range(count):
        a, b = corners[k], corners[(k + 1) % count]
        over_a, over_b = sign * a[axis] - limit, sign * b[axis] - limit
        if over_a <= 0.0:
            for m in range(3):
                kept[n, m] = a[m]
            n += 1
        if (over_a < 0.0 < over_b) or (over_b < 0.0 < over_a):
            share = over_a / (over_a - over_b)
            for m in range(3):
                kept[n, m] = a[m] + share * (b[m] - a[m])
            n += 1
    return n


@kernel
def _height(soil: Float32Array, u: float, v: float) -> float:
    """Height [m] of the triangles of ``soil`` at ``u``, ``v`` in spacings from the first node."""
    nx, ny = soil.shape
    u, v = min(max(u, 0.0), nx - 1.0), min(max(v, 0.0), ny - 1.0)
    i, j = min(int(u), nx - 2), min(int(v), ny - 2)
    u, v = u - i, v - j
    low, high = soil[i, j], soil[i + 1, j + 1]
    if u >= v:
        return float(low + u * (soil[i + 1, j] - low) + v * (high - soil[i + 1, j]))
    return float(low + v * (soil[i, j + 1] - low) + u * (high - soil[i, j + 1]))
