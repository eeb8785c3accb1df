# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Figures of two drives over the same ground, side by side: ours and Gazebo's."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Reader
from scipy.signal import welch
from series import tachometers_along

from fieldtruth.bag.decode import stamp_ns
from fieldtruth.bag.messages import STORE
from fieldtruth.bag.topics import ODOMETRY
from fieldtruth.core.arrays import Array
from fieldtruth.core.transforms import pose_from_quaternion_wxyz, rotation_from_quaternion_wxyz
from fieldtruth.drive.track import Track
from fieldtruth.experiment.robot_config import WHEELS, WheelConfig

JOINTS = "/joint_states"
STEPS = 100
"""Physics steps of 1 ms between two readings of the tachometers, or joint states."""
WINDOW = 20
"""Steps over which an acceleration is the mean: the IMU's period. Single steps are full of the solver's noise."""


@dataclass(frozen=True, kw_only=True)
class Drive:
    """A drive at 1 kHz, row k after k + 1 steps, in the world frame; wheel speeds (m, 4) [rad/s] every 100 steps."""

    position: Array
    quaternion_wxyz: Array
    velocity: Array
    angular_velocity: Array
    wheel_speed: Array

    def first(self, metres: float) -> "Drive":
        """The beginning of the drive, up to a length [m] at 10 Hz."""
        steps = np.linalg.norm(np.diff(self.position[::STEPS], axis=0), axis=1).cumsum()
        marks = min(int(np.searchsorted(steps, metres)) + 1, len(steps), len(self.wheel_speed))
        rows = slice(0, marks * STEPS)
        return Drive(
            position=self.position[rows],
            quaternion_wxyz=self.quaternion_wxyz[rows],
            velocity=self.velocity[rows],
            angular_velocity=self.angular_velocity[rows],
            wheel_speed=self.wheel_speed[:marks],
        )

    @property
    def seconds(self) -> float:
        """Simulated time [s]."""
        return len(self.position) / 1000.0

    @property
    def metres(self) -> float:
        """Driven length [m] at 10 Hz."""
        return float(np.linalg.norm(np.diff(self.position[::STEPS], axis=0), axis=1).sum())

    def world_from_base(self, row: int) -> Array:
        """Pose (4, 4) of base_link."""
        return pose_from_quaternion_wxyz(self.position[row], self.quaternion_wxyz[row])

    @property
    def roll_pitch(self) -> Array:
        """Roll and pitch (n, 2) [deg]; the pitch is positive with the nose down."""
        rotation = rotation_from_quaternion_wxyz(self.quaternion_wxyz)
        return np.degrees([np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2]), -np.arcsin(rotation[:, 2, 0])]).T

    def slip(self, wheels: WheelConfig) -> Array:
        """Slip (m, 4) of each wheel: 1 - speed of its hub along the robot / (wheel speed x radius)."""
        rows = np.arange(1, len(self.wheel_speed) + 1) * STEPS - 1
        rotation = rotation_from_quaternion_wxyz(self.quaternion_wxyz[rows])
        forward = np.einsum("ni,ni->n", rotation[:, :, 0], self.velocity[rows])
        turn = np.einsum("ni,ni->n", rotation[:, :, 2], self.angular_velocity[rows])
        aside = np.array([1.0, -1.0, 1.0, -1.0]) * wheels.half_track
        rolled = self.wheel_speed * wheels.radius
        return np.asarray(1.0 - (forward[:, None] - turn[:, None] * aside) / np.where(rolled > 0.02, rolled, np.nan))

    @property
    def vertical_acceleration(self) -> Array:
        """Vertical acceleration (n,) [m/s^2] of base_link, means over 20 ms."""
        return np.diff(self.velocity[WINDOW - 1 :: WINDOW, 2]) / (WINDOW / 1000.0)


def drive_of_track(track: Track) -> Drive:
    """Our own drive."""
    motion = track.motion
    return Drive(
        position=motion.position,
        quaternion_wxyz=motion.quaternion_wxyz,
        velocity=motion.linear_velocity,
        angular_velocity=motion.angular_velocity,
        wheel_speed=tachometers_along(track).wheel_speed,
    )


def drive_of_bag(bag: Path) -> Drive:
    """A drive from a bag with the odometry of every step; as gazebo_ros has it, the twist is in the world frame."""
    poses: list[tuple[float, ...]] = []
    speeds: list[list[float]] = []
    with Reader(bag) as reader:
        wanted = [c for c in reader.connections if c.topic in (ODOMETRY, JOINTS)]
        for connection, _, data in reader.messages(wanted):
            message: Any = STORE.deserialize_ros1(data, connection.msgtype)
            milliseconds = stamp_ns(message.header) // 10**6
            if connection.topic == JOINTS:
                assert milliseconds == STEPS * (len(speeds) + 1), "joint states are missing"
                by_name = dict(zip(message.name, message.velocity.tolist(), strict=True))
                speeds.append([by_name[f"{wheel}_wheel_joint"] for wheel in WHEELS])
                continue
            assert milliseconds == len(poses) + 1, "odometry is missing"
            pose, twist = message.pose.pose, message.twist.twist
            p, q, v, w = pose.position, pose.orientation, twist.linear, twist.angular
            poses.append((p.x, p.y, p.z, q.w, q.x, q.y, q.z, v.x, v.y, v.z, w.x, w.y, w.z))
    position, quaternion, velocity, angular = np.split(np.array(poses), [3, 7, 10], axis=1)
    return Drive(
        position=position,
        quaternion_wxyz=quaternion,
        velocity=velocity,
        angular_velocity=angular,
        wheel_speed=np.array(speeds),
    )


def cross_track(drive: Drive, other: Drive) -> Array:
    """Horizontal distance (n,) [m] of a drive's positions at 10 Hz from the path of another, positive to its left."""
    corners, points = other.position[::STEPS, :2], drive.position[::STEPS, :2]
    start, along = corners[:-1], np.diff(corners, axis=0)
    squared = np.maximum((along**2).sum(axis=1), 1e-12)
    to_points = points[:, None] - start
    share = np.clip((to_points * along).sum(axis=2) / squared, 0.0, 1.0)
    offset = to_points - share[..., None] * along
    distance = np.linalg.norm(offset, axis=2)
    nearest = (np.arange(len(points)), distance.argmin(axis=1))
    side = along[nearest[1], 0] * to_points[*nearest, 1] - along[nearest[1], 1] * to_points[*nearest, 0]
    return np.asarray(np.copysign(distance[nearest], side))


def attitude_difference(drive: Drive, other: Drive) -> Array:
    """Difference (n, 2) [deg] in roll and pitch where the drives are at the nearest positions, at 10 Hz."""
    points, corners = drive.position[::STEPS, :2], other.position[::STEPS, :2]
    nearest = np.linalg.norm(points[:, None] - corners, axis=2).argmin(axis=1)
    return np.asarray(drive.roll_pitch[::STEPS] - other.roll_pitch[::STEPS][nearest])


def table(name: str, ours: Drive, theirs: Drive, wheels: WheelConfig) -> str:
    """Figures of both drives in columns."""
    rows: list[tuple[str, Sequence[float]]] = [
        ("simulated time [s]", [each.seconds for each in (ours, theirs)]),
        ("path [m]", [each.metres for each in (ours, theirs)]),
    ]
    for axis, label in enumerate(("roll", "pitch")):
        angles = [each.roll_pitch[:, axis] for each in (ours, theirs)]
        rows.append((f"{label} mean [deg]", [float(a.mean()) for a in angles]))
        rows.append((f"{label} deviation [deg]", [float(a.std()) for a in angles]))
    slips = [each.slip(wheels) for each in (ours, theirs)]
    rows.append(("slip mean [%]", [100.0 * float(np.nanmean(s)) for s in slips]))
    rows.append(("slip deviation [%]", [100.0 * float(np.nanstd(s)) for s in slips]))
    shaken = [each.vertical_acceleration for each in (ours, theirs)]
    rows.append(("vertical acceleration rms [m/s^2]", [float(np.sqrt((a**2).mean())) for a in shaken]))
    rows.append(("its spectrum's peak [Hz]", [peak(a) for a in shaken]))
    across, turned = cross_track(theirs, ours), attitude_difference(theirs, ours)
    lines = [f"{name:36}{'ours':>10}{'Gazebo':>10}", *(f"{label:36}{a:10.3f}{b:10.3f}" for label, (a, b) in rows)]
    lines.append(
        f"cross-track error of Gazebo's path [m]: mean {across.mean():+.3f}, largest {np.abs(across).max():.3f}"
    )
    roll, pitch = np.sqrt((turned**2).mean(axis=0))
    lines.append(f"difference at the same positions, rms [deg]: roll {roll:.3f}, pitch {pitch:.3f}")
    return "\n".join(lines)


def peak(acceleration: Array) -> float:
    """Frequency [Hz] with the largest power of a vertical acceleration at 50 Hz."""
    frequency, power = welch(acceleration, fs=1000.0 / WINDOW, nperseg=min(256, len(acceleration)))
    return float(frequency[power.argmax()])
