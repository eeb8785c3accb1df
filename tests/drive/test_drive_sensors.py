# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""IMU, GNSS and tachometers against closed forms and against the true motion."""

import numpy as np
import pytest
from drive_worlds import make_experiment, make_world, tilted
from scipy.spatial.transform import Rotation
from series import fixes_along, imu_along, tachometers_along

from fieldtruth.core.arrays import Array
from fieldtruth.core.geodesy import world_from_geodetic
from fieldtruth.core.transforms import rotation_from_quaternion_wxyz, wxyz_from_xyzw
from fieldtruth.drive.simulate import drive
from fieldtruth.drive.track import STEP_NS, Motion, Track, WheelMotion, steps_at_rate
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.rig import Rig, paper_rig
from fieldtruth.sensors.gnss.config import GnssConfig
from fieldtruth.sensors.gnss.sensing import read_gnss
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.imu.sensing import point_velocity, read_imu
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig
from fieldtruth.sensors.wheel_odometry.sensing import WheelTruth


def made_motion(position: Array, rotation: Rotation, velocity: Array, turn_rate: Array) -> Motion:
    return Motion(
        stamps_ns=np.arange(1, len(position) + 1, dtype=np.int64) * STEP_NS,
        position=position,
        quaternion_wxyz=wxyz_from_xyzw(rotation.as_quat()),
        linear_velocity=velocity,
        angular_velocity=turn_rate,
    )


def circling(radius: float, turn_rate: float, count: int = 2000) -> Motion:
    """Motion on a level circle to the left, heading along the path."""
    angle = turn_rate * np.arange(1, count + 1) * 1e-3
    still = np.zeros(count)
    return made_motion(
        np.column_stack([radius * np.sin(angle), radius * (1 - np.cos(angle)), still]),
        Rotation.from_rotvec(np.column_stack([still, still, angle])),
        radius * turn_rate * np.column_stack([np.cos(angle), np.sin(angle), still]),
        np.column_stack([still, still, np.full(count, turn_rate)]),
    )


def test_imu_axes_follow_the_mount() -> None:
    # Pitch -90 then yaw 180: x up, y to the right, z forwards.
    readings = read_imu(circling(2.0, 0.5), ImuConfig(sampling="instant"))
    np.testing.assert_allclose(readings.angular_velocity, np.tile((0.5, 0.0, 0.0), (100, 1)), atol=1e-12)
    # Towards the centre: 2.0 m x (0.5 rad/s)^2 to the left; the lever arm of 0.19 m pulls backwards.
    expected = np.tile((9.81, -0.5, -0.19 * 0.25), (100, 1))
    np.testing.assert_allclose(readings.linear_acceleration[1:], expected[1:], atol=3e-4)


def test_imu_at_rest_measures_gravity_upwards_in_the_world() -> None:
    attitude = Rotation.from_euler("xyz", (10.0, -20.0, 130.0), degrees=True)
    still = np.zeros((40, 3))
    readings = read_imu(made_motion(still, Rotation.concatenate([attitude] * 40), still, still), ImuConfig())
    world_from_imu = rotation_from_quaternion_wxyz(readings.quaternion_wxyz)
    world = np.einsum("nij,nj->ni", world_from_imu, readings.linear_acceleration)
    np.testing.assert_allclose(world, np.tile((0.0, 0.0, 9.81), (2, 1)), atol=1e-12)


def test_stamps_are_those_of_the_physics_steps() -> None:
    motion = circling(2.0, 0.5, 1000)
    np.testing.assert_array_equal(read_imu(motion, ImuConfig()).stamps_ns, np.arange(1, 51) * 20_000_000)
    readings = read_imu(motion, ImuConfig(rate_hz=3.0))
    np.testing.assert_array_equal(readings.stamps_ns, (333_000_000, 667_000_000, 1_000_000_000))
    yaw = 0.5 * readings.stamps_ns / 1e9
    base = (
        Rotation.from_quat(np.roll(readings.quaternion_wxyz, -1, axis=1))
        * Rotation.from_matrix(ImuConfig().mount.base_from_sensor[:3, :3]).inv()
    )
    np.testing.assert_allclose(base.as_euler("xyz")[:, 2], yaw, atol=1e-12)


@pytest.mark.parametrize("rate", [2.0, 50.0, 3.0, 30.0, 7.7, 999.0, 1000.0])
def test_each_physics_step_is_read_at_most_once(rate: float) -> None:
    steps = steps_at_rate(rate, 10 * 10**9)
    assert np.all(np.diff(steps) > 0)
    assert steps[0] >= 1
    assert len(steps) == int(10 * rate)


def test_drive_shorter_than_a_period_has_no_readings() -> None:
    motion = circling(2.0, 0.5, 10)
    assert read_imu(motion, ImuConfig()).quaternion_wxyz.shape == (0, 4)
    assert read_gnss(motion, GnssConfig()).geodetic.shape == (0, 3)
    still = WheelMotion(angle=np.zeros((10, 4)), speed=np.zeros((10, 4)))
    true = WheelTruth(WheelOdometryConfig(), Rig().wheels).extend(motion.stamps_ns, still)
    assert true.tachometers.wheel_speed.shape == (0, 4)


def test_gnss_position_is_the_antenna_within_a_millimetre(winding_track: Track) -> None:
    motion, gnss = winding_track.motion, fixes_along(winding_track)
    rows = gnss.stamps_ns // STEP_NS - 1
    lever = rotation_from_quaternion_wxyz(motion.quaternion_wxyz[rows]) @ np.array((0.10, 0.0, 0.890))
    np.testing.assert_allclose(world_from_geodetic(gnss.geodetic), motion.position[rows] + lever, atol=1e-3)


def test_imu_attitude_and_mount_give_the_attitude_of_base_link(winding_track: Track) -> None:
    motion, imu = winding_track.motion, imu_along(winding_track)
    rows = imu.stamps_ns // STEP_NS - 1
    base_from_imu = Mount(xyz=(0, 0, 0), rpy_deg=(0, -90, 180)).base_from_sensor[:3, :3]
    world_from_base = rotation_from_quaternion_wxyz(imu.quaternion_wxyz) @ base_from_imu.T
    np.testing.assert_allclose(world_from_base, rotation_from_quaternion_wxyz(motion.quaternion_wxyz[rows]), atol=1e-12)


def test_gyro_integrates_to_the_attitude(winding_track: Track) -> None:
    imu = imu_along(winding_track)
    seconds = np.diff(imu.stamps_ns) / 1e9
    turns = Rotation.from_rotvec((imu.angular_velocity[:-1] + imu.angular_velocity[1:]) / 2 * seconds[:, None])
    attitude = Rotation.from_quat(np.roll(imu.quaternion_wxyz, -1, axis=1))
    estimate = attitude[0]
    for turn in turns:
        estimate = estimate * turn
    assert np.rad2deg((estimate.inv() * attitude[-1]).magnitude()) < 0.2


def test_accelerometer_integrates_to_the_velocity() -> None:
    rig = paper_rig(imu=ImuConfig(rate_hz=1000.0))
    track = drive(make_world(tilted(3.0, 2.0)), make_experiment([(3.0, 4.0)], seconds=3.0, rig=rig))
    imu, motion = imu_along(track, rig), track.motion
    world_from_imu = rotation_from_quaternion_wxyz(imu.quaternion_wxyz)
    acceleration = np.einsum("nij,nj->ni", world_from_imu, imu.linear_acceleration) - (0.0, 0.0, 9.81)
    velocity = point_velocity(motion, np.arange(3000), np.array((0.19, 0.0, 0.149)))
    integral = np.cumsum(acceleration[1:], axis=0) * 1e-3
    np.testing.assert_allclose(integral, velocity[1:] - velocity[0], atol=1e-9)
    assert np.linalg.norm(velocity[-1]) > 0.25


def test_wheel_speeds_integrate_to_the_driven_length() -> None:
    track = drive(make_world(tilted(4.0, 0.0)), make_experiment([(9.0, 0.0)]))
    tachometers = tachometers_along(track)
    seconds = np.diff(tachometers.stamps_ns, prepend=0) / 1e9
    by_wheels = (tachometers.wheel_speed * seconds[:, None]).sum(axis=0) * 0.1651
    np.testing.assert_allclose(by_wheels, track.length_m, rtol=0.01)
    assert track.length_m > 6.5
