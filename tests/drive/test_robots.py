# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Every robot against the laws of mechanics, and against its own limits and clearances."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from drive_worlds import make_experiment, make_robot, make_world, obstacle, tilted
from numpy.testing import assert_allclose
from series import odometry_along

import fieldtruth as ft
from fieldtruth.bag.messages import wheel_mounts, wheel_transforms
from fieldtruth.bag.topics import topics_of
from fieldtruth.core.errors import ConfigurationError, RouteError
from fieldtruth.core.transforms import rotation_from_quaternion_wxyz
from fieldtruth.drive import simulate
from fieldtruth.drive.ground import bump_height
from fieldtruth.drive.physics import STOP, Command, body_boxes, servo_scale
from fieldtruth.drive.plan import plan_route
from fieldtruth.drive.soil import SoilContact
from fieldtruth.drive.traversability import Traversability, obstacle_height
from fieldtruth.experiment.catalogue import ROBOTS, list_robots
from fieldtruth.experiment.files import dump_experiment, parse_experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import RobotConfig, WheelConfig
from fieldtruth.gazebo.robot import check_rig
from fieldtruth.world.model import World

EACH = pytest.mark.parametrize("name", ROBOTS)
OUTLINES = {"jackal": 0.43, "warthog": 1.38}  # [m], widths of the data sheets


def rig_of(name: str) -> Rig:
    return Rig.model_validate({"robot": name})


def yaw_of(states: np.ndarray) -> np.ndarray:
    rotation = rotation_from_quaternion_wxyz(states[:, 3:7])
    return np.asarray(np.unwrap(np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])))


@EACH
def test_at_rest_the_supports_carry_the_weight_and_the_robot_is_level(flat_world: World, name: str) -> None:
    rig = rig_of(name)
    robot = make_robot(flat_world, rig=rig)
    state = robot.advance(STOP, 500)[-1]
    data = robot.surroundings.data
    normal = data.contact.efc_address
    weight = rig.robot.mass * 9.81
    assert len(normal) == len(rig.wheels.names) + (rig.robot.caster is not None)
    forces = data.efc_force[normal]
    assert forces.sum() == pytest.approx(weight, rel=0.01)
    assert forces.min() > 0.1 * weight
    assert robot.surroundings.model.body_mass.sum() == pytest.approx(rig.robot.mass)
    figures = ROBOTS[name]["figures"]
    clearance = figures["wheels.radius"]["value"] - figures["wheels.axle_height"]["value"]
    assert state[2] == pytest.approx(clearance, abs=0.005)
    tilt = np.degrees(np.arccos(rotation_from_quaternion_wxyz(state[3:7])[2, 2]))
    assert tilt < 0.2
    assert np.abs(state[7:10]).max() < 1e-4


def test_a_caster_carries_what_the_lever_law_says(flat_world: World) -> None:
    rig = rig_of("generic_differential")
    robot = make_robot(flat_world, rig=rig)
    robot.advance(STOP, 500)
    data, caster = robot.surroundings.data, rig.robot.caster
    assert caster is not None
    geom = robot.surroundings.model.geom("caster").id
    rows = [row for row, geoms in zip(data.contact.efc_address, data.contact.geom, strict=True) if geom in geoms]
    chassis = rig.robot.mass - 2 * rig.wheels.mass
    expected = chassis * 9.81 * rig.robot.chassis_centre[0] / caster.x
    assert data.efc_force[rows].sum() == pytest.approx(expected, rel=0.01)


@EACH
def test_it_drives_2_m_straight_at_the_commanded_speed(flat_world: World, name: str) -> None:
    rig = rig_of(name)
    robot, wheels = make_robot(flat_world, (-18.0, 0.0), rig=rig), len(rig.wheels.names)
    robot.advance(Command(0.5, 0.0), 1000)
    states = robot.advance(Command(0.5, 0.0), 4001)
    moved = states[-1, :2] - states[0, :2]
    assert float(np.linalg.norm(moved)) == pytest.approx(2.0, rel=0.01)
    assert abs(moved[1]) < 0.02
    rolled = (states[-1, 13 + wheels :] - states[0, 13 + wheels :]) * rig.wheels.radius
    assert_allclose(rolled, np.linalg.norm(moved), rtol=0.01)  # wheel odometry


@EACH
def test_it_turns_in_place_at_the_commanded_rate(flat_world: World, name: str) -> None:
    rig = rig_of(name)
    for soil in (None, SoilContact(flat_world, rig.wheels, {})):
        robot = make_robot(flat_world, rig=rig, soil=soil)
        robot.advance(Command(0.0, 0.6), 1000)
        states = robot.advance(Command(0.0, 0.6), 3001)
        yaw = yaw_of(states)
        assert (yaw[-1] - yaw[0]) / 3.0 == pytest.approx(0.6, rel=0.1)
        assert np.linalg.norm(states[-1, :2] - states[0, :2]) < 0.1


@EACH
def test_it_reaches_its_greatest_speed_and_keeps_it(name: str) -> None:
    rig = rig_of(name)
    robot, limit = make_robot(make_world(size=(60.0, 10.0)), (-28.0, 0.0), rig=rig), rig.robot.max_speed
    begun = robot.advance(Command(limit, 0.0), 3000)
    states = robot.advance(Command(limit, 0.0), 1001)
    assert states[-1, 0] - states[0, 0] == pytest.approx(limit, rel=0.01)
    assert begun[:, 7].max() < 1.03 * limit
    assert np.abs(np.diff(begun[:, 7]) / 0.001).max() < 2 * rig.robot.max_acceleration
    assert np.abs(states[:, 9]).max() < 0.01


def test_a_heavier_robot_is_slower_by_its_limits_only(flat_world: World) -> None:
    """Its servos grow with its mass; what is left is the torque limit, which stops it on a slope of 15 deg."""
    heavy = Rig.model_validate({"robot": {"model": "jackal", "mass": 60.0}})
    robot = make_robot(flat_world, (-15.0, 0.0), rig=heavy)
    robot.advance(Command(1.0, 0.0), 2000)
    states = robot.advance(Command(1.0, 0.0), 2001)
    assert states[-1, 0] - states[0, 0] == pytest.approx(2.0, rel=0.01)
    needed = 60.0 * 9.81 * np.sin(np.radians(15.0)) * heavy.wheels.radius / 4
    weak = Rig.model_validate({"robot": {"model": "jackal", "mass": 60.0, "max_torque": 0.5 * needed}})
    slope = make_world(tilted(15.0, 0.0))
    for rig, climbs in ((heavy, True), (weak, False)):
        robot = make_robot(slope, (-10.0, 0.0), rig=rig)
        states = robot.advance(Command(0.5, 0.0), 2001)
        assert bool(states[-1, 0] > states[0, 0] + 0.3) is climbs


def test_servos_of_all_robots_have_the_frequency_of_a_husky() -> None:
    scales = {name: servo_scale(rig_of(name).robot) for name in ROBOTS}
    assert scales["husky"] == 1.0
    assert scales["warthog"] == pytest.approx(260 * 0.3**2 / (50 * 0.1651**2))


def test_a_differential_robot_drives_a_route_and_publishes_two_wheels(tmp_path: Path) -> None:
    rig = Rig.model_validate(
        {"robot": "generic_differential", "lidar": {"enabled": False}, "cameras": {"enabled": False}}
    )
    world = make_world()
    experiment = make_experiment([(6.0, 1.0), (9.0, -1.0)], rig=rig.model_dump())
    assert experiment.rig == rig
    track = simulate.drive(world, experiment)
    assert track.base is not None
    assert track.base.wheels.angle.shape[1] == 2
    assert np.linalg.norm(track.motion.position[-1, :2] - (9.0, -1.0)) < 2.5
    start, end = odometry_along(track, rig).pose[[0, -1]]
    driven = np.linalg.norm(track.motion.position[-1, :2] - track.motion.position[0, :2])
    assert np.linalg.norm(end[:2] - start[:2]) == pytest.approx(driven, rel=0.01)
    assert [topic.name for topic in topics_of(rig) if topic.kind == "wheel_odometry"] == [
        "/gazebo_client/front_left_speed",
        "/gazebo_client/front_right_speed",
        "/joint_states",
        "/odometry/wheel",
        "/cmd_vel",
    ]
    assert list(wheel_transforms(wheel_mounts(rig), np.zeros(2))) == ["front_left_wheel", "front_right_wheel"]
    assert [frame for frame in rig.mounts() if frame.endswith("wheel")] == ["front_right_wheel", "front_left_wheel"]


def gap_world(width: float) -> World:
    """Two posts beside a straight route along x, ``width`` [m] apart."""
    posts = [
        obstacle(f"post_{i}", "cylinder", (0.2, 2.0), 5.0, side * (width / 2 + 0.2)) for i, side in enumerate((1, -1))
    ]
    return make_world(obstacles=posts)


def test_a_jackal_fits_through_a_gap_that_a_warthog_does_not() -> None:
    world = gap_world(1.2)
    routes = {name: make_experiment([(10.0, 0.0)], rig={"robot": name}) for name in OUTLINES}
    plan_route(world, routes["jackal"])
    with pytest.raises(RouteError, match=r"^the leg .* passes post_0 at a distance of 0\.60 m, .* needs 0\.7[56] m$"):
        plan_route(world, routes["warthog"])
    free = [width for width in np.arange(1.3, 1.8, 0.05) if passes(gap_world(width), routes["warthog"])]
    assert min(free) == pytest.approx(OUTLINES["warthog"] + 2 * 0.065, abs=0.05)


def passes(world: World, experiment: ft.Experiment) -> bool:
    try:
        plan_route(world, experiment)
    except RouteError:
        return False
    return True


@pytest.mark.parametrize("name", ["jackal", "warthog", "generic_differential"])
def test_ground_under_the_chassis_is_measured_from_the_plane_of_the_supports(name: str) -> None:
    robot = rig_of(name).robot
    heading = np.array([0.0, 0.7, 2.0])
    slope_x, slope_y = 0.1, -0.05

    def plane(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 3.0 + slope_x * x + slope_y * y

    assert_allclose(bump_height(plane, plane, heading, robot), 0.0, atol=1e-12)
    bump = bump_height(plane, lambda x, y: plane(x, y) + 0.2 * (np.hypot(x, y) < 0.05), heading, robot)
    assert_allclose(bump, 0.2, atol=1e-12)


def test_ground_that_is_too_rough_for_a_jackal_is_not_for_a_warthog() -> None:
    def kerb(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.asarray(0.1 * (np.abs(x) < 0.15) * np.ones_like(x + y))

    world = make_world(kerb, spacing=0.05)
    clear = {name: Traversability(world, rig_of(name)).blockage_at([(0.0, 0.0)])[0] for name in OUTLINES}
    assert clear["warthog"] == 0
    assert clear["jackal"] != 0


def test_obstacles_stop_a_mast_above_the_usual_height() -> None:
    assert obstacle_height(Rig()) == 1.2
    high = {"kind": "gnss", "name": "high", "mount": {"xyz": [0.0, 0.0, 1.5]}}
    assert obstacle_height(Rig.model_validate({"sensors": [high]})) == pytest.approx(1.5 + 0.13228)


@EACH
def test_every_figure_has_a_value_and_a_source(name: str) -> None:
    figures = ROBOTS[name]["figures"]
    assert all(set(figure) == {"value", "source"} and figure["source"] for figure in figures.values())
    flat = {f"wheels.{key}" for key in WheelConfig.model_fields} | set(RobotConfig.model_fields) - {"wheels"}
    assert {key for key in figures if not key.startswith("caster.")} <= flat
    # What a file does not state is the same for all robots, or follows from the other figures.
    missing = flat - set(figures) - {"model", "caster", "base_footprint", "deck_height"}
    assert missing == ({"wheels.width"} if name == "husky" else set())
    boxes = body_boxes(rig_of(name))
    assert boxes["outline"].size[1] >= 2 * rig_of(name).wheels.half_track


def test_the_default_is_the_husky_of_its_file() -> None:
    assert rig_of("husky") == Rig()
    assert "husky" in list_robots()


@pytest.mark.parametrize("robot", ["warthog", "{model: generic_differential, mass: 30}", "{max_speed: 0.5}"])
def test_an_experiment_with_a_robot_is_read_back(robot: str) -> None:
    experiment = parse_experiment(text(f"rig: {{robot: {robot}}}"))
    assert parse_experiment(dump_experiment(experiment)) == experiment
    changed = parse_experiment(text("rig: {robot: {model: jackal, wheels: {radius: 0.12}}}")).rig.robot
    assert (changed.wheels.radius, changed.wheels.half_track, changed.mass) == (0.12, 0.187795, 18.431)


def test_the_older_keys_change_the_robot() -> None:
    rig = parse_experiment(
        text("rig: {robot: jackal, wheels: {radius: 0.12}, base_footprint: {xyz: [0, 0, -0.1]}}")
    ).rig
    assert (rig.wheels.radius, rig.wheels.half_track, rig.robot.footprint.xyz) == (0.12, 0.187795, (0.0, 0.0, -0.1))
    assert Rig(wheels=WheelConfig(half_track=0.3)).mounts()["rear_left_wheel"].xyz == (-0.256, 0.3, 0.03282)  # type: ignore[call-arg]


def text(lines: str) -> str:
    return f"name: test\nenvironment: park\nroute: {{metres: {{start: [0, 0], waypoints: [[5, 0]]}}}}\n{lines}"


BAD = [
    ("rig: {robot: jakal}", r"rig\.robot: unknown robot 'jakal'; did you mean 'jackal'\? Available: "),
    ("rig: {robot: {model: jackal, mas: 3}}", r"unknown key 'rig\.robot\.mas'; did you mean 'rig\.robot\.mass'\?"),
    ("rig: {robot: {mass: 8}}", r"rig\.robot\.mass must be above 10\.548, that of the wheels, got 8$"),
    ("rig: {robot: 7}", r"rig\.robot must be a name from `fieldtruth list robots`, or a mapping .*, got 7$"),
    ("rig: {robot: {drive: differential}}", r"rig\.robot\.wheels\.half_wheelbase must be 0 of a differential robot"),
    ("rig: {robot: {model: generic_differential, caster: null}}", r"rig\.robot\.caster is required of a differential"),
    ("rig: {robot: {caster: {x: 1, radius: 1, width: 1}}}", r"rig\.robot\.caster must not be given for a skid_steer"),
    ("rig: {robot: {chassis_inertia: [1, 1, 3]}}", r"rig\.robot\.chassis_inertia must have no value above the sum"),
    ("rig: {robot: {chassis_centre: [0.3, 0, 0]}}", r"rig\.robot\.chassis_centre must be between the wheels, .*0\.3"),
    ("rig: {robot: {wheels: {axle_height: 0.2}}}", r"rig\.robot\.wheels\.axle_height must be below the radius 0\.1651"),
    ("rig: {robot: {wheels: {tyre_stiffness: 9}}}", r"rig\.robot\.wheels\.tyre_stiffness must be at least 3714, "),
    ("rig: {wheels: {radius: -1}}", r"rig\.wheels\.radius must be a number above 0 and at most 1, got -1$"),
    ("control: {speed: 1.2}", r"control\.speed must be at most 1 m/s, the limit of the robot husky, got 1\.2$"),
    ("control: {max_turn_rate: 1}\nrig: {robot: scout}", r"control\.max_turn_rate must be at most 0\.7853 rad/s, "),
]  # fmt: skip


@pytest.mark.parametrize(("lines", "message"), BAD, ids=[lines for lines, _ in BAD])
def test_a_mistake_is_one_line_that_names_the_key(lines: str, message: str) -> None:
    with pytest.raises(ConfigurationError, match=f"^{message}") as refusal:
        parse_experiment(text(lines))
    assert "\n" not in str(refusal.value)


def test_speeds_follow_the_robot() -> None:
    limits = {"husky": 1.0, "jackal": 2.0, "warthog": 5.0, "scout": 1.5}
    for name, over in itertools.product(limits, (False, True)):
        lines = f"control: {{speed: {limits[name] * (1.01 if over else 1.0)}}}\nrig: {{robot: {name}}}"
        if over:
            with pytest.raises(ConfigurationError, match=f"the limit of the robot {name}"):
                parse_experiment(text(lines))
        else:
            assert parse_experiment(text(lines)).control.speed == limits[name]


def test_a_package_for_gazebo_refuses_a_robot_with_two_wheels() -> None:
    check_rig(rig_of("warthog"), ["classic"])
    with pytest.raises(ConfigurationError, match=r"^rig\.robot\.drive must be skid_steer: "):
        check_rig(rig_of("generic_differential"), ["classic"])
