# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot on soils: sinkage, resistance and slip of the simulation against the closed forms of the law."""

import dataclasses
from functools import cache

import mujoco
import numpy as np
import pytest
from drive_worlds import F8, make_experiment, make_robot, make_world, tilted
from soil_slip import LOAD, TYRE, climbing_slip

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.drive.physics import STOP, Command
from fieldtruth.drive.simulate import SimulatedRobot, drive
from fieldtruth.drive.soil import SOILS, SoilContact, soil_rows
from fieldtruth.experiment.robot_config import WheelConfig
from fieldtruth.kernels.soil import compaction, sinkage
from fieldtruth.world.materials import GROUND_TYPES
from fieldtruth.world.model import Raster, World

RADIUS = WheelConfig().radius


def robot_on(ground_type: str, slope_deg: float = 0.0, *, yaw_deg: float = 0.0) -> SimulatedRobot:
    """Settled, in a world of one ground type."""
    world = make_world(tilted(slope_deg, 0.0), ground_type=ground_type)
    return make_robot(world, yaw_deg=yaw_deg, soil=SoilContact(world, WheelConfig(), {}))


def slip(states: F8) -> float:
    """Slip of a straight drive: above 0 when driven, below 0 when braked."""
    return float(1 - np.linalg.norm(states[:, 7:10], axis=1).mean() / (states[:, 13:17].mean() * RADIUS))


@cache
def driven(ground_type: str, slope_deg: float) -> F8:
    """States of the last seconds of a straight drive along x at constant speed."""
    robot = robot_on(ground_type, slope_deg)
    robot.advance(Command(0.3, 0.0), 2500)
    return robot.advance(Command(0.3, 0.0), 1000)


def test_every_ground_type_has_a_soil() -> None:
    assert set(GROUND_TYPES) <= set(SOILS)


@pytest.mark.parametrize("ground_type", ["sand", "lawn"])
def test_robot_at_rest_is_lowered_by_bekkers_sinkage(ground_type: str) -> None:
    depth = sinkage(LOAD, TYRE, soil_rows((ground_type,))[0])
    height = robot_on(ground_type).advance(STOP, 1)[-1, 2]
    assert height == pytest.approx(0.13228 - depth, abs=2e-5 + 0.003 * depth)


@pytest.mark.parametrize(
    ("ground_type", "slope_deg", "least", "most"),
    [
        ("paving", 13.0, 0.01, 0.02), ("stony_soil", 13.0, 0.02, 0.06), ("scree", 13.0, 0.2, 0.6),
        ("sand", 5.0, 0.2, 0.6), ("lawn", 0.0, 0.002, 0.01), ("mud", 0.0, 0.04, 0.1),
    ],
)  # fmt: skip
def test_slip_is_that_of_the_closed_form(ground_type: str, slope_deg: float, least: float, most: float) -> None:
    """Below 2 % uphill on paving, tens of per cent on scree and sand."""
    found = slip(driven(ground_type, slope_deg))
    assert found == pytest.approx(climbing_slip(ground_type, slope_deg), rel=0.02)
    assert least < found < most


def test_downhill_the_wheels_brake() -> None:
    """The robot is faster than its treads; resistance helps, so it slips less than uphill."""
    down, up = slip(driven("scree", -13.0)), slip(driven("scree", 13.0))
    assert -up < down < -0.1


@pytest.mark.parametrize("ground_type", ["paving", "earth", "scree"])
def test_constant_soil_does_not_shake_the_robot(ground_type: str) -> None:
    robot = robot_on(ground_type)
    robot.advance(Command(0.3, 0.3), 2000)
    for states in (driven(ground_type, 13.0), robot.advance(Command(0.3, 0.3), 1000)):
        assert np.std(np.diff(states[:, 9]) / 0.001) < 1e-3


@pytest.mark.parametrize("ground_type", ["paving", "scree", "mud"])
def test_standing_robot_does_not_creep_down_a_slope(ground_type: str) -> None:
    states = robot_on(ground_type, 13.0).advance(STOP, 1000)
    assert np.linalg.norm(states[-1, :3] - states[0, :3]) < 1e-5  # [m] in a second


@pytest.mark.parametrize("ground_type", ["paving", "meadow", "earth"])
def test_coasting_robot_decelerates_by_its_resistance(ground_type: str) -> None:
    """Mass and the wheels' inertia (0.04411 kg m^2 and the rotor's 0.1) share the resistance of tyre and soil."""
    soil = soil_rows((ground_type,))[0]
    resistance = 4 * (compaction(LOAD, sinkage(LOAD, TYRE, soil), TYRE, soil) + soil[6] * LOAD)
    robot = robot_on(ground_type)
    robot.advance(Command(1.0, 0.0), 1500)
    robot.surroundings.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    robot.advance(STOP, 200)  # until the slip of driving and its rut are behind
    speed = robot.advance(STOP, 200)[:, 7]
    expected = resistance / (50.0 + 4 * (0.04411 + 0.1) / RADIUS**2)
    assert (speed[0] - speed[-1]) / 0.199 == pytest.approx(expected, rel=0.02)


def test_turn_in_place_is_slower_the_softer_the_soil() -> None:
    """The compensation of skid steering holds without resistance, on soil of any strength; resistance takes some."""
    rates = {}
    for ground_type in ("paving", "lawn", "forest_floor", "sand"):
        robot = robot_on(ground_type)
        robot.advance(Command(0.0, 0.5), 2000)
        rates[ground_type] = robot.advance(Command(0.0, 0.5), 500)[:, 12].mean()
    assert 0.49 < rates["paving"] < 0.5
    assert 0.46 < rates["lawn"] < 0.48
    assert 0.38 < rates["forest_floor"] < 0.44
    assert 0.25 < rates["sand"] < 0.35


def test_follower_reaches_its_waypoints_on_mud() -> None:
    world = make_world(ground_type="mud")
    track = drive(world, make_experiment([(3.0, 1.5), (5.0, -1.0)]))
    assert np.linalg.norm(track.motion.position[-1, :2] - (5.0, -1.0)) < 2.1


def test_soil_of_a_ground_type_can_be_replaced() -> None:
    world = make_world(ground_type="gravel")
    track = {
        soil: drive(world, make_experiment([(9.0, 0.0)], seconds=2.0, soil={"gravel": soil}))
        for soil in ("sand", "paving")
    }
    assert track["sand"].length_m < 0.9 * track["paving"].length_m


@pytest.mark.parametrize(
    ("soil", "message"),
    [
        ({"gravle": "sand"}, "soil: test has no ground type 'gravle'; did you mean 'gravel'? Available: gravel"),
        ({"gravel": "sandy"}, "soil.gravel: unknown soil 'sandy'; did you mean 'sand'? Available: paving, rock, "),
    ],
)
def test_unknown_names_give_one_clear_line(soil: dict[str, str], message: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        drive(make_world(ground_type="gravel"), make_experiment([(9.0, 0.0)], soil=soil))
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


def test_no_force_jumps_at_the_edge_of_two_soils() -> None:
    """From paving onto sand: the robot is lowered by 2 cm, but smoothly."""
    world = make_world(ground_type="paving")
    sand = dataclasses.replace(world.materials["soil"], name="sand", ground_type="sand")
    cover = np.zeros((400, 2, 2), np.float32)
    cover[:220, :, 0] = cover[220:, :, 1] = 1.0
    terrain = dataclasses.replace(
        world.terrain,
        cover=Raster(values=cover, spacing=0.1, x0=-20.0, y0=-0.05),
        ground_materials=("soil", "sand"),
    )
    mixed: World = dataclasses.replace(world, terrain=terrain, materials={**world.materials, "sand": sand})
    robot = make_robot(mixed, (0.5, 0.0), soil=SoilContact(mixed, WheelConfig(), {}))
    states = robot.advance(Command(0.3, 0.0), 8000)
    acceleration = np.diff(states[1000:, 9]) / 0.001
    assert states[-1, 2] < 0.13228 - 0.02
    assert np.abs(acceleration).max() < 1.0
    assert np.abs(np.diff(acceleration)).max() < 0.05
