# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tyres on the ground against closed forms: planes do not shake, a wave moves the wheels as it moves a disc."""

import numpy as np
import pytest
from drive_worlds import F8, HeightFunction, make_robot, make_world, tilted
from scipy.signal import welch

from fieldtruth.core.transforms import rotation_from_quaternion_wxyz
from fieldtruth.drive.physics import Command
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import WHEELS

RADIUS = 0.1651
MOUNTS = np.array([Rig().mounts()[f"{name}_wheel"].xyz for name in WHEELS])


@pytest.mark.parametrize("tilt", [(0.0, 0.0), (10.0, 0.0), (-6.0, 8.0)])
@pytest.mark.parametrize(("speed", "turn_rate"), [(0.0, 0.0), (0.3, 0.3), (0.8, 0.8)])
def test_driving_on_a_plane_does_not_shake(tilt: tuple[float, float], speed: float, turn_rate: float) -> None:
    robot = make_robot(make_world(tilted(*tilt), spacing=0.1), (-4.0, 0.0), yaw_deg=20.0)
    robot.advance(Command(speed, turn_rate), 2000)
    velocity = robot.advance(Command(speed, turn_rate), 1000)[:, 7:10]
    slope_x, slope_y = np.tan(np.deg2rad(tilt))
    normal = np.array([-slope_x, -slope_y, 1.0]) / np.sqrt(1 + slope_x**2 + slope_y**2)
    assert np.std(np.diff(velocity @ normal) / 0.001) < 1e-3


def wave(x: F8, y: F8) -> F8:
    return np.asarray(0.01 * np.sin(2 * np.pi * x) + 0.0 * y)


@pytest.mark.parametrize("spacing", [0.1, 0.05])
def test_wheels_follow_the_envelope_of_a_disc_over_a_wave(spacing: float) -> None:
    """Amplitude 1 cm, length 1 m: the centre of a disc that rolls on it is its radius away along the normal."""
    states = make_robot(make_world(wave, spacing=spacing), (-3.0, 0.0)).advance(Command(0.3, 0.0), 5000)[1000:]
    hubs = states[:, None, :3] + np.einsum("nij,kj->nki", rotation_from_quaternion_wxyz(states[:, 3:7]), MOUNTS)
    ground = np.linspace(-6, 6, 100_001)
    slope = 0.02 * np.pi * np.cos(2 * np.pi * ground)
    normal = 1 / np.sqrt(1 + slope**2)
    expected = np.interp(hubs[..., 0], ground - RADIUS * slope * normal, wave(ground, ground) + RADIUS * normal)
    assert np.ptp(expected) > 0.019
    np.testing.assert_allclose(hubs[..., 2], expected, atol=1e-4)


def rough(amplitude: float) -> HeightFunction:
    """Waves of 0.1 to 2 m in all directions, each higher the longer it is: waviness 3 of ISO 8608."""
    rng = np.random.default_rng(0)
    length = np.geomspace(0.1, 2.0, 60)
    direction, phase = rng.uniform(0, 2 * np.pi, (2, 60))

    def height(x: F8, y: F8) -> F8:
        along = x[..., None] * np.cos(direction) + y[..., None] * np.sin(direction)
        return np.asarray((length * np.sin(2 * np.pi / length * along + phase)).sum(axis=-1) * amplitude)

    return height


@pytest.mark.parametrize("amplitude", [0.0003, 0.002])
def test_rough_ground_shakes_below_25_hz(amplitude: float) -> None:
    """At 0.3 m/s waves of 0.1 m are met at 3 Hz, and the robot sways on its tyres at 9 to 19 Hz.

    A rigid contact has half of its power above 25 Hz: it jumps where the ground is more curved than a wheel.
    """
    world = make_world(rough(amplitude), size=(12.0, 4.0), spacing=0.05)
    velocity = make_robot(world, (-3.0, 0.0)).advance(Command(0.3, 0.0), 10_000)[500:, 9]
    frequency, power = welch(np.diff(velocity) / 0.001, fs=1000.0, nperseg=1024)
    assert power[frequency > 25].sum() < 0.02 * power.sum()
