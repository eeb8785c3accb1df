# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A user's simplest strapdown integration of IMU readings, compared with the true motion."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fieldtruth.core.arrays import Array
from fieldtruth.core.transforms import rotation_from_quaternion_wxyz, wxyz_from_xyzw
from fieldtruth.drive.plan import plan_route
from fieldtruth.drive.simulate import drive
from fieldtruth.drive.track import Motion, Track
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.files import load_experiment, with_overrides
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.imu.sensing import ImuReadings, point_velocity, read_imu
from fieldtruth.simulation.motion import motion_along
from fieldtruth.world.build import world_of

UPRIGHT = Mount(xyz=(0.0, 0.0, 0.0))
GRAVITY = np.array([0.0, 0.0, 9.81])


def true_state(motion: Motion, stamp_ns: int, config: ImuConfig) -> tuple[Array, Array, Array]:
    """Attitude (3, 3), velocity (3,) [m/s] and position (3,) [m] of the IMU, as a user gets them from odometry."""
    row, base_from_imu = int(np.searchsorted(motion.stamps_ns, stamp_ns)), config.mount.base_from_sensor
    world_from_base = rotation_from_quaternion_wxyz(motion.quaternion_wxyz[row])
    velocity = point_velocity(motion, np.array([row]), base_from_imu[:3, 3])[0]
    return (
        world_from_base @ base_from_imu[:3, :3],
        velocity,
        motion.position[row] + world_from_base @ base_from_imu[:3, 3],
    )


def integrated(imu: ImuReadings, attitude: Array, velocity: Array, position: Array) -> tuple[Array, Array, Array]:
    """State at the last reading, from that at the first one."""
    seconds = np.diff(imu.stamps_ns) / 1e9
    turns = Rotation.from_rotvec(imu.angular_velocity[1:] * seconds[:, None]).as_matrix()
    for dt, turn, force in zip(seconds, turns, imu.linear_acceleration[1:], strict=True):
        attitude = attitude @ turn
        velocity = velocity + (attitude @ force - GRAVITY) * dt
        position = position + velocity * dt
    return attitude, velocity, position


def errors(motion: Motion, config: ImuConfig) -> tuple[float, float, float]:
    """Errors of attitude [deg], velocity [m/s] and position [m] at the last reading, integrated from the first one."""
    imu = read_imu(motion, config)
    first, last = int(imu.stamps_ns[0]), int(imu.stamps_ns[-1])
    attitude, velocity, position = integrated(imu, *true_state(motion, first, config))
    true_attitude, true_velocity, true_position = true_state(motion, last, config)
    angle = Rotation.from_matrix(attitude.T @ true_attitude).magnitude()
    moved, offset = np.linalg.norm(velocity - true_velocity), np.linalg.norm(position - true_position)
    return float(np.rad2deg(angle)), float(moved), float(offset)


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


@pytest.mark.slow
@pytest.mark.parametrize("name", ["park_1", "lake_1", "forest_1", "hillside_1"])
def test_a_minute_of_each_environment_integrates_to_the_pose(name: str) -> None:
    experiment = with_overrides(load_experiment(name), seconds=60.0)
    world = world_of(experiment)
    motion = drive(world, experiment.model_copy(update={"route": plan_route(world, experiment)})).motion
    attitude, _, position = errors(motion, ImuConfig())
    assert attitude < 0.01
    assert position < 0.05
