# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot alone: frames, mass, resting pose, straight speed and turn rate."""

import mujoco
import numpy as np
import pytest
from drive_worlds import F8, make_robot, make_world, tilted

from fieldtruth.core.transforms import rotation_from_quaternion_wxyz
from fieldtruth.drive.physics import STOP, Command, build_physics, ramp, wheel_speeds
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import WHEELS, RobotConfig, WheelConfig
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


WHEEL_CENTRES = np.array([(0.256, 0.2854), (0.256, -0.2854), (-0.256, 0.2854), (-0.256, -0.2854)])  # the paper, Table 2
WHEEL_HEIGHT, WHEEL_MASS, WHEEL_INERTIA = 0.03282, 2.637, (0.02467, 0.04411, 0.02467)  # the manufacturer's URDF
CHASSIS_CENTRE = np.array([-0.00065, 0.0, 0.062])  # the manufacturer's URDF, without its 85 mm to the right
CHASSIS_INERTIA = (0.6022, 1.7386, 2.0296)  # the same, of 46.034 kg


def about_the_origin(mass: float, centre: F8, inertia: F8) -> F8:
    """Steiner's theorem: inertia of a body about the origin from that about its centre of mass."""
    return np.asarray(inertia + mass * ((centre @ centre) * np.eye(3) - np.outer(centre, centre)))


def test_each_body_has_the_mass_centre_and_inertia_of_its_data_sheet(flat_world: World) -> None:
    model = build_physics(flat_world, Rig()).model
    for name in WHEELS:
        body = model.body(name)
        assert body.mass == pytest.approx(WHEEL_MASS)
        np.testing.assert_array_equal(body.ipos, 0.0)  # on the axle, in the middle of the tread
        np.testing.assert_array_equal(np.abs(body.iquat), (1, 0, 0, 0))
        np.testing.assert_allclose(body.inertia, WHEEL_INERTIA)
    base = model.body("base_link")
    assert base.mass == pytest.approx(50.0 - 4 * WHEEL_MASS)
    np.testing.assert_allclose(base.ipos, CHASSIS_CENTRE)
    np.testing.assert_array_equal(np.abs(base.iquat), (1, 0, 0, 0))
    np.testing.assert_allclose(base.inertia, np.array(CHASSIS_INERTIA) * (50.0 - 4 * WHEEL_MASS) / 46.034)


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.5])
def test_mass_matrix_of_the_robot_in_closed_form(flat_world: World, angle: float) -> None:
    """At any angle of its wheels: they are balanced, so their turning moves no mass and changes no inertia."""
    model = build_physics(flat_world, Rig()).model
    data = mujoco.MjData(model)
    data.qpos[7:] = angle
    mujoco.mj_forward(model, data)
    found = np.empty((model.nv, model.nv))
    mujoco.mj_fullM(model, data, found)
    chassis = 50.0 - 4 * WHEEL_MASS
    centres = np.column_stack([WHEEL_CENTRES, np.full(4, WHEEL_HEIGHT)])
    first_moment = chassis * CHASSIS_CENTRE + WHEEL_MASS * centres.sum(axis=0)
    inertia = about_the_origin(chassis, CHASSIS_CENTRE, np.diag(CHASSIS_INERTIA) * chassis / 46.034)
    inertia += sum(about_the_origin(WHEEL_MASS, centre, np.diag(WHEEL_INERTIA)) for centre in centres)
    np.testing.assert_allclose(found[:3, :3], 50.0 * np.eye(3), atol=1e-9)
    np.testing.assert_allclose(found[:3, 3:6], np.cross(np.eye(3), first_moment).T, atol=1e-9)
    np.testing.assert_allclose(found[3:6, 3:6], inertia, atol=1e-9)
    # About its axle a wheel has its own inertia and the rotor's, 0.1 kg m^2.
    np.testing.assert_allclose(found[6:, 6:], (WHEEL_INERTIA[1] + 0.1) * np.eye(4), atol=1e-9)
    np.testing.assert_allclose(found[6:, :6], np.tile([0, 0, 0, 0, WHEEL_INERTIA[1], 0], (4, 1)), atol=1e-9)


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
    commands = ramp(Command(0.3, 0.0), Command(0.0, -0.6), np.array([0.05, 0.1, 0.2]), RobotConfig())
    np.testing.assert_allclose(commands, [[0.15, -0.3], [0.0, -0.6], [0.0, -0.6]], atol=1e-12)


def test_robot_rests_at_its_nominal_height(flat_world: World) -> None:
    states = make_robot(flat_world).advance(STOP, 500)
    np.testing.assert_allclose(states[:, 2], 0.13228, atol=1e-4)
    np.testing.assert_allclose(states[:, 7:13], 0.0, atol=1e-6)
    np.testing.assert_allclose(states[:, 13:17] * 0.1651, 0.0, atol=1e-4)


@pytest.mark.parametrize(("along", "across"), [(8.0, 10.0), (-8.0, 10.0), (8.0, -10.0)])
def test_attitude_on_a_slope_matches_its_plane(along: float, across: float) -> None:
    robot = make_robot(make_world(tilted(along, across)))
    states = robot.advance(STOP, 500)
    rotation = rotation_from_quaternion_wxyz(states[-1, 3:7])
    normal = np.array([-np.tan(np.deg2rad(along)), -np.tan(np.deg2rad(across)), 1.0])
    normal /= np.linalg.norm(normal)
    # The load moves to the lower wheels: moments about the ground, 0.186 m below the centre of mass, tilt the robot by
    # half the sine over the stiffness of the tyres times the square of the half wheel base or half track.
    height = 0.13228 + (CHASSIS_CENTRE[2] * (50 - 4 * WHEEL_MASS) + 4 * WHEEL_MASS * WHEEL_HEIGHT) / 50
    ahead, left = rotation[2, 0], rotation[2, 1]  # sines of the slope along the robot's axes
    lean = 50 * 9.81 * height / (4 * 70_000) * np.array([ahead / 0.256**2, left / 0.2854**2])
    in_robot = rotation.T @ normal
    np.testing.assert_allclose(in_robot[:2], lean, atol=1e-4)
    assert np.linalg.norm(lean) > 7e-4
    # REP-103: nose up is a negative pitch, left side up a positive roll.
    pitch = np.rad2deg(-np.arcsin(rotation[2, 0]))
    roll = np.rad2deg(np.arctan2(rotation[2, 1], rotation[2, 2]))
    assert pitch == pytest.approx(-along, abs=0.08)
    across_at_right_angles = np.rad2deg(np.arctan(np.tan(np.deg2rad(across)) * np.cos(np.deg2rad(along))))
    assert roll == pytest.approx(across_at_right_angles, abs=0.08)
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
    np.testing.assert_allclose(states[:, 13:17].mean(axis=0) * 0.1651, speed, rtol=2e-3)


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


@pytest.mark.parametrize("command", [Command(0.3, 0.5), Command(0.8, 0.8), Command(0.0, 1.0)])
def test_turns_begin_without_a_spike(flat_world: World, command: Command) -> None:
    """The wheels' slip rises at 6 rad/s^2; the rigid contact lifted them at 6 m/s^2."""
    robot = make_robot(flat_world)
    robot.advance(Command(command.speed, 0.0), 1000)
    velocity = robot.advance(command, 1000)[:, 9]
    assert np.abs(np.diff(velocity) / 0.001).max() < 0.2


def test_standing_robot_does_not_creep_on_a_slope() -> None:
    robot = make_robot(make_world(tilted(13.0, 0.0)))
    position = robot.advance(STOP, 3000)[:, :3]
    assert np.linalg.norm(position[-1] - position[0]) / 3.0 < 1e-5
