# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""IMUs, GNSS receivers and tachometers, compared with the true motion and the mounts.

IMU and GNSS readings have no noise and follow from the true motion by formulas, so that the residual is rounding: 1e-13
m/s^2 (last digit of a velocity, over a millisecond) and 1e-9 m (last digit of a latitude of 49.9 deg). The IMU's means
are compared where the motion of their interval is kept, which is four seconds. Wheels slip: up to 0.12 m/s and 0.18
rad/s were measured on rough ground over drives of 268 and 515 s, and twice as much is tolerated.
"""

from typing import Any, Final

import numpy as np

from fieldtruth.bag.reader import RawMessage
from fieldtruth.core import frames, geodesy
from fieldtruth.core.arrays import Array
from fieldtruth.drive import sensors
from fieldtruth.drive.physics import GRAVITY
from fieldtruth.experiment.imu_config import ImuConfig
from fieldtruth.experiment.odometry_config import WHEEL_SPEEDS
from fieldtruth.validation.check import Rule, Spec
from fieldtruth.validation.context import STEP_NS, Checker, Context, at

ATTITUDE: Final = Rule("the IMU's attitude is the true one, turned by its mount", 1e-9, "rad")
TURN_RATE: Final = Rule("the gyroscope measures the turn of its interval", 1e-9, "rad/s")
FORCE: Final = Rule("the accelerometer measures the change of velocity, and gravity", 1e-6, "m/s^2")
IMU_EXACT: Final = Rule("covariances of the IMU are zero", minor=True)
_NO_IMU: Final = "no IMU, or no true motion"
IMU: Final[Spec] = Spec("imu", (ATTITUDE, TURN_RATE, FORCE, IMU_EXACT), "readings", _NO_IMU)

ANTENNA: Final = Rule("the fix is the true position of the antenna", 1e-6, "m")
FIX: Final = Rule("each reading is a fix without covariance", minor=True)
GNSS: Final[Spec] = Spec("gnss", (ANTENNA, FIX), "fixes", "no GNSS receiver, or no true motion")

SLIP: Final = Rule("both wheels of a side roll alike, and all as fast as the robot drives", 0.25, "m/s")
SKID: Final = Rule("the difference of the sides turns the robot", 0.4, "rad/s")
ROLLED: Final = Rule("wheels roll the length of the path and their slip, if it is over 2 m", 0.5, "of the length")
_NO_WHEELS: Final = "no tachometers of all four wheels, or no true motion"
WHEELS: Final[Spec] = Spec("wheels", (SLIP, SKID, ROLLED), "readings of four wheels", _NO_WHEELS)
_ROLLED_FROM: Final = 2.0
"""Shortest path [m] that is compared; in shorter ones, starting and turning have too large a share."""


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
        world_from_imu = frames.rotation_from_quaternion_wxyz(state.quaternion_wxyz) @ base_from_imu[:3, :3]
        turn = world_from_imu.T @ frames.rotation_from_quaternion_wxyz(measured)
        # The off-diagonal elements are the small angle; the trace would lose half of the digits.
        tally[ATTITUDE].measure(float(np.abs(turn - np.eye(3)).max()), at(raw))
        motion, end = self._motion.motion, max(raw.stamp_ns, 2 * STEP_NS)
        row, before = self._motion.row(end), self._motion.row(_begin(config, end))
        if row is None or before is None:
            return
        seconds, rows = (motion.stamps_ns[row] - motion.stamps_ns[before]) / 1e9, np.array([before, row])
        rate = motion.angular_velocity[row]
        if config.sampling == "mean":
            turned = sensors.rotation_vector(motion.quaternion_wxyz[rows[:1]], motion.quaternion_wxyz[rows[1:]])[0]
            rate = state.world_from_base[:3, :3] @ turned / seconds
        tally[TURN_RATE].measure(_distance(message.angular_velocity, world_from_imu.T @ rate), at(raw))
        was, now = sensors.point_velocity(motion, rows, base_from_imu[:3, 3])
        force = world_from_imu.T @ ((now - was) / seconds + (0.0, 0.0, GRAVITY))
        tally[FORCE].measure(_distance(message.linear_acceleration, force), at(raw))


def _begin(config: ImuConfig, end_ns: int) -> int:
    """Stamp [ns] at which the interval begins that ends at a stamp: of the reading before, or of the step."""
    if config.sampling == "instant":
        return end_ns - STEP_NS
    number = round(end_ns * config.rate_hz / 1e9)
    return max(1, round(round((number - 1) * (1e9 / config.rate_hz)) / STEP_NS)) * STEP_NS


class Gnss(Checker):
    """Fixes of every receiver against the true position of its antenna."""

    def __init__(self, context: Context) -> None:
        self._motion, self._tally = context.motion, context.tally(GNSS)
        self.tallies = [self._tally]
        antennas = context.rig.antennas
        self._antennas = {config.true_topic(config.topic): np.array([config.mount.xyz]) for config in antennas}
        self.topics = tuple(self._antennas)

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        status, covariance = message.status, message.position_covariance
        found = (status.status, status.service, message.position_covariance_type, bool(covariance.any()))
        self._tally[FIX].see(found == (0, 1, 0, False), f"{at(raw)}: status, service and covariance {found}")
        fix = np.array([message.latitude, message.longitude, message.altitude])
        self._motion.when_known(raw.stamp_ns, lambda: self._compare(raw, fix))

    def _compare(self, raw: RawMessage, fix: Array) -> None:
        antenna = frames.transform(self._motion.state(raw.stamp_ns).world_from_base, self._antennas[raw.topic])[0]
        valid = np.isfinite(fix).all() and abs(fix[0]) <= 90.0
        position = geodesy.world_from_geodetic(fix) if valid else fix * np.nan
        self._tally[ANTENNA].measure(float(np.linalg.norm(position - antenna)), at(raw))


class Wheels(Checker):
    """Tachometers against the true motion, with wide tolerances, as wheels slip and skid."""

    def __init__(self, context: Context) -> None:
        config = context.rig.wheel_odometry
        names = WHEEL_SPEEDS if config is None else map(config.true_topic, WHEEL_SPEEDS)
        self.topics = [name for name in names if name in context.run.counts]
        self._motion, self._tally, self._wheels = context.motion, context.tally(WHEELS), context.rig.wheels
        self.tallies = [self._tally]
        self._speeds: dict[int, dict[str, float]] = {}
        self._rolled = self._driven = 0.0
        self._last: int | None = None

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        met = self._speeds.setdefault(raw.stamp_ns, {})
        met[raw.topic] = float(message.data)
        if len(met) == len(self.topics):
            speeds = np.array([met[name] for name in self.topics])
            del self._speeds[raw.stamp_ns]
            self._motion.when_known(raw.stamp_ns, lambda: self._compare(raw, speeds))
        elif len(self._speeds) > 100:
            self._speeds.pop(next(iter(self._speeds)))

    def finish(self) -> None:
        """Finish the checks after the last message."""
        self._tally.note = f"{self._rolled:.2f} m rolled, {self._driven:.2f} m driven"
        if self._driven > _ROLLED_FROM:
            self._tally[ROLLED].measure(self._rolled / self._driven - 1.0, self._tally.note)

    def _compare(self, raw: RawMessage, speeds: Array) -> None:
        state, wheels = self._motion.state(raw.stamp_ns), self._wheels
        base_from_world = frames.rotation_from_quaternion_wxyz(state.quaternion_wxyz).T
        ahead = float((base_from_world @ state.linear_velocity)[0])
        turn = float((base_from_world @ state.angular_velocity)[2])
        sides = [speeds[side::2] * wheels.radius for side in (0, 1)]
        left, right = (float(side.mean()) for side in sides)
        # A skid-steered robot turns more slowly than its wheels suggest: see drive/robot.py.
        skid = 1.0 + (wheels.half_wheelbase / wheels.half_track) ** 2
        apart = max(float(np.ptp(side)) for side in sides)
        self._tally[SLIP].measure(max(apart, abs(ahead - (left + right) / 2)), at(raw))
        self._tally[SKID].measure(turn - (right - left) / (2 * wheels.half_track * skid), at(raw))
        seconds = 0.0 if self._last is None else (raw.stamp_ns - self._last) / 1e9
        self._rolled += seconds * (left + right) / 2
        self._driven += seconds * ahead
        self._last = raw.stamp_ns


def _distance(vector: Any, true: Array) -> float:
    return float(np.linalg.norm(np.array([vector.x, vector.y, vector.z]) - true))
