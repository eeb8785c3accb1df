# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""From echoes to readings: photons that are counted, pulses that return, and the noise of range and angles.

Power falls as P = P0 D^2 sigma eta exp(-2 alpha R) / (16 A R^2) with sigma = 4 pi rho cos(theta) A of a surface that
fills the beam (Carlsson 2000, FOI-R-1163; Wagner 2010, ISPRS Journal 65, 505-513). Aperture, optics and laser are one
constant, which the ``reach`` of the data sheet gives: signal = signal_at_reach (rho_a / R^2) / (rho_0 / R_0^2).

The signal counts photons, so its variance is its mean (Poisson; normal here, at 12 photons and more). A real OS1-64 of
generation 1 (RELLIS-3D, frame 000104) agrees: on concrete the deviation of the signal is 4.0 at 25, 5.4 at 44 and 7.5
at 88 photons, the weakest returns have 11 to 14, and grass at 4 to 8 m reads 7.4 % where its reflectance of 50 % under
an incidence of 81 deg gives 8 %.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.sensors.lidar.draws import normals
from fieldtruth.sensors.lidar.signal import LidarSignal
from fieldtruth.sensors.lidar.surfaces import EchoBuffers


class Receiver(NamedTuple):
    """A LidarSignal as kernels take it."""

    gain: float
    """Photons from a matt white surface that faces the LiDAR at 1 m; 0 if every pulse returns."""
    threshold: float
    """[photon]"""
    log_signal: Array
    """Points of the standard deviation of ranges; empty without noise."""
    log_deviation: Array
    resolution: float
    """[m]"""
    angle: float
    """[rad]"""


class Reading(NamedTuple):
    """The points of one revolution, ordered by column, ring and echo.

    As ``sensors.lidar.sensing.Scan``, with ``range_m`` as measured; ``true_range`` [m] is that of the middle of the
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


def new_reading(count: int) -> Reading:
    """Return an empty reading of so many points."""
    kinds = (np.float32, np.uint8, np.uint32, np.uint16, np.uint16, np.uint32, *3 * (np.float32,), np.uint8, np.uint8)
    return Reading(np.zeros((count, 3), np.float32), *(np.zeros(count, kind) for kind in kinds))  # type: ignore[arg-type]


def limit_of(signal: LidarSignal) -> float:
    """Apparent reflectance over squared range [1/m^2] at which half of the pulses return; 0 if all return.

    The pairs of a data sheet are one figure, rounded twice: 80 % at 120 m and 10 % at 40 m differ by 12 % in power, and
    their mean in logarithm by 3 % in range from either. (It is no extinction, which would make the far one weaker.)
    """
    return float(np.exp(np.mean([np.log(rho / r**2) for rho, r in signal.reach]))) if signal.reach else 0.0


def receiver_of(signal: LidarSignal) -> Receiver:
    """Constants of a signal."""
    limit = limit_of(signal)
    noise = np.log(np.array(signal.range_noise, np.float64).reshape(-1, 2))
    return Receiver(
        gain=signal.signal_at_reach / limit if limit else 0.0,
        threshold=signal.signal_at_reach,
        log_signal=np.ascontiguousarray(noise[:, 0]),
        log_deviation=np.ascontiguousarray(noise[:, 1]),
        resolution=signal.resolution,
        angle=float(np.radians(signal.angle_noise_deg)),
    )


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
