# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A user's simplest strapdown integration of IMU readings, compared with the true motion."""

import numpy as np
import pytest
from imu_integration import errors
from scipy.spatial.transform import Rotation

from fieldtruth.core.transforms import wxyz_from_xyzw
from fieldtruth.drive.track import Motion, Track
from fieldtruth.experiment.fields import Mount
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.imu.sensing import read_imu
from fieldtruth.simulation.motion import motion_along

UPRIGHT = Mount(xyz=(0.0, 0.0, 0.0))


@pytest.mark.parametrize("rate", [10.0, 50.0, 333.0, 1000.0])
def test_mean_readings_integrate_to_the_pose(winding_track: Track, rate: float) -> None:
    attitude, velocity, position = errors(winding_track.motion, ImuConfig(rate_hz=rate))
    assert attitude < 1e-8
    assert velocity < 1e-9
    assert position < 0.05


def test_instant_readings_do_not(winding_track: Track) -> None:
    attitude, velocity, _ = errors(winding_track.motion, ImuConfig(sampling="instant"))
    assert attitude > 0.01
    assert velocity > 0.01


def coning(seconds: float, frequency: float, angle: float) -> Motion:
    """A body whose z axis moves on a cone of half-angle ``angle`` [rad], ``frequency`` [Hz] times a second."""
    times = np.arange(0.0, seconds, 1e-3)
    phase = 2 * np.pi * frequency * times
    tilt = Rotation.from_rotvec(angle * np.column_stack([np.cos(phase), np.sin(phase), np.zeros_like(phase)]))
    stamps, still = np.rint(times * 1e9).astype(np.int64), np.zeros((len(times), 3))
    return motion_along(stamps, still, wxyz_from_xyzw(tilt.as_quat()), 0)


def test_mean_readings_contain_coning() -> None:
    frequency, angle, seconds, dt = 20.0, 0.02, 10.0, 0.02
    motion = coning(seconds, frequency, angle)
    assert errors(motion, ImuConfig())[0] < 1e-8
    # Averages of the turning body's rate lack the part that Savage (1998) calls coning; its closed form:
    phase = 2 * np.pi * frequency * dt
    missing = np.pi * frequency * angle**2 * (1 - np.sin(phase) / phase)
    rates = read_imu(motion, ImuConfig(rate_hz=1000.0, mount=UPRIGHT)).angular_velocity[10:9990]
    averages = Rotation.from_rotvec(rates.reshape(-1, 20, 3).mean(axis=1) * dt)
    estimate, after = Rotation.from_quat(np.roll(motion.quaternion_wxyz[[9, 9989]], -1, axis=1))
    for turn in averages:
        estimate = estimate * turn
    assert (estimate.inv() * after).magnitude() == pytest.approx(missing * 9.98, rel=0.02)
