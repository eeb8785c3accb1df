# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Poses of frames: on free ground, evenly spread, at rest on the ground before they are tilted and raised."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from drive_worlds import hills, make_experiment, make_world, obstacle, tilted

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import FieldtruthWarning, RouteError
from fieldtruth.core.transforms import rotation_from_quaternion_wxyz
from fieldtruth.drive.standing import standing_robot, trail_headings
from fieldtruth.drive.track import Motion
from fieldtruth.drive.traversability import distance_to, obstacle_outlines
from fieldtruth.experiment.config import Experiment
from fieldtruth.world.model import Raster, World

HEIGHT = 0.13228  # of base_link on level ground
RADIUS = np.hypot(0.99, 0.67) / 2  # of the robot


def standing(world: World, **frames: Any) -> Motion:
    values = {"name": "test", "environment": "test", "frames": {"count": 400, **frames}}
    track = standing_robot(world, Experiment.model_validate(values))
    assert track.is_frames
    assert track.base is None
    return track.motion


def angles(motion: Motion) -> tuple[Array, Array, Array]:
    """Heading [rad], pitch down and roll [deg] of a robot on level ground."""
    x, y, _ = np.moveaxis(rotation_from_quaternion_wxyz(motion.quaternion_wxyz), 2, 0)
    pitch = np.arcsin(-x[:, 2])
    return np.arctan2(x[:, 1], x[:, 0]), np.degrees(pitch), np.degrees(np.arcsin(y[:, 2] / np.cos(pitch)))


def test_poses_are_free_even_and_within_their_limits() -> None:
    trunk = obstacle("trunk", "cylinder", (0.3, 2.0), 4.0, -3.0)
    motion = standing(make_world(obstacles=[trunk]))
    xy, z = motion.position[:, :2], motion.position[:, 2]
    assert np.linalg.norm(xy - (4.0, -3.0), axis=1).min() > RADIUS + 0.3
    assert (np.abs(xy) < np.array([20.0, 10.0]) - 1.4).all()
    counts, _, _ = np.histogram2d(xy[:, 0], xy[:, 1], bins=(8, 4), range=((-18.5, 18.5), (-8.5, 8.5)))
    free = counts[counts > 8]  # 12.5 in each; the trunk takes a fifth of one
    assert len(free) == 32
    assert free.std() < 2.0  # 3.5 if they were drawn one by one
    assert z.min() > HEIGHT - 1e-6
    assert z.max() < HEIGHT + 0.3 + 1e-6
    assert np.ptp(z) > 0.28
    heading, pitch, roll = angles(motion)
    assert abs(np.exp(1j * heading).mean()) < 0.15
    for angle, limit in ((pitch, 8.0), (roll, 4.0)):
        assert 0.95 * limit < np.abs(angle).max() < limit + 1e-6
        assert abs(angle.mean()) < 0.15 * limit
    np.testing.assert_array_equal(motion.stamps_ns, np.arange(1, 401) * 100_000_000)
    assert not motion.linear_velocity.any()


def test_no_pose_touches_a_pole_between_the_cells_of_the_map() -> None:
    """Poles of 1 cm, anywhere within their cells, so dense that much of the free ground is close to one."""
    rows = np.arange(-3.5, 3.6, 1.28)
    xy = np.stack(np.meshgrid(rows, rows), axis=-1).reshape(-1, 2)
    xy += np.random.default_rng(1).uniform(-0.05, 0.05, xy.shape)
    poles = [obstacle(f"pole_{k}", "cylinder", (0.005, 2.0), x, y) for k, (x, y) in enumerate(xy)]
    world = make_world(obstacles=poles, size=(10.0, 10.0))
    positions = standing(world, count=200).position[:, :2]
    assert min(distance_to(pole, positions).min() for pole in obstacle_outlines(world)) > RADIUS


def test_without_tilt_the_robot_rests_on_the_ground() -> None:
    slope = np.tan(np.radians(10.0))
    motion = standing(make_world(tilted(10.0, 0.0)), pitch_deg=0, roll_deg=0, raised_m=0)
    normal = np.array([-slope, 0.0, 1.0]) / np.hypot(slope, 1.0)
    np.testing.assert_allclose(motion.position @ normal, HEIGHT, atol=1e-5)
    up = rotation_from_quaternion_wxyz(motion.quaternion_wxyz)[:, :, 2]
    np.testing.assert_allclose(up, np.tile(normal, (400, 1)), atol=1e-5)


def test_fewer_frames_are_the_beginning_of_more_and_another_seed_gives_others(flat_world: World) -> None:
    many, few, other = standing(flat_world), standing(flat_world, count=7), standing(flat_world, count=7, seed=1)
    np.testing.assert_array_equal(many.position[:7], few.position)
    np.testing.assert_array_equal(many.quaternion_wxyz[:7], few.quaternion_wxyz)
    assert np.linalg.norm(few.position - other.position, axis=1).min() > 0.1


def test_with_a_route_they_are_beside_it(flat_world: World) -> None:
    experiment = make_experiment([(5.0, 0.0), (5.0, 6.0)], start=(-10.0, 0.0), frames={"count": 300, "aside_m": 1.5})
    x, y, _ = standing_robot(flat_world, experiment).motion.position.T
    beside_first = np.hypot(x - x.clip(-10.0, 5.0), y)
    beside_second = np.hypot(x - 5.0, y - y.clip(0.0, 6.0))
    assert np.minimum(beside_first, beside_second).max() < 1.5 + 1e-6
    assert (beside_first < 1.5).mean() == pytest.approx(15 / 21, abs=0.1)


def test_a_world_without_free_ground_is_refused() -> None:
    with pytest.raises(RouteError, match=r"^test \(seed 0\) has no free ground where the robot could stand$"):
        standing(make_world(tilted(30.0, 0.0)))


def test_poses_in_a_world_of_many_parts_are_those_in_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    world = make_world(hills, obstacles=[obstacle("trunk", "cylinder", (0.3, 2.0), 4.0, -3.0)])
    whole = standing(world, count=8)
    monkeypatch.setattr("fieldtruth.drive.ground.WHOLE", 15.0)
    in_parts = standing(world, count=8)
    np.testing.assert_allclose(in_parts.position, whole.position, rtol=0.0, atol=1e-6)  # heights have 32 bits


def with_trail(world: World, distance: Any) -> World:
    """World with a trail; ``distance`` [m] to its edge at x, y is below 0 on it."""
    x, y = np.linspace(-25, 25, 501), np.linspace(-15, 15, 301)
    values = distance(*np.meshgrid(x, y, indexing="ij")).astype(np.float32)
    raster = Raster(values=values, spacing=0.1, x0=-25.0, y0=-15.0)
    return replace(world, terrain=replace(world.terrain, trail_distance=raster))


def test_along_a_trail_the_robot_stands_on_it_and_looks_along_it_both_ways(flat_world: World) -> None:
    """A straight trail, 3 m wide, at an angle of 25 deg, with an edge that is ragged by 0.3 m."""
    turn = np.radians(25.0)

    def beside(x: Array, y: Array) -> Array:
        return np.asarray(-np.sin(turn) * x + np.cos(turn) * y)

    world = with_trail(flat_world, lambda x, y: np.abs(beside(x, y)) - 1.5 + 0.3 * np.sin(7.0 * x))
    motion = standing(world, along="trail", turn_deg=10)
    x, y, _ = motion.position.T
    assert np.abs(beside(x, y)).max() < 1.8
    assert np.ptp(np.cos(turn) * x + np.sin(turn) * y) > 25.0
    heading, _, _ = angles(motion)
    off = np.degrees((heading - turn + np.pi / 2) % np.pi - np.pi / 2)
    assert 9.0 < np.abs(off).max() < 14.0  # 10 and what the ragged edge does to the direction
    assert abs(off.mean()) < 2.0
    assert 0.4 < (np.cos(heading - turn) > 0).mean() < 0.6
    few = standing(world, along="trail", turn_deg=10, count=7)
    np.testing.assert_array_equal(motion.quaternion_wxyz[:7], few.quaternion_wxyz)


def test_the_direction_of_a_round_trail_is_its_tangent() -> None:
    x, y = np.linspace(-15, 15, 301), np.linspace(-15, 15, 301)
    rings = np.abs(np.hypot(*np.meshgrid(x, y, indexing="ij")) - 10.0) - 1.0
    raster = Raster(values=rings.astype(np.float32), spacing=0.1, x0=-15.0, y0=-15.0)
    for bearing in np.radians([0.0, 20.0, 45.0, 90.0, 130.0, 179.0, 250.0]):
        for radius in (9.4, 10.0, 10.6):
            point = radius * np.array([[np.cos(bearing), np.sin(bearing)]])
            off = (trail_headings(raster, point)[0] - (bearing + np.pi / 2) + np.pi / 2) % np.pi - np.pi / 2
            assert abs(off) < np.radians(1.0)


def test_in_a_world_without_a_trail_they_are_anywhere_with_a_warning(flat_world: World) -> None:
    with pytest.warns(FieldtruthWarning, match=r"^frames.along: test has no trail, so its frames are anywhere"):
        motion = standing(flat_world, along="trail")
    np.testing.assert_array_equal(motion.position, standing(flat_world).position)
    np.testing.assert_array_equal(motion.quaternion_wxyz, standing(flat_world).quaternion_wxyz)
