# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A drive that goes back to earlier waypoints and on along others equals one that knew its route, bit for bit."""

import numpy as np
import pytest
from drive_worlds import F8, hills, make_experiment, make_world, obstacle, with_stones
from sense_worlds import at, box

from fieldtruth.core.errors import DriveError
from fieldtruth.drive import surroundings
from fieldtruth.drive.plan import TrialDrive
from fieldtruth.drive.simulate import drive
from fieldtruth.drive.track import Track
from fieldtruth.experiment.config import ControlConfig, route_from_metres
from fieldtruth.world.model import World

ROUTE = np.array([(-10.0, -3.0), (-6.0, -3.0), (-2.0, -1.0), (1.0, 2.0), (-2.0, 4.0), (-5.0, 2.0)])
ELSEWHERE = np.array([(-10.0, -3.0), (-6.0, -3.0), (-2.0, -4.0), (3.0, -5.0)])


def stony_hills() -> World:
    """Hills with stones that shake the robot, and a wall at x = 6 m."""
    world = make_world(hills, size=(34.0, 20.0), obstacles=[obstacle("wall", "box", (0.3, 20.0, 1.0), 6.0, 0.0)])
    xy = np.random.default_rng(4).uniform((-12, -8), (4, 8), (150, 2))
    poses = np.array([at(x, y, float(world.terrain.field.height_at(x, y))) for x, y in xy])
    return with_stones(world, [box("stone", [0.1, 0.1, 0.05], "rock_granite")], [0] * 150, poses)


@pytest.fixture(params=[pytest.param("one part", marks=pytest.mark.slow), "parts"])
def world(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> World:
    if request.param == "parts":
        monkeypatch.setattr("fieldtruth.drive.ground.WHOLE", 20.0)
        monkeypatch.setattr(surroundings, "REACH", 7.0)
    return stony_hills()


def driven(world: World, corners: F8, speed: float = 0.3) -> Track:
    route = route_from_metres(corners[0].tolist(), corners[1:].tolist())
    return drive(
        world, make_experiment([(5.0, 0.0)], control=ControlConfig(speed=speed)).model_copy(update={"route": route})
    )


def trial_of(world: World, speed: float = 0.3) -> TrialDrive:
    return TrialDrive(world, make_experiment([(5.0, 0.0)], control=ControlConfig(speed=speed)))


def assert_equal(track: Track, expected: Track) -> None:
    for ours, theirs in (
        (track.swept.position, expected.swept.position),
        (track.swept.quaternion_wxyz, expected.swept.quaternion_wxyz),
        (track.swept.angular_velocity, expected.swept.angular_velocity),
    ):
        np.testing.assert_array_equal(ours, theirs)
    assert track.base is not None
    assert expected.base is not None
    np.testing.assert_array_equal(track.base.commands.command, expected.base.commands.command)
    np.testing.assert_array_equal(track.base.wheels.speed, expected.base.wheels.speed)


def test_waypoints_that_are_added_one_by_one_make_the_same_drive(world: World) -> None:
    trial = trial_of(world, 0.8)
    for count in range(2, 5):
        assert trial.reached(ROUTE[:count]) == count - 1
    assert_equal(trial.finish(), driven(world, ROUTE[:4], 0.8))


@pytest.mark.slow
def test_a_drive_goes_back_from_another_route_and_from_a_failure(world: World) -> None:
    trial = trial_of(world)
    assert trial.reached(ELSEWHERE) == 3
    assert trial.reached(ROUTE[:4]) == 3
    assert trial.reached(np.vstack([ROUTE[:4], (9.0, 2.0)])) == 3  # behind the wall
    assert trial.reached(np.vstack([ROUTE[:2], (9.0, -1.0), (12.0, 0.0)])) == 1
    assert trial.reached(ROUTE[::-1]) == 5
    assert trial.reached(ROUTE) == 5
    assert_equal(trial.finish(), driven(world, ROUTE))


def test_the_first_waypoint_may_be_out_of_reach() -> None:
    trial = trial_of(stony_hills())
    assert trial.reached(np.array([(4.0, 0.0), (9.0, 0.0)])) == 0
    assert trial.reached(np.array([(6.0, 0.0), (9.0, 0.0)])) == 0  # it stands in the wall
    with pytest.raises(DriveError):
        trial.finish()
