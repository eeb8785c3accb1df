# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The waypoint follower, without physics."""

import numpy as np
import pytest

from fieldtruth.core.geodesy import geodetic_from_world
from fieldtruth.drive.controller import WaypointFollower, horizontal_from_geodetic
from fieldtruth.experiment.config import ControlConfig

GAINS = ControlConfig(speed=0.3, heading_gain=0.8, max_turn_rate=0.5, arrival_distance=2.0)


def geodetic(*points: tuple[float, float]) -> list[tuple[float, float]]:
    world = np.column_stack([np.array(points), np.zeros(len(points))])
    return [(float(p[0]), float(p[1])) for p in geodetic_from_world(world)]


def follower(*waypoints: tuple[float, float], at: tuple[float, float] = (0.0, 0.0)) -> WaypointFollower:
    made = WaypointFollower(geodetic(*waypoints), GAINS)
    made.update_fix(*geodetic(at)[0])
    return made


def test_geodetic_waypoints_are_converted_to_metres() -> None:
    points = [(48.0, -24.0), (-50.0, 25.0), (0.0, 0.0)]
    np.testing.assert_allclose(horizontal_from_geodetic(geodetic(*points)), points, atol=1e-3)


@pytest.mark.parametrize(
    ("target", "heading_deg", "error_deg"),
    [
        ((10.0, 0.0), 0.0, 0.0),
        ((10.0, 0.0), 20.0, -20.0),  # heading too far left: turn right
        ((10.0, 0.0), -20.0, 20.0),
        ((0.0, 10.0), 70.0, 20.0),  # target in the west, which is left of north
        ((0.0, -10.0), -70.0, -20.0),
        ((-10.0, 0.001), 170.0, 10.0),  # due south, at the wrap
        ((-10.0, 0.001), -170.0, -10.0),
        ((-10.0, -0.001), 170.0, 10.0),
        ((-10.0, -0.001), 350.0, -170.0),
    ],
)
def test_turn_rate_is_proportional_to_the_heading_error(
    target: tuple[float, float], heading_deg: float, error_deg: float
) -> None:
    command = follower(target).command(np.deg2rad(heading_deg))
    wanted = np.clip(0.8 * np.deg2rad(error_deg), -0.5, 0.5)
    assert command.turn_rate == pytest.approx(wanted, abs=2e-4)
    assert command.speed == 0.3


def test_turn_rate_is_limited_to_both_sides() -> None:
    assert follower((0.0, 10.0)).command(0.0).turn_rate == 0.5
    assert follower((0.0, -10.0)).command(0.0).turn_rate == -0.5


def test_next_waypoint_is_taken_below_the_arrival_distance() -> None:
    driver = follower((10.0, 0.0), (10.0, 10.0))
    driver.update_fix(*geodetic((7.99, 0.0))[0])
    assert driver.target == 0
    driver.update_fix(*geodetic((8.01, 0.0))[0])
    assert driver.target == 1
    assert driver.command(0.0).turn_rate > 0


def test_waypoints_within_the_arrival_distance_are_skipped() -> None:
    assert follower((1.0, 0.0), (0.0, 1.5), (9.0, 0.0)).target == 2


def test_robot_stops_at_the_last_waypoint() -> None:
    driver = follower((10.0, 0.0))
    assert not driver.finished
    driver.update_fix(*geodetic((9.0, 1.0))[0])
    assert driver.finished
    assert driver.command(1.0) == (0.0, 0.0)
    driver.update_fix(*geodetic((0.0, 0.0))[0])  # and does not start again
    assert driver.finished
