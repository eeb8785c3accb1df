# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Measurements of a LiDAR from echoes: random draws of each ray, the receiver's noise, and weather in the beam.

``sensors.lidar.sensing`` and ``sense.air`` say what their tables mean.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.classes import Label
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.kernels.lidar import EchoBuffers, Receiver
from fieldtruth.kernels.light import fog_length

DRAWS_PER_RAY = 16
_GAMMA, _FIRST, _SECOND = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_30, _27, _31, _32, _LOW = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(32), np.uint64(0xFFFFFFFF)
_PER_RAY = np.uint64(DRAWS_PER_RAY)
_SCALE = 1.0 / 4294967296.0


@inlined
def _bits(key: np.uint64, ray: int, draw: int) -> np.uint64:
    """Bits of SplitMix64 seeded with ``key`` at a position of its sequence (Steele, Lea and Flood 2014, Fast
    splittable pseudorandom number generators).
    """
    bits = key + (np.uint64(ray) * _PER_RAY + np.uint64(draw + 1)) * _GAMMA
    bits = (bits ^ (bits >> _30)) * _FIRST
    bits = (bits ^ (bits >> _27)) * _SECOND
    return bits ^ (bits >> _31)


@inlined
def uniforms(key: np.uint64, ray: int, draw: int) -> tuple[float, float]:
    """Two independent numbers between 0 and 1, without the ends."""
    bits = _bits(key, ray, draw)
    return (np.float64(bits >> _32) + 0.5) * _SCALE, (np.float64(bits & _LOW) + 0.5) * _SCALE


@inlined
def normals(key: np.uint64, ray: int, draw: int) -> tuple[float, float]:
    """Two independent numbers of the standard normal distribution.

    Box and Muller's transform of two halves of 32 bits ends at 6.8.
    """
    bits = _bits(key, ray, draw)
    radius = np.sqrt(-2.0 * np.log((np.float64(bits >> _32) + 0.5) * _SCALE))
    angle = 2.0 * np.pi * (np.float64(bits & _LOW) * _SCALE)
    return radius * np.cos(angle), radius * np.sin(angle)


class Reading(NamedTuple):
    """The points of one revolution, ordered by column, ring and echo.

    As ``Scan``, with ``range_m`` as measured; ``true_range`` [m] is that of the middle of the
    beam as the ideal LiDAR has it, 0 if that meets nothing; ``signal`` [photon], 0 if every pulse returns;
    ``reflectivity`` the reflectance of a matt surface that faces the LiDAR at the measured range and has this signal;
    ``echo`` 0 for the nearest of a beam; ``mixed`` 1 if surfaces of more than one class or object made the echo.
    """

    xyz: Float32Array
    range_m: Float32Array
    label: NDArray[np.uint8]
    instance: NDArray[np.uint32]
    ring: NDArray[np.uint16]
    column: NDArray[np.uint16]
    t_ns: NDArray[np.uint32]
    true_range: Float32Array
    signal: Float32Array
    reflectivity: Float32Array
    echo: NDArray[np.uint8]
    mixed: NDArray[np.uint8]
    top: NDArray[np.uint32]
    part: NDArray[np.uint8]


@inlined
def deviation(receiver: Receiver, signal: float) -> float:
    """Standard deviation [m] of a range by its signal: linear in both logarithms, constant beyond the ends."""
    signals, deviations = receiver.log_signal, receiver.log_deviation
    last = signals.shape[0] - 1
    if last < 0:
        return 0.0
    at = np.log(signal)
    if receiver.gain == 0.0 or at >= signals[last]:
        return np.exp(deviations[last])  # type: ignore[no-any-return]
    if at <= signals[0]:
        return np.exp(deviations[0])  # type: ignore[no-any-return]
    k = 0
    while at > signals[k + 1]:
        k += 1
    share = (at - signals[k]) / (signals[k + 1] - signals[k])
    return np.exp(deviations[k] + share * (deviations[k + 1] - deviations[k]))  # type: ignore[no-any-return]


@inlined
def turned(direction: tuple[float, float, float], across: float, up: float) -> tuple[float, float, float]:
    """Unit direction turned by small angles [rad]: across, to the left in the x-y plane, and up."""
    x, y, z = direction
    flat = np.sqrt(x * x + y * y)
    cx, cy = (-y / flat, x / flat) if flat > 1e-9 else (0.0, 1.0)
    scale = 1.0 / np.sqrt(1.0 + across * across + up * up)
    ux, uy, uz = -z * cy, z * cx, x * cy - y * cx
    return (x + across * cx + up * ux) * scale, (y + across * cy + up * uy) * scale, (z + up * uz) * scale


@kernel
def measure(receiver: Receiver, key: np.uint64, directions: Array, echoes: EchoBuffers, out: Reading) -> int:
    """Write the points that a LiDAR reports of its echoes into the first rows of ``out``; returns their number.

    Directions (columns, rings, 3). Draws depend on ``key``, ray and echo, not on what else returns.
    """
    labels, instances, depths, apparents, mixes, _, true_range = echoes
    gain, threshold, step, angle = receiver.gain, receiver.threshold, receiver.resolution, receiver.angle
    count, columns, rings = depths.shape
    k = 0
    for column in range(columns):
        for ring in range(rings):
            ray, number = column * rings + ring, 0
            for echo in range(count):
                distance = np.float64(depths[echo, column, ring])
                if distance == 0.0:
                    continue
                of_signal, of_range = normals(key, ray, 2 * echo)
                signal = gain * apparents[echo, column, ring] / (distance * distance)
                counted = signal + np.sqrt(signal) * of_signal
                if gain > 0.0 and counted < threshold:
                    continue
                measured = distance + deviation(receiver, signal) * of_range
                if step > 0.0:
                    measured = np.rint(measured / step) * step
                if measured <= 0.0:
                    continue
                x, y, z = directions[column, ring, 0], directions[column, ring, 1], directions[column, ring, 2]
                if angle > 0.0:
                    across, up = normals(key, ray, 2 * echo + 1)
                    x, y, z = turned((x, y, z), angle * across, angle * up)
                out.xyz[k, 0], out.xyz[k, 1], out.xyz[k, 2] = x * measured, y * measured, z * measured
                out.range_m[k], out.true_range[k] = measured, true_range[column, ring]
                out.label[k], out.instance[k] = labels[echo, column, ring], instances[echo, column, ring]
                out.ring[k], out.column[k] = ring, column
                out.signal[k] = counted if gain > 0.0 else 0.0
                bright = counted * measured * measured / gain if gain > 0.0 else apparents[echo, column, ring]
                out.reflectivity[k], out.echo[k], out.mixed[k] = bright, number, mixes[echo, column, ring]
                k, number = k + 1, number + 1
    return k


LEAST_POWER: Final = 1e-7
"""Weaker echoes of single particles are left out: a black surface (1 %) at 300 m is as weak."""
SOFT_STEP: Final = 0.1  # [m]


class Air(NamedTuple):
    """The weather in one LiDAR's beam. Clear air has ``extinction`` 0 and ``has_echoes`` False."""

    extinction: float  # [1/m], of fog that thins with height where it is densest
    fog: float  # [1/m] part of it that thins
    fog_scale: float  # [m] height over which it does, see fog_length; 0 without
    fog_echo: float  # part of the soft target's echo that thins
    has_echoes: bool
    soft_power: Array  # (s,) greatest power of the soft target in front of a surface at k _SOFT_STEP, the last one any
    soft_share: Array  # (s, c) probability that it is found in one of the cells up to a cell
    cell: float  # [m] length of a cell, within which the pulse merges echoes; the first begins at min_range
    min_range: float  # [m]
    first_log_power: float  # of numbers
    per_log_power: float  # rows of numbers
    first_log_range: float
    per_log_range: float  # columns of numbers
    numbers: Array  # (p, r) mean number of particles nearer than a range whose echo is stronger than a power


@inlined
def _between(values: Array, row: int, column: int, share: float) -> float:
    """Entry of a row between two columns."""
    begin: float = values[row, column]
    end: float = values[row, column + 1]
    return begin + share * (end - begin)


@inlined
def _soft_range(air: Air, k: int, u: float) -> float:
    """Range at which the greatest power of a soft target is found, by a number u in (0, 1]."""
    j, begin = 0, 0.0
    while j < air.soft_share.shape[1] - 1 and air.soft_share[k, j] < u:
        begin = air.soft_share[k, j]
        j += 1
    share = (u - begin) / max(air.soft_share[k, j] - begin, 1e-12)
    return float(air.min_range + air.cell * (j + min(share, 1.0)))


@inlined
def transmitted(air: Air, range_m: float, above: float, slope: float) -> float:
    """Share of a surface's power that the air leaves, there and back.

    The beam begins ``above`` [m] the densest fog, and ``slope`` is the sine of its elevation.
    """
    thin = range_m - fog_length(above, slope * range_m, range_m, air.fog_scale)
    return np.exp(-2.0 * (air.extinction * range_m - air.fog * thin))  # type: ignore[no-any-return]


@inlined
def _soft_share(air: Air, range_m: float, above: float, slope: float) -> float:
    """Echo of the soft target at a range over that where the fog is densest everywhere."""
    if air.fog_scale == 0.0:
        return 1.0
    density = np.exp(-(above + slope * range_m) / air.fog_scale)
    less = np.exp(2.0 * air.extinction * range_m) * transmitted(air, range_m, above, slope)
    return (1.0 - air.fog_echo * (1.0 - density)) * less  # type: ignore[no-any-return]


@inlined
def strongest_echo(
    air: Air, power: float, range_m: float, beam: tuple[float, float], u1: float, u2: float
) -> tuple[float, float, bool]:
    """Power and range [m] of the strongest echo of a ray, and whether it is a particle's.

    ``power`` is the surface's in this air and ``range_m`` its range; a ray that meets none has power 0 and the LiDAR's
    max_range. ``beam`` is where it begins and its slope, as for ``transmitted``. ``u1`` and ``u2`` are uniform in
    (0, 1].
    """
    particle, at, table, rows = False, range_m, air.numbers, air.numbers.shape[0]
    k = min(int(range_m / SOFT_STEP), air.soft_power.shape[0] - 1)
    if air.soft_power[k] > 0.0:
        found = min(_soft_range(air, k, u2), range_m)
        soft = air.soft_power[k] * _soft_share(air, found, beam[0], beam[1])
        if soft > power:
            power, at, particle = soft, found, True
    column = (np.log(range_m) - air.first_log_range) * air.per_log_range
    if column <= 0.0:
        return power, at, particle
    last = min(int(column), table.shape[1] - 2)
    share = min(column - last, 1.0)
    rarity = -np.log(u1)  # the strongest one's power is that of which so many are expected to be stronger
    row = (np.log(max(power, LEAST_POWER)) - air.first_log_power) * air.per_log_power
    low = min(int(row), rows - 2)
    below, above = _between(table, low, last, share), _between(table, low + 1, last, share)
    if rarity >= below + (row - low) * (above - below):
        return power, at, particle
    high = rows - 1
    while high - low > 1:
        middle = (low + high) // 2
        if _between(table, middle, last, share) > rarity:
            low = middle
        else:
            high = middle
    below, above = _between(table, low, last, share), _between(table, low + 1, last, share)
    power = np.exp(air.first_log_power + (low + (below - rarity) / (below - above)) / air.per_log_power)
    wanted = u2 * (below - above)  # particles of about this power, by range
    left, right = 0, last + 1
    while right - left > 1:
        middle = (left + right) // 2
        if table[low, middle] - table[low + 1, middle] < wanted:
            left = middle
        else:
            right = middle
    begin = table[low, left] - table[low + 1, left]
    end = table[low, left + 1] - table[low + 1, left + 1]
    column = left + (wanted - begin) / max(end - begin, 1e-300)
    return power, min(np.exp(air.first_log_range + column / air.per_log_range), range_m), True


DRAW: Final = 15
"""Of a ray, the last: the others are of its noise."""
_PARTICLE: Final = int(Label.PARTICLE)


@kernel
def add_weather(air: Air, least: float, key: np.uint64, upwards: Array, directions: Array, echoes: EchoBuffers) -> None:
    """Attenuate the echoes of surfaces; the strongest particle of a beam replaces its weakest echo if that is weaker.

    It does not if an echo has a power of at least ``least``. ``upwards`` (columns, 4) is the third row of each pose,
    with the height above the densest fog.
    """
    depths, apparents = echoes.depth, echoes.apparent
    count, columns, rings = depths.shape
    for column in range(columns):
        for ring in range(rings):
            weakest, lowest, strongest, beam = 0, np.inf, 0.0, (0.0, 0.0)
            if air.fog_scale > 0.0:
                ray, up = directions[column, ring], upwards[column]
                beam = max(up[3], 0.0), up[0] * ray[0] + up[1] * ray[1] + up[2] * ray[2]
            for echo in range(count):
                distance, power = np.float64(depths[echo, column, ring]), 0.0
                if distance > 0.0:
                    power = apparents[echo, column, ring] * transmitted(air, distance, beam[0], beam[1])
                    apparents[echo, column, ring], power = power, power / (distance * distance)
                if power < lowest:
                    weakest, lowest = echo, power
                strongest = max(strongest, power)
            clear = np.float64(echoes.clear[column, ring])
            u1, u2 = uniforms(key, column * rings + ring, DRAW)
            power, at, particle = strongest_echo(air, lowest, clear, beam, u1, u2)
            if particle and strongest < least:
                depths[weakest, column, ring], apparents[weakest, column, ring] = at, power * at * at
                echoes.label[weakest, column, ring], echoes.instance[weakest, column, ring] = _PARTICLE, 0
                echoes.mixed[weakest, column, ring] = False
                if count == 2 and 0.0 < depths[1, column, ring] < depths[0, column, ring]:
                    _swap(echoes.label, column, ring)
                    _swap(echoes.instance, column, ring)
                    _swap(echoes.mixed, column, ring)
                    _swap(apparents, column, ring)
                    _swap(depths, column, ring)


@inlined
def _swap(values: NDArray[Any], column: int, ring: int) -> None:
    """Exchange the two echoes of a beam: the nearest is the first."""
    first = values[0, column, ring]
    values[0, column, ring] = values[1, column, ring]
    values[1, column, ring] = first
