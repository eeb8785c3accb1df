# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Motion along given poses: closed forms of the IMU, and its integral, which is the path."""

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation
from series import imu_along

from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.errors import TrackError
from fieldtruth.core.transforms import rotation_from_quaternion_wxyz, wxyz_from_xyzw, xyzw_from_wxyz
from fieldtruth.drive.track import Motion, Track
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.rig import Rig, paper_rig
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.imu.sensing import ImuReadings
from fieldtruth.simulation.motion import motion_along, track_along

GRAVITY = 9.81
IN_MIDDLE = paper_rig(imu=ImuConfig(rate_hz=1000.0, mount=Mount(xyz=(0.0, 0.0, 0.0))))
ON_MAST = paper_rig(imu=ImuConfig(rate_hz=1000.0, mount=Mount(xyz=(0.3, -0.1, 0.5), rpy_deg=(10.0, -70.0, 150.0))))


def stamps_of(times: ArrayLike) -> Counts:
    return np.rint(np.asarray(times) * 1e9).astype(np.int64)


def moved(times: Array, position: Array, rotation: Rotation, rig: Rig = IN_MIDDLE) -> Track:
    motion = motion_along(stamps_of(times), position, wxyz_from_xyzw(rotation.as_quat()), 0)
    return track_along(motion, rig)


def felt(times: Array, position: Array, rotation: Rotation, rig: Rig = IN_MIDDLE) -> ImuReadings:
    return imu_along(moved(times, position, rotation, rig), rig)


def test_on_a_circle_the_imu_feels_the_centripetal_acceleration() -> None:
    radius, turn = 4.0, 0.8
    times = np.arange(0.0, 10.01, 0.05)
    angle, zero = turn * times, np.zeros_like(times)
    circle = radius * np.column_stack([np.sin(angle), 1.0 - np.cos(angle), zero])  # to the left, heading along it
    imu = felt(times, circle, Rotation.from_rotvec(np.column_stack([zero, zero, angle])))
    inner = slice(500, -500)  # at its ends a spline knows one side only
    # The step's velocity is that of its middle, half a millisecond before the stamp.
    expected = (radius * turn**2 * turn * 1e-3, radius * turn**2, GRAVITY)
    np.testing.assert_allclose(imu.linear_acceleration[inner], np.tile(expected, (9000, 1)), atol=2e-3)
    np.testing.assert_allclose(imu.angular_velocity[inner], np.tile((0.0, 0.0, turn), (9000, 1)), atol=1e-9)


def test_in_free_fall_the_accelerometer_reads_nothing() -> None:
    times = np.linspace(0.0, 2.0, 21)
    fall = np.column_stack([3.0 * times, np.zeros_like(times), 40.0 - GRAVITY / 2 * times**2])
    imu = felt(times, fall, Rotation.from_euler("xyz", np.tile((20.0, 5.0, 80.0), (21, 1)), degrees=True))
    np.testing.assert_allclose(imu.linear_acceleration, 0.0, atol=1e-7)
    np.testing.assert_allclose(imu.angular_velocity, 0.0, atol=1e-12)


def test_at_rest_with_any_attitude_it_reads_gravity_upwards() -> None:
    attitude = Rotation.from_euler("xyz", (30.0, -50.0, 200.0), degrees=True)
    times = np.array([0.0, 0.4, 1.0])
    imu = felt(times, np.tile((1.0, 2.0, 3.0), (3, 1)), Rotation.concatenate([attitude] * 3), ON_MAST)
    base_from_imu = Rotation.from_matrix(ON_MAST.imu.mount.base_from_sensor[:3, :3])
    expected = (attitude * base_from_imu).inv().apply((0.0, 0.0, GRAVITY))
    np.testing.assert_allclose(imu.linear_acceleration, np.tile(expected, (1000, 1)), atol=1e-9)


def test_a_lever_arm_is_pulled_outwards_by_the_turn() -> None:
    times, turn = np.arange(0.0, 3.01, 0.1), 2.0
    axis = np.array([0.0, 0.0, 1.0])
    spin = Rotation.from_rotvec(turn * times[:, None] * axis)
    rig = paper_rig(imu=ImuConfig(rate_hz=1000.0, mount=Mount(xyz=(0.5, 0.0, 0.0))))
    imu = felt(times, np.zeros((len(times), 3)), spin, rig)
    np.testing.assert_allclose(imu.linear_acceleration[1:, 0], -0.5 * turn**2, atol=1e-4)
    np.testing.assert_allclose(imu.linear_acceleration[1:, 2], GRAVITY, atol=1e-9)


@pytest.fixture(scope="module")
def flight() -> tuple[Counts, Array, Array]:
    """A tumbling flight with uneven stamps of 7 to 60 ms: stamps [ns], positions and quaternions wxyz."""
    rng = np.random.default_rng(5)
    times = np.round(np.cumsum(rng.uniform(0.007, 0.06, 300)), 3)
    stamps = stamps_of(times)
    position = np.column_stack([5 * np.sin(0.7 * times), 3 * np.cos(0.9 * times), 4 + np.sin(1.3 * times)])
    angles = np.column_stack([0.9 * np.sin(times), 0.7 * np.cos(1.1 * times), 1.5 * times])
    return stamps, position, wxyz_from_xyzw(Rotation.from_euler("xyz", angles).as_quat())


def test_the_imu_integrates_to_path_and_attitude(flight: tuple[Counts, Array, Array]) -> None:
    stamps, position, quaternion = flight
    motion = motion_along(stamps, position, quaternion, int(stamps[0]))
    imu, mount = imu_along(track_along(motion, ON_MAST), ON_MAST), ON_MAST.imu.mount.base_from_sensor
    world_from_imu = rotation_from_quaternion_wxyz(motion.quaternion_wxyz) @ mount[:3, :3]
    path = motion.position + rotation_from_quaternion_wxyz(motion.quaternion_wxyz) @ mount[:3, 3]
    attitude, place = Rotation.from_matrix(world_from_imu[1]), path[1]
    velocity = motion.linear_velocity[1] + np.cross(motion.angular_velocity[1], path[1] - motion.position[1])
    for k in range(2, len(path)):
        attitude = attitude * Rotation.from_rotvec(imu.angular_velocity[k] * 1e-3)
        velocity = velocity + (attitude.apply(imu.linear_acceleration[k]) - (0.0, 0.0, GRAVITY)) * 1e-3
        place = place + velocity * 1e-3
    # The lever arm's velocity is that of its stamp, the path's that of the step: 0.5 ms of a turning arm apart.
    assert np.linalg.norm(place - path[-1]) < 5e-3
    assert (attitude.inv() * Rotation.from_matrix(world_from_imu[-1])).magnitude() < 1e-9
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).sum() > 30.0


def test_the_middle_integrates_exactly(flight: tuple[Counts, Array, Array]) -> None:
    stamps, position, quaternion = flight
    motion = motion_along(stamps, position, quaternion, int(stamps[0]))
    imu = imu_along(track_along(motion, IN_MIDDLE), IN_MIDDLE)
    world = np.einsum("nij,nj->ni", rotation_from_quaternion_wxyz(motion.quaternion_wxyz), imu.linear_acceleration)
    velocity = motion.linear_velocity[1] + np.cumsum((world - (0.0, 0.0, GRAVITY))[2:], axis=0) * 1e-3
    np.testing.assert_allclose(motion.position[1] + np.cumsum(velocity, axis=0) * 1e-3, motion.position[2:], atol=1e-8)


def test_it_passes_through_the_poses_and_between_them_smoothly(flight: tuple[Counts, Array, Array]) -> None:
    stamps, position, quaternion = flight
    motion = motion_along(stamps, position, quaternion, int(stamps[0]))
    rows = (stamps[1:] - stamps[0]) // 1_000_000 - 1
    np.testing.assert_array_equal(motion.position[rows], position[1:])
    turn = np.abs(np.einsum("ni,ni->n", motion.quaternion_wxyz[rows], quaternion[1:]))
    np.testing.assert_allclose(turn, 1.0, atol=1e-15)
    jerks = np.linalg.norm(np.diff(motion.linear_velocity, 2, axis=0), axis=1) / 1e-6
    assert jerks.max() < 500.0  # [m/s^3]; a kink of 1 cm/s would be 10,000
    assert (np.einsum("ni,ni->n", motion.quaternion_wxyz[1:], motion.quaternion_wxyz[:-1]) > 0.99).all()


def test_the_sign_of_a_quaternion_does_not_matter(flight: tuple[Counts, Array, Array]) -> None:
    stamps, position, quaternion = flight
    signs = np.where(np.random.default_rng(1).random(len(stamps)) < 0.5, -1.0, 1.0)[:, None]
    one, other = (motion_along(stamps, position, q, int(stamps[0])) for q in (quaternion, signs * quaternion))
    np.testing.assert_allclose(other.angular_velocity, one.angular_velocity, atol=1e-9)


def test_start_and_end_cut_the_same_motion(flight: tuple[Counts, Array, Array]) -> None:
    stamps, position, quaternion = flight
    start = int(stamps[0])
    whole = motion_along(stamps, position, quaternion, start)
    part = motion_along(stamps, position, quaternion, start + 2_000_000_000, seconds=1.5)
    assert (len(part.stamps_ns), int(part.stamps_ns[0]), int(part.stamps_ns[-1])) == (1500, 1_000_000, 1_500_000_000)
    np.testing.assert_allclose(part.position, whole.position[2000:3500], atol=1e-12)
    np.testing.assert_allclose(part.linear_velocity, whole.linear_velocity[2000:3500], atol=1e-8)


def test_a_start_outside_the_poses_is_an_error(flight: tuple[Counts, Array, Array]) -> None:
    stamps, position, quaternion = flight
    for start in (int(stamps[0]) - 2_000_000, int(stamps[-1])):
        with pytest.raises(TrackError, match=r"drive\.start_s must be between, got -?\d+\.\d+ s"):
            motion_along(stamps, position, quaternion, start)


def test_a_track_of_the_physics_gives_its_own_motion_and_imu(winding_track: Track) -> None:
    drive = winding_track.motion
    motion = motion_along(drive.stamps_ns, drive.position, drive.quaternion_wxyz, 0)
    assert_equal_motion(motion, drive)
    imu = imu_along(track_along(motion, Rig()))
    # The first reading begins with the first state, whose velocity no pose states.
    np.testing.assert_allclose(imu.linear_acceleration[1:], imu_along(winding_track).linear_acceleration[1:], atol=1e-7)
    np.testing.assert_allclose(imu.angular_velocity, imu_along(winding_track).angular_velocity, atol=1e-9)


def test_behind_the_last_pose_the_sweep_goes_on_and_poses_of_the_file_come_first(
    flight: tuple[Counts, Array, Array],
) -> None:
    stamps, position, quaternion = flight
    start, part = int(stamps[0]), 1.5
    longer = motion_along(stamps, position, quaternion, start, part, sweep=100)
    whole = motion_along(stamps, position, quaternion, start, sweep=100)
    np.testing.assert_array_equal(longer.position, whole.position[:1600])
    last = whole.first(len(whole.stamps_ns) - 100)
    np.testing.assert_array_equal(last.position, motion_along(stamps, position, quaternion, start).position)
    np.testing.assert_allclose(whole.linear_velocity[-100:], np.tile(last.linear_velocity[-1], (100, 1)), atol=1e-9)
    np.testing.assert_allclose(whole.angular_velocity[-100:], np.tile(last.angular_velocity[-1], (100, 1)), atol=1e-9)
    assert np.linalg.norm(last.linear_velocity[-1]) > 1.0


def assert_equal_motion(motion: Motion, drive: Motion) -> None:
    np.testing.assert_array_equal(motion.stamps_ns, drive.stamps_ns)
    np.testing.assert_array_equal(motion.position, drive.position)
    np.testing.assert_array_equal(motion.quaternion_wxyz, drive.quaternion_wxyz)
    # The first step has no step before it here.
    np.testing.assert_allclose(motion.linear_velocity[1:], drive.linear_velocity[1:], atol=1e-10)
    np.testing.assert_allclose(motion.angular_velocity[1:], drive.angular_velocity[1:], atol=1e-10)
    assert xyzw_from_wxyz(motion.quaternion_wxyz).shape == (len(drive.stamps_ns), 4)
