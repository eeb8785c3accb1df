# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Robots as other robots see them: their boxes and wheels, class and instance id."""

import numpy as np
import pytest
from sense_worlds import at, box, make_world

from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.drive.track import standing_at
from fieldtruth.experiment.rig import Rig, body_parts
from fieldtruth.sense.interval import Moving
from fieldtruth.sense.robot import meet, part_table
from fieldtruth.sense.robots import robot_body, robot_mesh, with_robots
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import IdealLidar
from fieldtruth.world.model import World

RIG = Rig()
ROBOT_POSE = transforms.pose((3.0, 0.5, 0.13), (2.0, -3.0, 130.0))


@pytest.fixture(name="world", scope="module")
def _world() -> World:
    return with_robots(make_world([(box("crate", (0.4, 0.4, 0.4)), at(5, 5, 0.4))]), ["leader", "follower"])


def test_robots_have_the_ids_behind_all_objects(world: World) -> None:
    plain = make_world([(box("crate", (0.4, 0.4, 0.4)), at(5, 5, 0.4))])
    assert world.object_names == (*plain.object_names, "leader", "follower")
    assert [*world.materials][: len(plain.materials)] == [*plain.materials]
    assert (world.instances, world.seed) == (world.instances, plain.seed)
    with pytest.raises(ConfigurationError, match="robot object_0: an object of the world tiny has this name"):
        with_robots(plain, ["object_0"])


def test_points_lie_on_boxes_and_wheels_of_the_robot(world: World) -> None:
    """Ranges are those of the exact boxes and cylinders, as the robot's own sensors meet them."""
    scene = Scene(world, Moving([robot_body(world, "follower", RIG, standing_at(ROBOT_POSE))]))
    config = LidarConfig(columns=2048, rings=64, max_range=30.0)
    eye = at(0, 0, 0.6)
    scan = IdealLidar(config, scene).scan(eye, 0)
    on_robot = scan.label == Label.ROBOT
    assert set(scan.instance[on_robot]) == {world.object_names.index("follower")}
    assert np.count_nonzero(on_robot) > 1000
    base_from_eye = transforms.inverse(ROBOT_POSE) @ eye
    rays = scan.xyz[on_robot] / np.linalg.norm(scan.xyz[on_robot], axis=1, keepdims=True)
    exact = meet(part_table(body_parts(RIG)), base_from_eye[:3, 3], rays @ base_from_eye[:3, :3].T).range_m
    apart = np.abs(scan.range_m[on_robot] - exact)[np.isfinite(exact)]
    assert np.median(apart) < 1e-4
    assert np.mean(apart < 0.01) > 0.99  # others pass a bevelled edge of 5 mm, or graze a wheel
    assert np.isfinite(exact).mean() > 0.99


def test_mesh_of_a_robot_is_as_large_as_its_parts() -> None:
    mesh = robot_mesh("a", RIG)
    table = part_table(body_parts(RIG))
    low, high = (table[:, 1:4] - table[:, 4:]).min(axis=0), (table[:, 1:4] + table[:, 4:]).max(axis=0)
    assert mesh.vertices.min(axis=0) == pytest.approx(low, abs=1e-4)
    assert mesh.vertices.max(axis=0) == pytest.approx(high, abs=1e-4)
