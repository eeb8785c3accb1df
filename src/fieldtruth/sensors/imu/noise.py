# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of a real IMU from the true ones: arrays to arrays, for a whole series at once.

A reading is made in the order of the physics: with u the true reading of a triad,

    measured = quantised(limited((1 + S + M) u + bias + white)).

S is a diagonal matrix of scale errors, M one of misalignments beside the diagonal; both are drawn once.

white: with density N and rate r, each reading has noise of its own with the deviation N sqrt(r) (Kalibr's wiki, "IMU
Noise Model"). With ``sampling: mean`` that is the exact mean of white noise over the interval of the reading. With
``sampling: instant`` it is the noise of a sensor whose filter ends at half the rate, as Kalibr assumes it, so that the
Allan deviation is N / sqrt(tau) in both cases.

bias: a constant that is drawn once, plus a random walk with steps K sqrt(dt), whose Allan deviation is K sqrt(tau / 3)
(IEEE Std 952, C.1.3), plus flicker noise, whose Allan deviation has a flat bottom (C.1.2). Its spectrum B^2 / (2 pi f)
is the sum of Gauss-Markov processes with equal variances B^2 ln(4) / pi and correlation times of 1 s, 4 s, ... 4096 s,
since the integral of their spectra over ln T is 1 / f. The bottom is B sqrt(2 ln(2) / pi), which data sheets state.

attitude: the true one turned about the axes of the world by angles that are Gauss-Markov processes.
"""

import math
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from fieldtruth.core.arrays import Array
from fieldtruth.core.frames import wxyz_from_xyzw, xyzw_from_wxyz
from fieldtruth.drive.track import ImuReadings
from fieldtruth.sensors.imu.signal import Axes, ImuSignal

FLICKER_TIMES_S: Final = tuple(4.0**n for n in range(7))
"""Correlation times [s] of the processes whose sum is flicker noise."""
BOTTOM: Final = math.sqrt(2.0 * math.log(2.0) / math.pi)
"""Allan deviation of flicker noise with B = 1: IEEE Std 952, C.1.2."""


class Triad(NamedTuple):
    """Figures of the three axes of gyroscope or accelerometer; arrays are (3,), in units of the readings."""

    density: Array
    walk: Array
    bottom: Array
    bias: Array
    scale: float
    misalignment: float
    range: float | None
    resolution: float | None

    @classmethod
    def of(cls, signal: ImuSignal, triad: str) -> "Triad":
        """Figures of ``gyroscope`` or ``accelerometer``."""

        def figure(name: str) -> Any:
            return getattr(signal, f"{triad}_{name}")

        density, walk, bottom, bias = (
            axes_of(figure(name)) for name in ("noise_density", "random_walk", "bias_instability", "bias")
        )
        others = (figure(name) for name in ("scale_error", "misalignment", "range", "resolution"))
        return cls(density, walk, bottom, bias, *others)

    def variances(self, rate_hz: float) -> Array:
        """Variances (3,) of the part of a reading's error that no other reading has: white noise and rounding."""
        rounding = 0.0 if self.resolution is None else self.resolution**2 / 12.0
        variances: Array = self.density**2 * rate_hz + rounding
        return variances


class MeasuredImu(NamedTuple):
    """Readings of a real IMU, and the covariances (9,) of its messages, row by row: 0 is unknown."""

    readings: ImuReadings
    attitude_covariance: Array  # [rad^2], about the axes of the world
    rate_covariance: Array  # [rad^2/s^2]
    force_covariance: Array  # [m^2/s^4]


def measured_imu(true: ImuReadings, signal: ImuSignal, rate_hz: float, rng: np.random.Generator) -> MeasuredImu:
    """Return what a real IMU reads where an ideal one has the ``true`` readings, at ``rate_hz``."""
    of_gyroscope, of_accelerometer, of_attitude = rng.spawn(3)
    gyroscope, accelerometer = Triad.of(signal, "gyroscope"), Triad.of(signal, "accelerometer")
    readings = replace(
        true,
        quaternion_wxyz=_attitude(true.quaternion_wxyz, signal, rate_hz, of_attitude),
        angular_velocity=measured_triad(true.angular_velocity, gyroscope, rate_hz, of_gyroscope),
        linear_acceleration=measured_triad(true.linear_acceleration, accelerometer, rate_hz, of_accelerometer),
    )
    tilt, yaw = signal.roll_pitch_error**2, signal.yaw_error**2
    attitude = np.array([-1.0, *[0.0] * 8]) if signal.no_attitude else np.diag([tilt, tilt, yaw]).ravel()
    rate, force = (np.diag(triad.variances(rate_hz)).ravel() for triad in (gyroscope, accelerometer))
    return MeasuredImu(readings, attitude, rate, force)


def measured_triad(true: Array, triad: Triad, rate_hz: float, rng: np.random.Generator) -> Array:
    """Return the readings (n, 3) of a real gyroscope or accelerometer whose true readings are (n, 3)."""
    fixed, white, slow = rng.spawn(3)
    matrix = np.eye(3) + triad.misalignment * fixed.standard_normal((3, 3)) * (1.0 - np.eye(3))
    matrix += np.diag(triad.scale * fixed.standard_normal(3))
    bias = triad.bias * fixed.standard_normal(3) + _bias_changes(len(true), triad, rate_hz, slow)
    read = true @ matrix.T + bias + triad.density * math.sqrt(rate_hz) * white.standard_normal(true.shape)
    return quantised(read, triad.range, triad.resolution)


def quantised(values: Array, limit: float | None, resolution: float | None) -> Array:
    """Return values limited to ``limit`` of either sign, as the nearest multiples of ``resolution`` within it."""
    if resolution is None:
        return values if limit is None else np.clip(values, -limit, limit)
    steps = np.rint(values / resolution)
    if limit is not None:
        most = math.floor(limit / resolution * (1.0 + 1e-12))
        steps = np.clip(steps, -most, most)
    return np.asarray(steps * resolution)


def markov(count: int, deviation: Array, time_s: float, rate_hz: float, rng: np.random.Generator) -> Array:
    """Return (count, 3) values of Gauss-Markov processes with a deviation (3,), a correlation time and a rate."""
    kept = math.exp(-1.0 / (time_s * rate_hz))
    noise = rng.standard_normal((count, 3))
    noise[1:] *= math.sqrt(1.0 - kept**2)
    values: Array = lfilter([1.0], [1.0, -kept], noise, axis=0) * deviation
    return values


def _bias_changes(count: int, triad: Triad, rate_hz: float, rng: np.random.Generator) -> Array:
    """Return how the bias differs (count, 3) from what it was when the sensor was turned on."""
    of_walk, *of_flicker = rng.spawn(1 + len(FLICKER_TIMES_S))
    bias: Array = np.zeros((count, 3))
    if triad.walk.any():
        bias += np.cumsum(of_walk.standard_normal((count, 3)), axis=0) * triad.walk / math.sqrt(rate_hz)
    if triad.bottom.any():
        deviation = triad.bottom / BOTTOM * math.sqrt(math.log(4.0) / math.pi)
        for time_s, own in zip(FLICKER_TIMES_S, of_flicker, strict=True):
            bias += markov(count, deviation, time_s, rate_hz, own)
    return bias


def _attitude(quaternion_wxyz: Array, signal: ImuSignal, rate_hz: float, rng: np.random.Generator) -> Array:
    """Return the attitudes (n, 4) that the sensor states."""
    if signal.no_attitude:
        return np.tile([1.0, 0.0, 0.0, 0.0], (len(quaternion_wxyz), 1))
    deviation = np.array([signal.roll_pitch_error, signal.roll_pitch_error, signal.yaw_error])
    if not deviation.any():
        return quaternion_wxyz
    turned = Rotation.from_rotvec(markov(len(quaternion_wxyz), deviation, signal.attitude_correlation_s, rate_hz, rng))
    return np.asarray(wxyz_from_xyzw((turned * Rotation.from_quat(xyzw_from_wxyz(quaternion_wxyz))).as_quat()))


def axes_of(value: Axes) -> Array:
    """Return a figure of three axes (3,)."""
    return np.array(np.broadcast_to(np.asarray(value, np.float64), 3))
