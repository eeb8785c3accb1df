# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Contacts of wheels with soils, and effects of friction, drag, torque and sinkage on the robot."""

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest
from drive_worlds import F8, make_experiment, make_world, tilted

from fieldtruth.drive.controller import DriveMonitor, WaypointFollower
from fieldtruth.drive.physics import STOP, Command, build_physics
from fieldtruth.drive.simulate import SimulatedRobot
from fieldtruth.drive.surroundings import WheelContacts
from fieldtruth.experiment.config import geodetic_route
from fieldtruth.experiment.rig import Rig
from fieldtruth.kernels.soil import Wheels
from fieldtruth.world.model import World


def robot_on(world: World, soil: Callable[[Wheels], None]) -> SimulatedRobot:
    """At the origin, facing +x, settled."""
    experiment = make_experiment([(15.0, 0.0)])
    follower = WaypointFollower(geodetic_route(experiment.route).waypoints, experiment.control)
    robot = SimulatedRobot(world, Rig(), DriveMonitor(world, follower, experiment.control), soil)
    robot.spawn(np.zeros(2), np.array([100.0, 0.0]))
    return robot


def test_soil_sees_place_load_and_velocities(flat_world: World) -> None:
    seen: list[list[F8]] = []
    robot = robot_on(flat_world, lambda wheels: seen.append([part.copy() for part in wheels]))
    robot.advance(Command(0.3, 0.4), 1000)
    state = robot.advance(Command(0.3, 0.4), 1000)[-2]  # the soil acts before the last step
    wheels = Wheels(*seen[-1])
    yaw = 2 * np.arctan2(state[6], state[3])
    along, across = np.array([0.256, 0.256, -0.256, -0.256]), np.array([1, -1, 1, -1]) * 0.2854
    expected = state[:2] + np.outer(along, (np.cos(yaw), np.sin(yaw))) + np.outer(across, (-np.sin(yaw), np.cos(yaw)))
    np.testing.assert_allclose(wheels.position[:, :2], expected, atol=1e-4)
    np.testing.assert_allclose(wheels.position[:, 2], 0.0, atol=1e-4)
    assert wheels.load.sum() == pytest.approx(50 * 9.81, rel=1e-4)
    np.testing.assert_allclose(wheels.velocity[:, 0], 0.3 - 0.4 * across, rtol=0.02)
    np.testing.assert_allclose(wheels.velocity[:, 1], 0.4 * along, atol=0.01)
    np.testing.assert_allclose(wheels.rolling, 0.3 - 0.4 * across * 1.805, rtol=0.02)


def test_friction_of_each_wheel_limits_its_force_uphill() -> None:
    """On a slope of 13 deg the robot needs 0.23: with 0.3 it climbs, with 0.15 it slides back."""

    def climbed(friction: float) -> float:
        robot = robot_on(make_world(tilted(13.0, 0.0)), lambda wheels: wheels.friction.fill(friction))
        return float(robot.advance(Command(0.3, 0.0), 2000)[-1, 0])

    assert climbed(0.3) > 0.45
    assert climbed(0.15) < -0.5


def test_drag_decelerates_a_sliding_robot(flat_world: World) -> None:
    """Without friction the wheels drive nothing: 10 N on each axle accelerate 50 kg by 0.8 m/s^2."""

    def soil(wheels: Wheels) -> None:
        wheels.friction.fill(1e-6)
        wheels.drag.fill(-10.0)

    speed = robot_on(flat_world, soil).advance(STOP, 500)[:, 7]
    assert (speed[-1] - speed[0]) / 0.499 == pytest.approx(-0.8, rel=1e-3)


def test_torque_is_carried_by_the_servos_and_the_ground(flat_world: World) -> None:
    """A resistance that the servos overcome changes no speed; one beyond 40 N m stops the wheels."""

    def speed(torque: float) -> float:
        def soil(wheels: Wheels) -> None:
            wheels.torque[:] = -torque * np.tanh(wheels.rolling / 0.01)

        return float(robot_on(flat_world, soil).advance(Command(0.3, 0.0), 2000)[-1, 7])

    assert speed(5.0) == pytest.approx(0.3, rel=1e-2)
    assert speed(60.0) < 0.03


def test_sinkage_lowers_the_robot(flat_world: World) -> None:
    def soil(wheels: Wheels) -> None:
        wheels.sinkage[:] = np.minimum(wheels.sinkage + 2e-6, 0.002)

    height = robot_on(flat_world, soil).advance(STOP, 1)[-1, 2]
    reference = robot_on(flat_world, lambda wheels: None).advance(STOP, 1)[-1, 2]
    assert reference - height == pytest.approx(0.002, abs=2e-5)


def test_robot_falls_freely_beyond_a_step() -> None:
    """Off a table of 0.5 m at 2 m/s: the tyres, 1.75 mm longer unloaded, touch after sqrt(2 h / g), with no load."""

    def table(x: F8, y: F8) -> F8:
        return np.where(x < 0.0, 0.5, 0.0) + 0.0 * y

    world = make_world(table, spacing=0.05)
    model = build_physics(world, Rig()).model
    data = mujoco.MjData(model)
    contacts = WheelContacts(model, data, world.terrain.field, Rig(), lambda wheels: None)
    data.qpos[:3], data.qvel[0] = (0.5, 0.0, 0.5 + 0.13228), 2.0
    speeds = []
    while not contacts.wheels.load.any():
        contacts.update()
        mujoco.mj_step(model, data)
        assert not contacts.read()
        speeds.append(float(data.qvel[2]))
        assert len(speeds) < 1000
    fall = 0.5 - 50 * 9.81 / 4 / 70_000
    assert len(speeds[:-1]) * 0.001 == pytest.approx(np.sqrt(2 * fall / 9.81), abs=0.0011)
    assert speeds[-2] == pytest.approx(-np.sqrt(2 * fall * 9.81), rel=0.01)
    assert data.qpos[0] == pytest.approx(0.5 + 2.0 * np.sqrt(2 * fall / 9.81), abs=0.01)


@pytest.mark.parametrize("row", [0, 2, 5])
def test_a_state_that_is_not_finite_stays_so(
    flat_world: World, row: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log
    model = build_physics(flat_world, Rig()).model
    data = mujoco.MjData(model)
    contacts = WheelContacts(model, data, flat_world.terrain.field, Rig())
    data.qpos[row] = np.nan
    for _ in range(3):
        contacts.update()
        mujoco.mj_step(model, data)
    assert not np.isfinite(data.qpos).all()
