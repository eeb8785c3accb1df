# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot alone: frames, mass, resting pose, straight speed and turn rate."""

import mujoco
import numpy as np
import pytest
from drive_worlds import make_robot, make_world, tilted

from fieldtruth.core.frames import rotation_from_quaternion_wxyz
from fieldtruth.drive.husky import STOP, Command, ramp, wheel_speeds
from fieldtruth.drive.physics import build_physics
from fieldtruth.experiment.rig import WHEELS, Rig, WheelConfig
from fieldtruth.world.model import World


def test_frames_and_mass_match_the_paper(flat_world: World) -> None:
    model = build_physics(flat_world, Rig()).model
    assert model.body_subtreemass[model.body("base_link").id] == pytest.approx(50.0)
    mounts = Rig().mounts()
    for name in WHEELS:
        np.testing.assert_allclose(model.body(name).pos, mounts[f"{name}_wheel"].xyz)
        assert model.geom(f"{name}_wheel").size[0] == 0.1651
    np.testing.assert_array_equal(model.opt.gravity, (0, 0, -9.81))
    assert model.opt.timestep == 0.001


def test_wheels_and_servos_are_in_the_order_of_the_tachometers(flat_world: World) -> None:
    model = build_physics(flat_world, Rig()).model
    joints = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, i) for i in range(1, model.njnt)]
    servos = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, i) for i in range(model.nu)]
    assert joints == servos == list(WHEELS)


def test_wheel_speeds_in_closed_form() -> None:
    wheels = WheelConfig(half_wheelbase=0.3, half_track=0.3, radius=0.2)
    np.testing.assert_allclose(wheel_speeds((0.4, 0.0), wheels), [2.0] * 4)
    # Equal arms: friction halves the turn rate, so the wheels are commanded twice as fast.
    np.testing.assert_allclose(wheel_speeds((0.0, 0.5), wheels), [-1.5, 1.5, -1.5, 1.5])


def test_ramp_keeps_the_acceleration_limits() -> None:
    commands = ramp(Command(0.3, 0.0), Command(0.0, -0.6), np.array([0.05, 0.1, 0.2]))
    np.testing.assert_allclose(commands, [[0.15, -0.3], [0.0, -0.6], [0.0, -0.6]], atol=1e-12)


def test_robot_rests_at_its_nominal_height(flat_world: World) -> None:
    states = make_robot(flat_world).advance(STOP, 500)
    np.testing.assert_allclose(states[:, 2], 0.13228, atol=1e-4)
    np.testing.assert_allclose(states[:, 7:13], 0.0, atol=1e-6)
    np.testing.assert_allclose(states[:, 13:] * 0.1651, 0.0, atol=1e-4)


@pytest.mark.parametrize(("along", "across"), [(8.0, 10.0), (-8.0, 10.0), (8.0, -10.0)])
def test_attitude_on_a_slope_matches_its_plane(along: float, across: float) -> None:
    robot = make_robot(make_world(tilted(along, across)))
    states = robot.advance(STOP, 500)
    rotation = rotation_from_quaternion_wxyz(states[-1, 3:7])
    normal = np.array([-np.tan(np.deg2rad(along)), -np.tan(np.deg2rad(across)), 1.0])
    normal /= np.linalg.norm(normal)
    assert np.rad2deg(np.arccos(rotation[:, 2] @ normal)) < 0.05
    # REP-103: nose up is a negative pitch, left side up a positive roll.
    pitch = np.rad2deg(-np.arcsin(rotation[2, 0]))
    roll = np.rad2deg(np.arctan2(rotation[2, 1], rotation[2, 2]))
    assert pitch == pytest.approx(-along, abs=0.05)
    across_at_right_angles = np.rad2deg(np.arctan(np.tan(np.deg2rad(across)) * np.cos(np.deg2rad(along))))
    assert roll == pytest.approx(across_at_right_angles, abs=0.05)
    assert states[-1, :3] @ normal == pytest.approx(0.13228, abs=5e-4)
    assert np.linalg.norm(states[:, 7:10], axis=1).max() < 2e-4


@pytest.mark.parametrize("speed", [0.3, 1.0])
def test_straight_speed(flat_world: World, speed: float) -> None:
    robot = make_robot(flat_world)
    robot.advance(Command(speed, 0.0), 1000)
    states = robot.advance(Command(speed, 0.0), 3001)
    moved = states[-1, :2] - states[0, :2]
    assert moved[0] == pytest.approx(3 * speed, rel=5e-3)
    assert abs(moved[1]) < 3e-3 * moved[0]
    np.testing.assert_allclose(states[:, 13:].mean(axis=0) * 0.1651, speed, rtol=2e-3)


@pytest.mark.parametrize(
    ("speed", "turn_rate"), [(0.3, 0.6), (0.3, -0.6), (0.3, 0.2), (0.3, -0.2), (0.0, 1.0), (0.0, -1.0)]
)
def test_turn_rate_matches_the_command(flat_world: World, speed: float, turn_rate: float) -> None:
    robot = make_robot(flat_world)
    robot.advance(Command(speed, turn_rate), 1000)
    states = robot.advance(Command(speed, turn_rate), 3001)
    rotation = rotation_from_quaternion_wxyz(states[:, 3:7])
    yaw = np.unwrap(np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0]))
    assert (yaw[-1] - yaw[0]) / 3.0 == pytest.approx(turn_rate, rel=0.03)
    length = np.linalg.norm(np.diff(states[::100, :2], axis=0), axis=1).sum()
    assert length == pytest.approx(3 * speed, rel=0.01, abs=0.02)


def test_skidding_does_not_lift_the_wheels(flat_world: World) -> None:
    robot = make_robot(flat_world)
    robot.advance(Command(0.3, 0.5), 1000)
    velocity = robot.advance(Command(0.3, 0.5), 2000)[:, 7:10]
    assert np.abs(np.diff(velocity[:, 2]) / 0.001).max() < 3.0
    assert np.std(np.diff(velocity[:, 2]) / 0.001) < 0.3
