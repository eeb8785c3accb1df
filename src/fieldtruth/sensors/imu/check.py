# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of IMUs, compared with the true motion and the mounts.

They have no noise and follow from the true motion by formulas, so that the residual is rounding: 1e-13 m/s^2, the last
digit of a velocity, over a millisecond. Means are compared where the motion of their interval is kept, which is four
seconds.
"""

from typing import Any, Final

import numpy as np

from fieldtruth.bag.reader import RawMessage
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.robot_config import GRAVITY
from fieldtruth.sensors.imu.check_noise import IMU_NOISE, ImuNoise
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.imu.sensing import point_velocity, rotation_vector
from fieldtruth.validation.check import Rule, Spec
from fieldtruth.validation.context import STEP_NS, Checker, Context, at
from fieldtruth.validation.kind_checks import KindChecks

ATTITUDE: Final = Rule("the IMU's attitude is the true one, turned by its mount", 1e-9, "rad")
TURN_RATE: Final = Rule("the gyroscope measures the turn of its interval", 1e-9, "rad/s")
FORCE: Final = Rule("the accelerometer measures the change of velocity, and gravity", 1e-6, "m/s^2")
IMU_EXACT: Final = Rule("covariances of the IMU are zero", minor=True)
_NO_IMU: Final = "no IMU, or no true motion"
IMU: Final[Spec] = Spec("imu", (ATTITUDE, TURN_RATE, FORCE, IMU_EXACT), "readings", _NO_IMU)


class Imu(Checker):
    """Attitude, turn rate and specific force of every IMU in its frame (REP-145)."""

    def __init__(self, context: Context) -> None:
        self._motion, self._tally = context.motion, context.tally(IMU)
        self.tallies = [self._tally]
        self._configs = {config.true_topic(config.topic): config for config in context.rig.imus}
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
            tally[ATTITUDE].measure(np.nan, f"{at(raw)}: not a unit quaternion")
            return
        world_from_imu = transforms.rotation_from_quaternion_wxyz(state.quaternion_wxyz) @ base_from_imu[:3, :3]
        turn = world_from_imu.T @ transforms.rotation_from_quaternion_wxyz(measured)
        # The off-diagonal elements are the small angle; the trace would lose half of the digits.
        tally[ATTITUDE].measure(float(np.abs(turn - np.eye(3)).max()), at(raw))
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
