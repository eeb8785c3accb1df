# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of real IMUs against the ideal ones beside them.

What is random is compared with its law, within five standard deviations of the statistic. From the readings of a triad,
a matrix and a constant are fitted to the true ones by least squares; what remains is bias walk and noise. Differences
of successive remainders are noise alone, as the walk of one step is far smaller.
"""

import math
from typing import Any, Final

import numpy as np

from fieldtruth.bag.reader import RawMessage
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.experiment.sensor_config import TRUTH
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.imu.noise import BOTTOM, FLICKER_TIMES_S, Triad
from fieldtruth.sensors.imu.signal import ImuSignal
from fieldtruth.validation.check import SIGMAS, Rule, Spec, see_normal
from fieldtruth.validation.context import Checker, Context

RANGE: Final = Rule("readings of an IMU are within its range, in steps of its resolution")
BIAS: Final = Rule("the bias has the order of the experiment's", SIGMAS, "deviations")
WHITE_MEAN: Final = Rule("the noise has the mean zero", SIGMAS, "deviations")
WHITE: Final = Rule("the noise has its deviation", SIGMAS, "deviations")
WHITE_SHAPE: Final = Rule("the noise is normal: 68 % are within one deviation", SIGMAS, "deviations")
ATTITUDE: Final = Rule("the error of the attitude has the order of the experiment's", SIGMAS, "deviations")
COVARIANCES: Final = Rule("covariances are those of the noise", 1e-9, "of the variance")
IMU_NOISE: Final[Spec] = Spec(
    "imu noise",
    (RANGE, BIAS, WHITE_MEAN, WHITE, WHITE_SHAPE, ATTITUDE, COVARIANCES),
    "readings",
    "no IMU with a signal",
)
_LEAST: Final = 100
"""Fewest readings whose distribution is compared."""
_TRIADS: Final = ("gyroscope", "accelerometer")


class ImuNoise(Checker):
    """Every IMU with a signal against its ideal readings."""

    def __init__(self, context: Context) -> None:
        self._tally = context.tally(IMU_NOISE)
        self.tallies = [self._tally]
        configs = [each for each in context.rig.imus if each.signal is not None]
        self._configs = {each.topic: each for each in configs if each.topic in context.run.counts}
        self.topics = tuple(name + end for name in self._configs for end in ("", TRUTH))
        self._rows: dict[str, dict[int, Array]] = {name: {} for name in self.topics}

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        q, w, f = message.orientation, message.angular_velocity, message.linear_acceleration
        row = np.array([w.x, w.y, w.z, f.x, f.y, f.z, q.x, q.y, q.z, q.w])
        self._rows[raw.topic][raw.stamp_ns] = row
        if raw.topic in self._configs:
            self._see_covariances(self._configs[raw.topic], message, f"{raw.topic} at {raw.stamp_ns} ns")

    def _see_covariances(self, config: ImuConfig, message: Any, where: str) -> None:
        signal = config.signal
        assert signal is not None
        found = np.stack([message.angular_velocity_covariance, message.linear_acceleration_covariance])
        due = [np.diag(Triad.of(signal, name).variances(config.rate_hz)).ravel() for name in _TRIADS]
        self._tally[COVARIANCES].measure(float(np.abs(found - due).max() / max(np.max(due), 1e-300)), where)

    def finish(self) -> None:
        """Compare the distributions after the last message."""
        for name, config in self._configs.items():
            read, true = self._rows[name], self._rows[name + TRUTH]
            stamps = [stamp for stamp in sorted(read) if stamp in true]
            if len(stamps) >= _LEAST and config.signal is not None:
                rows, of_true = (np.array([part[stamp] for stamp in stamps]) for part in (read, true))
                for k, triad in enumerate(_TRIADS):
                    part = slice(3 * k, 3 * k + 3)
                    where = f"{triad} of {config.name}"
                    figures = Triad.of(config.signal, triad)
                    self._see_triad(rows[:, part], of_true[:, part], figures, config.rate_hz, where)
                self._see_attitude(rows[:, 6:], of_true[:, 6:], config.signal, config.name)

    def _see_triad(self, read: Array, true: Array, triad: Triad, rate_hz: float, where: str) -> None:
        limit, step = triad.range or math.inf, triad.resolution
        within: Mask = np.asarray(np.abs(read) <= limit * (1.0 + 1e-9))
        if step is not None:
            within &= np.asarray(np.abs(read / step - np.rint(read / step)) < 1e-6)
        self._tally[RANGE].see_all(np.asarray(within.all(axis=1)), lambda k: f"{where}: {read[k]}")
        inside: Mask = np.asarray((np.abs(read) < limit - (step or 0.0)).all(axis=1))
        if np.count_nonzero(inside) < _LEAST:
            return
        read, true = read[inside], true[inside]
        spread = true - true.mean(axis=0)
        matrix = np.linalg.lstsq(spread, read - true - (read - true).mean(axis=0), rcond=1e-6)[0]
        error = read - true - true @ matrix
        if not (triad.scale or triad.misalignment):
            error = read - true
        flicker = triad.bottom / BOTTOM * math.sqrt(math.log(4.0) / math.pi * len(FLICKER_TIMES_S))
        seconds = len(error) / rate_hz
        of_scale = np.abs(true).max() * math.hypot(triad.scale, 2.0 * triad.misalignment)
        noise = np.sqrt(triad.variances(rate_hz))
        order = np.sqrt(triad.bias**2 + triad.walk**2 * seconds + flicker**2 + of_scale**2 + noise**2 / len(error))
        bias = error.mean(axis=0)
        self._tally[BIAS].measure_all(bias / np.maximum(order, 1e-12), lambda k: f"{where}, axis {'xyz'[k]}")
        fine = (step or 0.0) < noise
        for axis in np.flatnonzero((triad.density > 0.0) & fine):
            changes = np.diff(error[:, axis])[::2] / (math.sqrt(2.0) * noise[axis])
            see_normal(self._tally, (WHITE_MEAN, WHITE, WHITE_SHAPE), changes, f"{where}, axis {'xyz'[axis]}")

    def _see_attitude(self, read: Array, true: Array, signal: ImuSignal, name: str) -> None:
        if signal.no_attitude:
            return
        # The vector of read * conjugate(true) is half of the turn about the axes of the world.
        turned = 2.0 * (true[:, 3:] * read[:, :3] - read[:, 3:] * true[:, :3] - np.cross(read[:, :3], true[:, :3]))
        turned *= np.sign(np.sum(read * true, axis=1))[:, None]
        deviation = np.array([signal.roll_pitch_error, signal.roll_pitch_error, signal.yaw_error])
        worst = np.sqrt((turned**2).mean(axis=0)) / np.maximum(deviation, 1e-9)
        self._tally[ATTITUDE].measure_all(worst, lambda k: f"{name}, axis {'xyz'[k]} of the world")
