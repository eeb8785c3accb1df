# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of IMU, GNSS and tachometers as pure functions of the true motion, without noise.

A reading is the state at the physics step nearest to the sensor's due time, and carries that step's own stamp; for
rates that divide 1000 Hz the two are equal. The IMU reads means over the interval that ends at the stamp, as
``ImuReadings`` states: their sums are attitude and velocity, and a short drive equals the start of a long one. Means of
the rotating body's angular velocity and specific force would miss coning and sculling (Savage, Strapdown Inertial
Navigation Integration Algorithm Design, Journal of Guidance, Control, and Dynamics 21, 1998); the rotation vector and
the change of velocity of the interval contain both.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.frames import quaternion_wxyz_from_rotation, rotation_from_quaternion_wxyz, xyzw_from_wxyz
from fieldtruth.core.geodesy import geodetic_from_world
from fieldtruth.drive.physics import GRAVITY, STEP_NS, STEP_S
from fieldtruth.drive.track import GnssReadings, ImuReadings, Motion, TachometerReadings, stamps_at_rate
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.gnss_config import GnssConfig
from fieldtruth.experiment.imu_config import ImuConfig
from fieldtruth.experiment.rig import Rig


def steps_at_rate(rate_hz: float, duration_ns: int) -> Counts:
    """Physics steps (n,), counted from 1, at which a sensor of ``rate_hz`` reads, ``duration_ns`` included."""
    return np.rint(stamps_at_rate(rate_hz, duration_ns) / STEP_NS).astype(np.int64)


def due_step(rate_hz: float, number: int) -> int:
    """Return the physics step of the reading with this number, from 1, as ``steps_at_rate`` has it."""
    return round(round(number * (1e9 / rate_hz)) / STEP_NS)


def sweep_steps(rig: Rig) -> int:
    """Physics steps from a stamp until the last rays of its scan or photograph leave.

    It is 0 unless a LiDAR spins or a camera has a signal with a shutter.
    """
    late_ns = [1e9 / each.rate_hz for each in rig.lidars if each.spinning]
    late_ns += [1e9 * each.signal.late_s for each in rig.cameras if each.signal is not None]
    return math.ceil(max(late_ns, default=0.0) / STEP_NS)


def read_imu(motion: Motion, config: ImuConfig) -> ImuReadings:
    """Return attitude, mean angular velocity and mean specific force in imu_link (REP-145), lever arm included."""
    rows = steps_at_rate(config.rate_hz, int(motion.stamps_ns[-1])) - 1
    starts, ends = imu_intervals(rows, len(motion.stamps_ns), config)
    base_from_imu = config.mount.base_from_sensor
    attitude, ended = motion.quaternion_wxyz[rows], motion.quaternion_wxyz[ends]
    world_from_imu = rotation_from_quaternion_wxyz(attitude) @ base_from_imu[:3, :3]
    seconds = np.maximum(ends - starts, 1)[:, None] * STEP_S
    velocity, velocity_before = (point_velocity(motion, k, base_from_imu[:3, 3]) for k in (ends, starts))
    specific_force = (velocity - velocity_before) / seconds + (0.0, 0.0, GRAVITY)
    return ImuReadings(
        stamps_ns=motion.stamps_ns[rows],
        quaternion_wxyz=quaternion_wxyz_from_rotation(world_from_imu).reshape(-1, 4),
        angular_velocity=rotation_vector(motion.quaternion_wxyz[starts], ended) / seconds @ base_from_imu[:3, :3],
        linear_acceleration=_into_frame(world_from_imu, specific_force),
    )


def imu_intervals(rows: Counts, count: int, config: ImuConfig) -> tuple[Counts, Counts]:
    """First and last row of the motion of the intervals (n,) over which the readings at ``rows`` (n,) are means.

    The motion has ``count`` rows and none at time 0, so that the first reading begins at the first row. A reading at
    the first row itself has the interval of the next one; the robot starts at rest.
    """
    ends = np.clip(rows, 1, count - 1)
    before = np.concatenate([[0], rows])[:-1] if config.sampling == "mean" else rows - 1
    return np.clip(before, 0, np.maximum(ends - 1, 0)), ends


def rotation_vector(before_wxyz: Array, after_wxyz: Array) -> Array:
    """Rotation vectors (n, 3) [rad], in the turning frame, between attitudes (n, 4)."""
    before, after = (Rotation.from_quat(xyzw_from_wxyz(q)) for q in (before_wxyz, after_wxyz))
    vectors: Array = (before.inv() * after).as_rotvec()
    return vectors


def read_gnss(motion: Motion, config: GnssConfig) -> GnssReadings:
    """Return the geodetic position of the antenna."""
    rows = steps_at_rate(config.rate_hz, int(motion.stamps_ns[-1])) - 1
    geodetic = antenna_geodetic(motion.position[rows], motion.quaternion_wxyz[rows], config.mount)
    return GnssReadings(stamps_ns=motion.stamps_ns[rows], geodetic=geodetic)


def read_imus(motion: Motion, rig: Rig) -> dict[str, ImuReadings]:
    """Return the readings of every IMU by its name."""
    return {config.name: read_imu(motion, config) for config in rig.imus}


def read_fixes(motion: Motion, rig: Rig) -> dict[str, GnssReadings]:
    """Return the readings of every GNSS receiver by its name."""
    return {config.name: read_gnss(motion, config) for config in rig.antennas}


def read_tachometers(motion: Motion, wheel_speed: Array, rate_hz: float) -> TachometerReadings:
    """Return the readings of ``wheel_speed`` (n, 4) [rad/s], given at every physics step."""
    rows = steps_at_rate(rate_hz, int(motion.stamps_ns[-1])) - 1
    return TachometerReadings(stamps_ns=motion.stamps_ns[rows], wheel_speed=wheel_speed[rows])


def antenna_geodetic(position: Array, quaternion_wxyz: Array, mount: Mount) -> Array:
    """Latitude [deg], longitude [deg], height [m] (n, 3) of the antenna for poses of base_link (n, 3) and (n, 4)."""
    lever = rotation_from_quaternion_wxyz(quaternion_wxyz) @ np.array(mount.xyz)
    return geodetic_from_world(position + lever)


def heading(quaternion_wxyz: Array) -> float:
    """Heading [rad] of base_link (the IMU's attitude, turned by its mount): 0 north, positive towards west."""
    w, x, y, z = quaternion_wxyz
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def point_velocity(motion: Motion, rows: NDArray[np.int64], lever_base: Array) -> Array:
    """World velocity (n, 3) [m/s] at ``rows`` of the point ``lever_base`` (3,) [m] that is fixed in base_link."""
    lever = rotation_from_quaternion_wxyz(motion.quaternion_wxyz[rows]) @ lever_base
    velocity: Array = motion.linear_velocity[rows] + np.cross(motion.angular_velocity[rows], lever)
    return velocity


def _into_frame(world_from_frame: Array, vectors_world: Array) -> Array:
    vectors: Array = np.einsum("nji,nj->ni", world_from_frame, vectors_world)
    return vectors
