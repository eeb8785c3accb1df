# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Wheel odometry against closed forms, and against drives on level ground."""

import numpy as np
import pytest
from drive_worlds import make_experiment, make_world, tilted
from series import odometry_along

from fieldtruth.core.arrays import Array
from fieldtruth.core.transforms import rotation_from_quaternion_wxyz, yaw_from_rotation
from fieldtruth.drive.simulate import drive
from fieldtruth.drive.track import Track, WheelMotion
from fieldtruth.experiment.rig import Rig
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig
from fieldtruth.sensors.wheel_odometry.sensing import WheelOdometry, WheelTruth, effective_track
from fieldtruth.world.model import World

RIG = Rig()
RADIUS = RIG.wheels.radius


def rolled(left: float, right: float, seconds: float, rate: float = 50.0) -> WheelOdometry:
    """Odometry of wheels that roll ``left`` and ``right`` [m/s] from time 0 on."""
    stamps = np.arange(1, round(seconds * 1000) + 1) * 1_000_000
    speed = np.tile(np.array([left, right, left, right]) / RADIUS, (len(stamps), 1))
    wheels = WheelMotion(angle=speed * stamps[:, None] / 1e9, speed=speed)
    return WheelTruth(WheelOdometryConfig(rate_hz=rate), Rig().wheels).extend(stamps, wheels).odometry


@pytest.mark.parametrize("rate", [1.0, 50.0, 1000.0])
def test_constant_wheel_speeds_make_a_circle_at_any_rate(rate: float) -> None:
    odometry = rolled(0.2, 0.4, 10.0, rate)
    turn_rate = 0.2 / effective_track(RIG.wheels)
    radius, angle = 0.3 / turn_rate, turn_rate * odometry.stamps_ns / 1e9
    circle = np.column_stack([radius * np.sin(angle), radius * (1 - np.cos(angle)), angle])
    np.testing.assert_allclose(odometry.pose, circle, atol=1e-12)
    np.testing.assert_allclose(odometry.twist, np.tile((0.3, turn_rate), (len(circle), 1)), atol=1e-12)


def test_turning_in_place_does_not_move() -> None:
    odometry = rolled(-0.3, 0.3, 5.0)
    np.testing.assert_allclose(odometry.pose[:, :2], 0.0, atol=1e-12)
    assert odometry.pose[-1, 2] == pytest.approx(0.6 / effective_track(RIG.wheels) * 5.0)
    # Longer than the distance between the wheels, 0.57 m, because wheels that skid must turn farther.
    assert 0.9 < effective_track(RIG.wheels) < 1.2


def ends(track: Track) -> tuple[Array, Array]:
    """Estimated and true x, y [m] and yaw [rad] at the end, in the frame of time 0."""
    motion = track.motion
    rotation = rotation_from_quaternion_wxyz(motion.quaternion_wxyz[[0, -1]])
    moved = rotation[0].T @ (motion.position[-1] - motion.position[0])
    yaw = np.unwrap(yaw_from_rotation(rotation_from_quaternion_wxyz(motion.quaternion_wxyz[::100])))
    return odometry_along(track).pose[-1], np.array([*moved[:2], yaw[-1] - yaw[0]])


def test_on_level_ground_the_end_of_a_winding_drive_is_found(flat_world: World) -> None:
    track = drive(flat_world, make_experiment([(3.0, 2.0), (6.0, -3.0)], seconds=20.0))
    estimate, true = ends(track)
    np.testing.assert_allclose(estimate[:2], true[:2], atol=0.05 * 6.0)
    assert abs(true[2]) > 0.3
    assert estimate[2] == pytest.approx(true[2], abs=0.1)


def test_uphill_it_overestimates_by_the_slip() -> None:
    track = drive(make_world(tilted(8.0, 0.0)), make_experiment([(9.0, 0.0)], seconds=15.0))
    estimate, true = ends(track)
    assert true[0] > 3.0
    assert 1.0 < estimate[0] / true[0] < 1.1
