# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The figures with which drives are compared, for motions whose figures follow from a formula."""

import numpy as np
import pytest
from drive_figures import Drive, attitude_difference, cross_track, peak

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.robot_config import WheelConfig

WHEELS = WheelConfig()
SPEED = 0.3


def straight(*, aside: float = 0.0, rpy_deg: tuple[float, float, float] = (0.0, 0.0, 0.0), slip: float = 0.0) -> Drive:
    """Ten seconds along the robot's x axis, from a point ``aside`` metres to the left of the world's x axis."""
    count = 10_000
    pose = transforms.pose((0.0, aside, 0.0), rpy_deg)
    ahead = pose[:3, 0] * SPEED
    return Drive(
        position=pose[:3, 3] + np.arange(1, count + 1)[:, None] / 1000.0 * ahead,
        quaternion_wxyz=np.tile(transforms.quaternion_wxyz_from_rotation(pose[:3, :3]), (count, 1)),
        velocity=np.tile(ahead, (count, 1)),
        angular_velocity=np.zeros((count, 3)),
        wheel_speed=np.full((count // 100, 4), SPEED / WHEELS.radius / (1.0 - slip)),
    )


def test_length_time_and_slip_of_a_straight_drive() -> None:
    whole = straight(slip=0.25, rpy_deg=(0.0, 0.0, 30.0))
    np.testing.assert_allclose(whole.slip(WHEELS), 0.25)
    begin = whole.first(1.5)
    assert abs(begin.metres - 1.5) < 0.031
    assert begin.seconds == len(begin.wheel_speed) / 10 == pytest.approx(5.0, abs=0.11)


def test_a_turning_robot_that_rolls_without_slip_has_none() -> None:
    drive = straight()
    turn = 0.5
    sides = np.array([-1.0, 1.0, -1.0, 1.0]) * WHEELS.half_track * turn
    turning = Drive(
        position=drive.position,
        quaternion_wxyz=drive.quaternion_wxyz,
        velocity=drive.velocity,
        angular_velocity=np.tile([0.0, 0.0, turn], (len(drive.position), 1)),
        wheel_speed=np.tile((SPEED + sides) / WHEELS.radius, (len(drive.wheel_speed), 1)),
    )
    np.testing.assert_allclose(turning.slip(WHEELS), 0.0, atol=1e-12)


def test_roll_and_pitch_and_their_difference() -> None:
    tilted = straight(rpy_deg=(4.0, -6.0, 100.0))
    np.testing.assert_allclose(tilted.roll_pitch, [[4.0, -6.0]] * 10_000, atol=1e-9)
    level = straight(rpy_deg=(0.0, 0.0, 100.0))
    np.testing.assert_allclose(attitude_difference(tilted, level), [[4.0, -6.0]] * 100, atol=1e-9)


def test_a_path_to_the_left_has_a_positive_distance() -> None:
    np.testing.assert_allclose(cross_track(straight(aside=0.5), straight()), 0.5)
    np.testing.assert_allclose(cross_track(straight(aside=-0.5), straight()), -0.5)


def test_shaking_at_a_frequency_has_its_amplitude_and_peak() -> None:
    drive, hertz, amplitude = straight(), 3.125, 0.2
    t = np.arange(1, 10_001) / 1000.0
    velocity: Array = drive.velocity + np.outer(np.sin(2 * np.pi * hertz * t), [0.0, 0.0, 1.0]) * amplitude / (
        2 * np.pi * hertz
    )
    shaken = Drive(
        position=drive.position,
        quaternion_wxyz=drive.quaternion_wxyz,
        velocity=velocity,
        angular_velocity=drive.angular_velocity,
        wheel_speed=drive.wheel_speed,
    ).vertical_acceleration
    assert np.sqrt((shaken**2).mean()) == pytest.approx(amplitude / np.sqrt(2), rel=0.02)
    assert peak(shaken) == pytest.approx(hertz, abs=0.2)
