# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of IMUs against the true motion and the mounts, and those of real IMUs against the ideal ones beside them.

Ideal ones have no noise and follow from the true motion by formulas, so that the residual is rounding: 1e-13 m/s^2, the
last digit of a velocity, over a millisecond. Means are compared where the motion of their interval is kept, which is
four seconds.

Of real ones, what is random is compared with its law, within five standard deviations of the statistic. From the
readings of a triad, a matrix and a constant are fitted to the true ones by least squares; what remains is bias walk and
noise. Differences of successive remainders are noise alone, as the walk of one step is far smaller.
"""

import math
from typing import Any, Final

import numpy as np

from fieldtruth.bag.reader import RawMessage
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.experiment.robot_config import GRAVITY
from fieldtruth.experiment.sensor_config import TRUTH
from fieldtruth.sensors.imu.config import ImuConfig, ImuSignal
from fieldtruth.sensors.imu.sensing import BOTTOM, FLICKER_TIMES_S, Triad, point_velocity, rotation_vector
from fieldtruth.validation.check import SIGMAS, Rule, Spec, see_normal
from fieldtruth.validation.context import STEP_NS, Checker, Context, at
from fieldtruth.validation.kind_checks import KindChecks

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
        configs = [each for each in context.rig.enabled(ImuConfig) if each.signal is not None]
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


_ATTITUDE: Final = Rule("the IMU's attitude is the true one, turned by its mount", 1e-9, "rad")
TURN_RATE: Final = Rule("the gyroscope measures the turn of its interval", 1e-9, "rad/s")
FORCE: Final = Rule("the accelerometer measures the change of velocity, and gravity", 1e-6, "m/s^2")
IMU_EXACT: Final = Rule("covariances of the IMU are zero", minor=True)
_NO_IMU: Final = "no IMU, or no true motion"
IMU: Final[Spec] = Spec("imu", (_ATTITUDE, TURN_RATE, FORCE, IMU_EXACT), "readings", _NO_IMU)


class Imu(Checker):
    """Attitude, turn rate and specific force of every IMU in its frame (REP-145)."""

    def __init__(self, context: Context) -> None:
        self._motion, self._tally = context.motion, context.tally(IMU)
        self.tallies = [self._tally]
        self._configs = {config.true_topic(config.topic): config for config in context.rig.enabled(ImuConfig)}
        self.topics = tuple(self._configs)

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        covariances = np.concatenate([
            message.orientation_covariance, message.angular_velocity_covariance, message.linear_acceleration_covariance
        ])  # fmt: skip
        self._tally[IMU_EXACT].see(not covariances.any(), at(raw))
        # The first step has no predecessor: its reading is that of the second step.
        ready = raw.stamp_ns + STEP_NS if raw.stamp_ns <= STEP_NS else raw.stamp_ns
        self._motion.when_known(ready, lambda: self._compare(raw, message))

    def _compare(self, raw: RawMessage, message: Any) -> None:
        state, tally, q = self._motion.state(raw.stamp_ns), self._tally, message.orientation
        config = self._configs[raw.topic]
        base_from_imu = config.mount.base_from_sensor
        measured = np.array([q.w, q.x, q.y, q.z])
        if not abs(np.linalg.norm(measured) - 1.0) < 1e-6:
            tally[_ATTITUDE].measure(np.nan, f"{at(raw)}: not a unit quaternion")
            return
        world_from_imu = transforms.rotation_from_quaternion_wxyz(state.quaternion_wxyz) @ base_from_imu[:3, :3]
        turn = world_from_imu.T @ transforms.rotation_from_quaternion_wxyz(measured)
        # The off-diagonal elements are the small angle; the trace would lose half of the digits.
        tally[_ATTITUDE].measure(float(np.abs(turn - np.eye(3)).max()), at(raw))
        motion, end = self._motion.motion, max(raw.stamp_ns, 2 * STEP_NS)
        row, before = self._motion.row(end), self._motion.row(_begin(config, end))
        if row is None or before is None:
            return
        seconds, rows = (motion.stamps_ns[row] - motion.stamps_ns[before]) / 1e9, np.array([before, row])
        rate = motion.angular_velocity[row]
        if config.sampling == "mean":
            turned = rotation_vector(motion.quaternion_wxyz[rows[:1]], motion.quaternion_wxyz[rows[1:]])[0]
            rate = state.world_from_base[:3, :3] @ turned / seconds
        tally[TURN_RATE].measure(_distance(message.angular_velocity, world_from_imu.T @ rate), at(raw))
        was, now = point_velocity(motion, rows, base_from_imu[:3, 3])
        force = world_from_imu.T @ ((now - was) / seconds + (0.0, 0.0, GRAVITY))
        tally[FORCE].measure(_distance(message.linear_acceleration, force), at(raw))


def _begin(config: ImuConfig, end_ns: int) -> int:
    """Stamp [ns] at which the interval begins that ends at a stamp: of the reading before, or of the step."""
    if config.sampling == "instant":
        return end_ns - STEP_NS
    number = round(end_ns * config.rate_hz / 1e9)
    return max(1, round(round((number - 1) * (1e9 / config.rate_hz)) / STEP_NS)) * STEP_NS


def _distance(vector: Any, true: Array) -> float:
    return float(np.linalg.norm(np.array([vector.x, vector.y, vector.z]) - true))


CHECKS: Final = KindChecks(
    make=lambda shared: [Imu(shared.context), ImuNoise(shared.context)], motion=(IMU,), signal=(IMU_NOISE,)
)
