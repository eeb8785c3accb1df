# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A stretch over a spot: its costs on planes in closed form, and why the robot does not pass where drives fail."""

import math

import numpy as np
import pytest
from drive_worlds import F8, make_world, obstacle, tilted
from soil_slip import climbing_slip

from fieldtruth.cost.stretch import Cause, Passage, SpotRobot
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import GRAVITY, RobotConfig
from fieldtruth.world.model import World


def over(
    world: World,
    at: tuple[float, float] = (0.0, 0.0),
    heading_deg: float = 0.0,
    speed: float = 1.0,
    robot: str = "husky",
) -> tuple[Cause, Passage]:
    """Drive over a spot."""
    spot = np.array(at)
    rig = Rig.model_validate({"robot": robot})
    return SpotRobot(world, rig, spot).over(spot, math.radians(heading_deg), speed)


@pytest.mark.parametrize(("ground_type", "slope_deg"), [("scree", 13.0), ("sand", 5.0), ("stony_soil", 13.0)])
def test_slip_uphill_is_that_of_the_closed_form(ground_type: str, slope_deg: float) -> None:
    cause, costs = over(make_world(tilted(slope_deg, 0.0), ground_type=ground_type), speed=0.3)
    assert cause == Cause.PASSES
    assert costs.slip == pytest.approx(
        climbing_slip(ground_type, slope_deg), rel=0.01, abs=0.003
    )  # steps of 5 ms: 0.002
    assert costs.tilt == pytest.approx(math.radians(slope_deg), abs=0.025)  # the wheels at the rear sink more


def test_uphill_and_downhill_differ_by_the_weight_times_the_height() -> None:
    """On a slope so gentle that the motors push downhill, too; slip divides their work by 1 less it."""
    world, robot = make_world(tilted(1.0, 0.0), ground_type="lawn"), RobotConfig()
    (_, up), (_, down), (_, level) = over(world), over(world, heading_deg=180.0), over(world, heading_deg=90.0)
    work = up.energy * (1 - up.slip) - down.energy * (1 - down.slip)
    assert work == pytest.approx(2 * robot.mass * GRAVITY * math.tan(math.radians(1.0)), rel=0.03)
    assert down.energy < level.energy < up.energy
    assert up.time == pytest.approx(1.0 / (1 - up.slip), rel=0.005)


def test_opposite_headings_on_level_ground_are_alike() -> None:
    (_, there), (_, back) = over(make_world()), over(make_world(), heading_deg=180.0)
    np.testing.assert_allclose(there, back, rtol=0.02, atol=0.002)
    assert there.peak < 0.2


def step(x: F8, y: F8) -> F8:
    """Ground that is 12 cm higher from x = 0 on."""
    return np.where(x < 0.0, 0.0, 0.12) + 0.0 * y


def test_a_step_of_12_cm_stops_a_husky_and_not_a_warthog() -> None:
    world = make_world(step, size=(20.0, 20.0), spacing=0.05, ground_type="lawn")
    assert over(world, speed=0.3)[0] == Cause.STUCK
    assert over(world, speed=0.3, robot="warthog")[0] == Cause.PASSES
    assert over(world, heading_deg=180.0, speed=0.3)[0] == Cause.PASSES  # down
    assert over(world, (-3.0, 0.0), speed=0.3)[0] == Cause.PASSES


def cliff(x: F8, y: F8) -> F8:
    return np.where(x < 3.0, 0.0, -3.0) + 0.0 * y


def pit(x: F8, y: F8) -> F8:
    return np.where(np.hypot(x, y) < 1.2, 0.0, 1.5)


@pytest.mark.parametrize(
    ("world", "at", "cause"),
    [
        (make_world(obstacles=[obstacle("wall", "box", (0.4, 6.0, 1.0), 5.0, 0.0)]), (4.3, 0.0), {Cause.HULL}),
        (make_world(obstacles=[obstacle("oak", "cylinder", (0.2, 4.0), 4.0, 0.52)]), (4.0, 0.0), {Cause.HULL}),
        (make_world(obstacles=[obstacle("oak", "cylinder", (0.2, 4.0), 4.0, 0.6)]), (4.0, 0.0), {Cause.PASSES}),
        (make_world(obstacles=[obstacle("table", "box", (1.0, 1.0, 0.05), 4.0, 0.0, z=0.7)]), (3.5, 0.0), {Cause.HULL}),
        (make_world(size=(10.0, 10.0)), (4.8, 0.0), {Cause.OUTSIDE}),
        (make_world(cliff), (3.2, 0.0), {Cause.DROPS, Cause.TIPS}),
        (make_world(pit), (0.5, 0.0), {Cause.STUCK, Cause.SLIPS, Cause.TIPS, Cause.DROPS}),
        (make_world(tilted(13.0, 0.0), ground_type="sand"), (0.0, 0.0), {Cause.SLIPS, Cause.STUCK}),
        (make_world(tilted(10.0, 0.0), water_level=0.0), (-1.0, 0.0), {Cause.WATER}),
    ],
    ids=["wall", "trunk", "beside a trunk", "table", "edge", "cliff", "pit", "sand uphill", "water"],
)
def test_where_drives_fail_the_robot_does_not_pass(world: World, at: tuple[float, float], cause: set[Cause]) -> None:
    found, costs = over(world, at)
    assert found in cause
    assert np.isnan(costs).all() == (found != Cause.PASSES)


def test_a_robot_that_was_elsewhere_finds_equal_bits() -> None:
    world = make_world(tilted(5.0, 2.0), ground_type="sand")
    robot, spot = SpotRobot(world, Rig(), np.zeros(2)), np.array([1.0, 1.0])
    first = robot.over(spot, 0.7, 1.0)
    robot.over(np.array([-4.0, 2.0]), 3.0, 0.4)
    robot.over(np.array([19.5, 2.0]), 0.0, 1.0)
    assert robot.over(spot, 0.7, 1.0) == first == SpotRobot(world, Rig(), np.zeros(2)).over(spot, 0.7, 1.0)


def test_a_sweep_finds_on_a_plane_what_each_spot_does() -> None:
    """Slip is that of the closed form all along."""
    robot = SpotRobot(make_world(tilted(13.0, 0.0), ground_type="scree"), Rig(), np.zeros(2))
    for cause, costs in robot.sweep(np.array([-1.0, 0.5]), 0.25 * np.arange(8.0), 0.0, 0.3):
        assert cause == Cause.PASSES
        assert costs.slip == pytest.approx(climbing_slip("scree", 13.0), rel=0.01)


def test_across_a_slope_the_robot_holds_its_line() -> None:
    """A heading alone would let it slide down, to the right of x, without end."""
    robot = SpotRobot(make_world(tilted(0.0, 8.0), ground_type="lawn"), Rig(), np.zeros(2))
    robot.sweep(np.array([-6.0, 0.5]), np.array([0.0, 12.0]), 0.0, 1.0)
    assert robot._physics.pose[0][0] > 6.4
    assert abs(robot._physics.pose[0][1] - 0.5) < 0.06


def test_where_a_sweep_fails_spots_are_driven_singly_and_it_begins_anew() -> None:
    """A post at x = 0: the front touches it from 0.6 m before; hit or started in are spots from -1 m to 1.5 m."""
    world = make_world(obstacles=[obstacle("post", "box", (0.1, 0.1, 1.0), 0.0, 0.0)])
    robot, spots = SpotRobot(world, Rig(), np.zeros(2)), 0.5 * np.arange(12.0)
    swept = robot.sweep(np.array([-3.0, 0.0]), spots, 0.0, 1.0)
    alone = [robot.sweep(np.array([-3.0, 0.0]), spots[k : k + 1], 0.0, 1.0)[0] for k in range(len(spots))]
    causes = [cause for cause, _ in swept]
    assert causes == [cause for cause, _ in alone]
    assert causes.count(Cause.HULL) == 5
    behind = len(causes) - causes[::-1].index(Cause.HULL)
    assert swept[behind] == alone[behind]  # the first of the sweep that begins anew
    np.testing.assert_allclose([costs.energy for _, costs in swept], [costs.energy for _, costs in alone], rtol=0.03)


def test_a_sweep_ends_where_it_is_stuck_and_at_the_edge_of_the_world() -> None:
    world = make_world(lambda x, y: np.where(x < 1.0, 0.0, 0.5) + 0.0 * y, size=(10.0, 10.0), spacing=0.05)
    spots = 0.5 * np.arange(19.0)
    found = SpotRobot(world, Rig(), np.zeros(2)).sweep(np.array([-4.5, 0.0]), spots, 0.0, 1.0)
    causes = {x: cause for x, (cause, _) in zip((spots - 4.5).tolist(), found, strict=True)}
    assert {causes[x] for x in (-4.5, -4.0, 4.5)} == {Cause.OUTSIDE, Cause.PASSES}
    assert causes[-4.5] == Cause.OUTSIDE  # where it would start
    assert {causes[x] for x in (-3.5, -2.0, -0.5, 2.5, 4.0)} == {Cause.PASSES}
    assert {causes[x] for x in (0.5, 1.0)} <= {Cause.STUCK, Cause.SLIPS}
