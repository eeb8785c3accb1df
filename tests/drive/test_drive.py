# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Whole drives: path, duration, rates, and reproducibility."""

import numpy as np
import pytest
from drive_worlds import hills, make_experiment, make_world
from series import fixes_along, imu_along, odometry_along, tachometers_along

from fieldtruth.drive.simulate import drive
from fieldtruth.drive.track import Track, due_step, steps_at_rate
from fieldtruth.experiment.config import ControlConfig
from fieldtruth.experiment.rig import paper_rig
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.world.model import World


def arrays(track: Track) -> dict[str, bytes]:
    assert track.base is not None
    base = track.base
    parts = (
        track.motion,
        imu_along(track),
        fixes_along(track),
        base.wheels,
        tachometers_along(track),
        odometry_along(track),
        base.commands,
    )
    found = {f"{type(p).__name__}.{name}": a for p in parts for name, a in vars(p).items()}
    return {name: a.tobytes() for name, a in found.items() if isinstance(a, np.ndarray)}


def test_straight_drive_ends_at_the_arrival_distance(flat_world: World) -> None:
    track = drive(flat_world, make_experiment([(7.0, 0.0), (10.0, 0.0)]))
    # The antenna, 0.1 m ahead, comes within 2 m of the last waypoint at x = 7.9; fixes come every 0.15 m.
    end = track.motion.position[-1]
    assert 7.9 - 0.01 < end[0] < 7.9 + 0.15 + 0.03
    assert abs(end[1]) < 0.01
    assert track.length_m == pytest.approx(end[0], abs=0.01)
    # 0.5 s at rest; ramping up and down cost half of 0.1 s each.
    assert track.duration_s == pytest.approx(end[0] / 0.3 + 0.5 - 0.1 + 0.1, abs=0.1)
    np.testing.assert_allclose(track.motion.linear_velocity[-1], 0.0, atol=1e-3)
    np.testing.assert_allclose(track.motion.linear_velocity[5000:20000, 0], 0.3, atol=0.01)


def test_mean_speed_is_the_commanded_one_on_a_winding_route(winding_track: Track) -> None:
    assert winding_track.length_m > 12.0
    moving = winding_track.duration_s - 0.5
    assert winding_track.length_m / moving == pytest.approx(0.3, rel=0.01)


def test_each_waypoint_is_passed_within_the_arrival_distance(winding_track: Track) -> None:
    xy = winding_track.motion.position[:, :2]
    for waypoint in [(5.0, 2.0), (9.0, -3.0), (5.0, -7.0), (0.0, -4.0)]:
        nearest = np.linalg.norm(xy - waypoint, axis=1).min()
        assert nearest < 2.1


def test_robot_is_at_rest_at_the_start() -> None:
    motion = drive(make_world(hills), make_experiment([(3.0, 4.0)], start=(-2.0, 1.0), seconds=0.01)).motion
    assert len(motion.stamps_ns) == 10
    np.testing.assert_array_equal(motion.stamps_ns, np.arange(1, 11) * 1_000_000)
    np.testing.assert_allclose(motion.position[0, :2], (-2.0, 1.0), atol=0.01)
    assert np.linalg.norm(motion.linear_velocity[0]) < 0.01
    w, _, _, z = motion.quaternion_wxyz[0]
    assert 2 * np.arctan2(z, w) == pytest.approx(np.arctan2(3.0, 5.0), abs=0.02)


def test_each_sensor_reads_at_its_rate_up_to_and_including_the_end(flat_world: World) -> None:
    track = drive(flat_world, make_experiment([(9.0, 0.0)], seconds=3.0))
    assert track.duration_s == 3.0
    assert len(track.motion.stamps_ns) == 3000
    imu, gnss, tachometers, odometry = (
        read(track) for read in (imu_along, fixes_along, tachometers_along, odometry_along)
    )
    assert track.base is not None
    commands = track.base.commands
    assert (len(imu.stamps_ns), len(gnss.stamps_ns), len(tachometers.stamps_ns)) == (150, 6, 30)
    assert len(odometry.stamps_ns) == len(commands.stamps_ns) == 150
    parts = (track.motion, imu, gnss, tachometers, odometry, commands)
    ends = {int(s.stamps_ns[-1]) for s in parts}
    assert ends == {3_000_000_000}


@pytest.mark.parametrize("rate", [0.7, 2.0, 3.0, 50.0, 60.0, 333.0, 1000.0])
def test_follower_runs_at_the_steps_of_the_sensors(rate: float) -> None:
    steps = steps_at_rate(rate, 20 * 10**9).tolist()
    assert [due_step(rate, number) for number in range(1, len(steps) + 1)] == steps


def test_seconds_limit_the_duration(flat_world: World) -> None:
    assert drive(flat_world, make_experiment([(9.0, 0.0)], seconds=0.001)).duration_s == 0.001
    whole = drive(flat_world, make_experiment([(4.0, 0.0)]))
    longer = drive(flat_world, make_experiment([(4.0, 0.0)], seconds=60.0))
    assert arrays(longer) == arrays(whole)


def test_drive_is_reproducible_and_a_short_drive_is_a_prefix_of_a_long_one() -> None:
    route = [(3.0, 4.0), (8.0, 0.0)]
    long = drive(make_world(hills), make_experiment(route, seconds=6.0))
    again = drive(make_world(hills), make_experiment(route, seconds=6.0))
    short = drive(make_world(hills), make_experiment(route, seconds=2.5))
    assert arrays(long) == arrays(again)
    expected = arrays(long)
    for name, content in arrays(short).items():
        assert expected[name].startswith(content), name


def test_the_last_scan_of_a_spinning_lidar_is_swept_along_the_drive(flat_world: World) -> None:
    route, rig = [(9.0, 0.0)], paper_rig(lidar=LidarConfig(spinning=True, rate_hz=8.0))
    long = drive(flat_world, make_experiment(route, seconds=4.0, rig=rig))
    short = drive(flat_world, make_experiment(route, seconds=2.0, rig=rig))
    plain = drive(flat_world, make_experiment(route, seconds=2.0))
    assert arrays(short) == arrays(plain)
    assert len(plain.swept.stamps_ns) == len(short.motion.stamps_ns) == 2000
    assert short.swept.stamps_ns[-1] == 2_125_000_000
    np.testing.assert_array_equal(short.swept.position, long.motion.position[:2125])
    assert short.swept.position[-1, 0] - short.motion.position[-1, 0] == pytest.approx(0.3 * 0.125, rel=0.01)
    arrived = drive(flat_world, make_experiment([(4.0, 0.0)], rig=rig))
    assert arrived.duration_s == drive(flat_world, make_experiment([(4.0, 0.0)])).duration_s
    assert len(arrived.swept.stamps_ns) == len(arrived.motion.stamps_ns) + 125


def test_progress_is_called_every_second(flat_world: World) -> None:
    reported: list[float] = []
    drive(flat_world, make_experiment([(9.0, 0.0)], seconds=3.5), progress=reported.append)
    assert reported == [1.0, 2.0, 3.0]


def test_robot_turns_around_for_a_waypoint_behind_it(flat_world: World) -> None:
    control = ControlConfig(heading_gain=2.0)
    track = drive(flat_world, make_experiment([(5.0, 0.0), (-5.0, 0.3)], control=control))
    assert track.motion.position[-1, 0] < -2.0
