# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The expected path of a route, and the poses of the robot on it."""

import numpy as np
from drive_worlds import make_experiment, make_world

from fieldtruth.core import transforms
from fieldtruth.drive.plan import expected_path, experiments_in, pose_on_ground, poses_along
from fieldtruth.experiment.names import EXPERIMENTS
from fieldtruth.experiment.rig import Rig

EXPERIMENT = make_experiment([(0.0, 0.0), (8.0, 0.0)], start=(-8.0, 0.0))


def test_straight_route_ends_at_the_arrival_distance() -> None:
    path = expected_path(EXPERIMENT, make_world())
    np.testing.assert_allclose(path[0], (-8, 0, 0), atol=1e-3)
    np.testing.assert_allclose(path[:, 1:], 0.0, atol=2e-3)
    assert (np.diff(path[:, 0]) >= 0).all()
    # Arrival: a fix, every 0.15 m, of the antenna 0.1 m ahead is within 2 m of x = 8.
    assert 5.9 <= path[-1, 0] <= 6.1


def test_corner_is_cut_on_the_inside() -> None:
    path = expected_path(make_experiment([(10.0, 0.0), (10.0, 10.0)]), make_world())
    assert np.hypot(*(path[:, :2] - (10, 0)).T).min() > 0.5
    assert path[:, 0].max() < 10.2
    np.testing.assert_allclose(path[-1, 2], np.pi / 2, atol=0.2)


def test_poses_are_evenly_spaced_and_a_short_path_has_one() -> None:
    x = np.linspace(0, 10, 1001)
    path = np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])
    np.testing.assert_allclose(poses_along(path, 2.0)[:, 0], [1, 3, 5, 7, 9], atol=0.011)
    assert len(poses_along(path[:3], 2.0)) == 1


def test_pose_on_ground_is_the_nominal_height_above_the_ground() -> None:
    pose = pose_on_ground(
        make_world(lambda x, y: 3.0 + 0.0 * (x + y)).terrain.field, np.array([4.0, -2.0, np.pi / 2]), Rig()
    )
    np.testing.assert_allclose(pose, transforms.pose((4.0, -2.0, 3.13228), (0, 0, 90)), atol=1e-9)


def test_experiments_are_found_by_their_environment() -> None:
    names = [experiment.name for experiment in experiments_in("park")]
    assert names == [name for name in EXPERIMENTS if name.startswith("park") and name != "park_people"]  # has actors
    assert experiments_in("nowhere") == []
