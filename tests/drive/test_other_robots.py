# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Robots that meet other robots in the physics, where they are put."""

import numpy as np
import pytest
from drive_worlds import make_world

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.drive.physics import Command
from fieldtruth.drive.simulate import SimulatedRobot
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.rig import Rig


class Log:
    """Touches of other things, with the position of the robot."""

    def __init__(self) -> None:
        self.touches: list[tuple[str, float, float]] = []

    def check(self, time_s: float, position: Array, quaternion_wxyz: Array) -> None:
        """Let it drive on."""

    def touch(self, name: str, speed: float, time_s: float, position: Array) -> None:
        """Note it."""
        self.touches.append((name, speed, float(position[0])))


@pytest.fixture(name="rig")
def _rig() -> Rig:
    return Experiment.model_validate(
        {"name": "plain", "environment": "park", "route": {"start": (0, 0), "waypoints": [(0, 1)]}}
    ).rig


def test_robot_that_stands_in_the_way_is_hit_at_its_outline(rig: Rig) -> None:
    log, world = Log(), make_world()
    robot = SimulatedRobot(world, rig, log, others={"b": rig})
    robot.meet({"b": transforms.pose((4.0, 0.0, 0.132), (0.0, 0.0, 90.0))})
    robot.spawn(np.zeros(2), np.array([1.0, 0.0]))
    states = robot.advance(Command(0.5, 0.0), 10_000)
    name, speed, x = log.touches[0]
    assert name == "b"
    assert speed == pytest.approx(0.5, abs=0.02)
    assert x == pytest.approx(4.0 - rig.robot.outline[0] / 2 - rig.robot.outline[1] / 2, abs=0.005)
    assert states[-1, 0] == pytest.approx(x, abs=0.03)  # and stopped by it


def test_robot_passes_where_the_other_one_was(rig: Rig) -> None:
    log, world = Log(), make_world()
    robot = SimulatedRobot(world, rig, log, others={"b": rig})
    robot.spawn(np.zeros(2), np.array([1.0, 0.0]))
    for k in range(80):  # the other one crosses, and has left the way before the robot is there
        robot.meet({"b": transforms.pose((2.5, -1.0 + 0.1 * k, 0.132))})
        robot.advance(Command(0.5, 0.0), 100)
    assert log.touches == []
    assert robot.pose[0][0] == pytest.approx(3.95, abs=0.1)


def test_others_that_are_nowhere_change_no_bit_of_a_drive(rig: Rig) -> None:
    runs = []
    for others in (None, {"b": rig}):
        robot = SimulatedRobot(make_world(), rig, Log(), others=others)
        robot.spawn(np.zeros(2), np.array([1.0, 0.2]))
        runs.append(robot.advance(Command(0.6, 0.1), 1000))
    np.testing.assert_array_equal(runs[0], runs[1])
