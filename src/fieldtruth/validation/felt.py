# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What IMU, GNSS receiver and tachometers read, against the true motion and the mounts.

Readings of IMU and receiver are free of noise and follow from the true motion by formulas, so what is left is rounding:
1e-13 m/s^2 (a velocity's last digit over a millisecond), and 1e-9 m for a latitude (the last digit of 49.9 deg).
Wheels slip: on rough ground single readings were seen to be 0.12 m/s and 0.18 rad/s off the robot's motion, over drives
of 268 and 515 s; twice as much is allowed. Over a drive the wheels roll its length, with 1 % of slip.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth import frames, geodesy
from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import RawMessage
from fieldtruth.drive.physics import GRAVITY
from fieldtruth.drive.state import State
from fieldtruth.validation.check import Check
from fieldtruth.validation.law import check_of
from fieldtruth.validation.subject import STEP_NS, Examiner, Subject, place_of

F8 = NDArray[np.float64]

ATTITUDE_BOUND: Final = 1e-9  # [rad]
TURN_RATE_BOUND: Final = 1e-9  # [rad/s]
ACCELERATION_BOUND: Final = 1e-6  # [m/s^2]
POSITION_BOUND: Final = 1e-6  # [m]
SLIP_BOUND: Final = 0.25  # [m/s]
SKID_BOUND: Final = 0.4  # [rad/s]
ROLL_BOUND: Final = 0.05
"""Share of the driven length by which the wheels may roll farther or less far."""
ROLL_LENGTH: Final = 2.0
"""[m] below which starting and turning say too much of the wheels' way."""


class Imu(Examiner):
    """Attitude, turn rate and specific force in imu_link (REP-145)."""

    topics = (table.IMU,)

    def __init__(self, subject: Subject) -> None:
        self._subject = subject
        self._base_from_imu = subject.rig.imu.mount.base_from_sensor
        self._attitude = subject.law(
            "the IMU's attitude is the true pose's, turned by its mount", ATTITUDE_BOUND, "rad"
        )
        self._rate = subject.law("the gyroscope reads the true turn rate", TURN_RATE_BOUND, "rad/s")
        self._force = subject.law("the accelerometer reads the change of velocity, and g", ACCELERATION_BOUND, "m/s^2")
        self._exact = subject.law("covariances are zero", minor=True)

    def feed(self, raw: RawMessage, message: Any) -> None:
        """See a message."""
        covariances = (
            message.orientation_covariance, message.angular_velocity_covariance, message.linear_acceleration_covariance
        )  # fmt: skip
        self._exact.see(not any(each.any() for each in covariances), lambda: place_of(raw))
        # The first step of all has none before it: its reading is that of the step after it.
        ready = raw.stamp_ns + STEP_NS if raw.stamp_ns <= STEP_NS else raw.stamp_ns
        self._subject.motion.when_known(ready, lambda: self._judge(raw, message))

    def results(self) -> list[Check]:
        """IMU."""
        return [
            check_of(
                "imu",
                [self._attitude, self._rate, self._force, self._exact],
                f"{self._attitude.seen:,} readings follow from the true motion: {self._attitude.margin}, "
                f"{self._rate.margin}, {self._force.margin}",
                f"no {table.IMU}, or no true motion",
            )
        ]

    def _judge(self, raw: RawMessage, message: Any) -> None:
        motion, state = self._subject.motion, self._subject.motion.state(raw.stamp_ns)
        q = message.orientation
        told = np.array([q.w, q.x, q.y, q.z])
        if not abs(np.linalg.norm(told) - 1.0) < 1e-6:
            self._attitude.measure(np.nan, lambda: f"{place_of(raw)}: no unit quaternion")
            return
        world_from_imu = frames.rotation_from_quaternion_wxyz(state.quaternion_wxyz) @ self._base_from_imu[:3, :3]
        imu_from_told = world_from_imu.T @ frames.rotation_from_quaternion_wxyz(told)
        # A small turn differs from none by its angle, in the matrix' outer parts; its trace would lose half the digits.
        self._attitude.measure(float(np.abs(imu_from_told - np.eye(3)).max()), lambda: place_of(raw))
        self._rate.measure(
            _distance(message.angular_velocity, world_from_imu.T @ state.angular_velocity), lambda: place_of(raw)
        )
        rows = motion.row(raw.stamp_ns), motion.row(raw.stamp_ns - STEP_NS)
        if raw.stamp_ns == STEP_NS:
            rows = motion.row(2 * STEP_NS), motion.row(STEP_NS)
        if rows[0] is None or rows[1] is None:
            return
        now, before = (self._velocity(row) for row in rows if row is not None)
        force = (now - before) / (STEP_NS / 1e9) + (0.0, 0.0, GRAVITY)
        self._force.measure(_distance(message.linear_acceleration, world_from_imu.T @ force), lambda: place_of(raw))

    def _velocity(self, row: int) -> F8:
        """Velocity [m/s] of the IMU's place in the world."""
        m = self._subject.motion.motion
        lever = frames.rotation_from_quaternion_wxyz(m.quaternion_wxyz[row]) @ self._base_from_imu[:3, 3]
        velocity: F8 = m.linear_velocity[row] + np.cross(m.angular_velocity[row], lever)
        return velocity


class Gnss(Examiner):
    """The receiver's antenna is where the robot carries it."""

    topics = (table.NAVSAT,)

    def __init__(self, subject: Subject) -> None:
        self._subject = subject
        self._antenna = np.array(subject.rig.gnss.mount.xyz)
        self._place = subject.law("the fix is the antenna's true place", POSITION_BOUND, "m")
        self._fix = subject.law("each reading is a fix, its covariance unknown", minor=True)

    def feed(self, raw: RawMessage, message: Any) -> None:
        """See a message."""
        status, covariance = message.status, message.position_covariance
        told = (status.status, status.service, message.position_covariance_type, bool(covariance.any()))
        self._fix.see(told == (0, 1, 0, False), lambda: f"{place_of(raw)}: status, service and covariance {told}")
        fix = np.array([message.latitude, message.longitude, message.altitude])
        self._subject.motion.when_known(raw.stamp_ns, lambda: self._judge(raw, fix))

    def results(self) -> list[Check]:
        """GNSS."""
        return [
            check_of(
                "gnss",
                [self._place, self._fix],
                f"{self._place.seen:,} fixes lie at the antenna: {self._place.margin}",
                f"no {table.NAVSAT}, or no true motion",
            )
        ]

    def _judge(self, raw: RawMessage, fix: F8) -> None:
        state = self._subject.motion.state(raw.stamp_ns)
        antenna = frames.transform(state.world_from_base, self._antenna[None])[0]
        place = geodesy.world_from_geodetic(fix) if np.isfinite(fix).all() and abs(fix[0]) <= 90.0 else fix * np.nan
        self._place.measure(float(np.linalg.norm(place - antenna)), lambda: place_of(raw))


class Wheels(Examiner):
    """Tachometers against the robot's motion: loosely, as wheels slip and skid."""

    def __init__(self, subject: Subject) -> None:
        self.topics = [name for name in table.WHEEL_SPEEDS if name in subject.run.counts]
        self._subject = subject
        self._wheels = subject.rig.wheels
        self._slip = subject.law(
            "a side's wheels roll alike, and all of them as fast as the robot goes", SLIP_BOUND, "m/s"
        )
        self._skid = subject.law("the sides' difference turns the robot", SKID_BOUND, "rad/s")
        self._whole = subject.law("the wheels roll the length of the way", ROLL_BOUND, "of it")
        self._speeds: dict[int, dict[str, float]] = {}
        self._rolled = self._went = 0.0
        self._last: int | None = None

    def feed(self, raw: RawMessage, message: Any) -> None:
        """See a message."""
        met = self._speeds.setdefault(raw.stamp_ns, {})
        met[raw.topic] = float(message.data)
        if len(met) == len(table.WHEEL_SPEEDS):
            speeds = np.array([met[name] for name in table.WHEEL_SPEEDS])
            del self._speeds[raw.stamp_ns]
            self._subject.motion.when_known(raw.stamp_ns, lambda: self._judge(raw, speeds))
        elif len(self._speeds) > 100:
            self._speeds.pop(next(iter(self._speeds)))

    def results(self) -> list[Check]:
        """Wheels."""
        if self._went > ROLL_LENGTH:
            self._whole.measure(
                self._rolled / self._went - 1.0, f"{self._rolled:.2f} m rolled, {self._went:.2f} m went"
            )
        rolled = f"; they roll {self._rolled:.2f} m on a way of {self._went:.2f} m" if self._went > ROLL_LENGTH else ""
        return [
            check_of(
                "wheels",
                [self._slip, self._skid, self._whole],
                f"{self._slip.seen:,} readings of four wheels: {self._slip.margin}, {self._skid.margin}{rolled}",
                "no tachometers of all four wheels, or no true motion",
            )
        ]

    def _judge(self, raw: RawMessage, speeds: F8) -> None:
        state: State = self._subject.motion.state(raw.stamp_ns)
        wheels = self._wheels
        base_from_world = frames.rotation_from_quaternion_wxyz(state.quaternion_wxyz).T
        ahead = float((base_from_world @ state.linear_velocity)[0])
        turn = float((base_from_world @ state.angular_velocity)[2])
        front_left, front_right, rear_left, rear_right = speeds * wheels.radius
        left, right = (front_left + rear_left) / 2, (front_right + rear_right) / 2
        # Why a skid-steered robot turns slower than its wheels say: see drive/husky.py.
        skid = 1.0 + (wheels.half_wheelbase / wheels.half_track) ** 2
        apart = max(abs(front_left - rear_left), abs(front_right - rear_right))
        self._slip.measure(max(apart, abs(ahead - (left + right) / 2)), lambda: place_of(raw))
        self._skid.measure(turn - (right - left) / (2 * wheels.half_track * skid), lambda: place_of(raw))
        seconds = 0.0 if self._last is None else (raw.stamp_ns - self._last) / 1e9
        self._rolled += seconds * (left + right) / 2
        self._went += seconds * ahead
        self._last = raw.stamp_ns


def _distance(vector: Any, true: F8) -> float:
    return float(np.linalg.norm(np.array([vector.x, vector.y, vector.z]) - true))
