# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A drive that cannot succeed ends with one line: cause, time, position and waypoint."""

import re

import numpy as np
import pytest
from drive_worlds import F8, make_experiment, make_world, obstacle

from fieldtruth.core.errors import DriveError
from fieldtruth.drive.simulate import drive
from fieldtruth.experiment.config import ControlConfig
from fieldtruth.world.model import World

WHERE = (
    r" at (?P<t>[\d.]+) s, x, y = (?P<x>-?[\d.]+), (?P<y>-?[\d.]+) m, heading for waypoint (?P<k>\d+) of (?P<n>\d+)$"
)
QUICK = ControlConfig(speed=1.0)


def failure(world: World, *waypoints: tuple[float, float], **changes: object) -> tuple[str, float, float, float, str]:
    """Cause, time, position, and waypoint of how many."""
    with pytest.raises(DriveError) as caught:
        drive(world, make_experiment(waypoints, **changes))  # type: ignore[arg-type]
    text = str(caught.value)
    assert "\n" not in text
    found = re.search(WHERE, text)
    assert found is not None, text
    numbers = [float(found[k]) for k in "txy"]
    return text[: found.start()], numbers[0], numbers[1], numbers[2], f"{found['k']} of {found['n']}"


def test_wall_is_touched_by_the_front_of_the_robot() -> None:
    wall = obstacle("wall_7", "box", (0.4, 6.0, 1.0), 5.0, 0.0)
    what, when, x, y, waypoint = failure(make_world(obstacles=[wall]), (2.9, 0.0), (9.0, 0.0))
    assert what == "robot touched wall_7"
    assert x == pytest.approx(5.0 - 0.2 - 0.495, abs=0.02)
    assert y == pytest.approx(0.0, abs=0.02)
    assert when == pytest.approx(x / 0.3 + 0.05, abs=0.1)
    assert waypoint == "2 of 2"


def test_trunk_beside_the_path_is_touched_by_the_side() -> None:
    near = make_world(obstacles=[obstacle("oak_1", "cylinder", (0.2, 4.0), 4.0, 0.52)])
    assert failure(near, (9.0, 0.0), control=QUICK)[0] == "robot touched oak_1"
    clear = make_world(obstacles=[obstacle("oak_1", "cylinder", (0.2, 4.0), 4.0, 0.57)])
    drive(clear, make_experiment([(9.0, 0.0)], control=QUICK))


def test_mast_collides_with_a_table() -> None:
    table = obstacle("table_3", "box", (1.0, 1.0, 0.05), 4.0, 0.0, z=0.7)
    assert failure(make_world(obstacles=[table]), (9.0, 0.0), control=QUICK)[0] == "robot touched table_3"
    branch = obstacle("branch", "box", (1.0, 1.0, 0.05), 4.0, 0.0, z=1.05)
    drive(make_world(obstacles=[branch]), make_experiment([(9.0, 0.0)], control=QUICK))


def test_start_inside_an_obstacle_fails_at_time_0() -> None:
    bin_here = obstacle("bin_2", "cylinder", (0.3, 1.0), 0.3, 0.0)
    what, when, *_ = failure(make_world(obstacles=[bin_here]), (9.0, 0.0))
    assert (what, when) == ("robot touched bin_2", 0.0)


def test_route_out_of_the_world_fails_at_the_edge() -> None:
    what, _, x, _, waypoint = failure(make_world(size=(10.0, 10.0)), (2.5, 0.0), (8.0, 0.0))
    assert what == "robot outside the world"
    assert x == pytest.approx(5.0, abs=0.02)
    assert waypoint == "2 of 2"


def test_start_outside_the_world_fails_at_time_0() -> None:
    what, when, *_ = failure(make_world(size=(10.0, 10.0)), (0.0, 0.0), start=(8.0, 0.0))
    assert (what, when) == ("robot outside the world", 0.0)


def test_robot_tips_over_at_a_cliff() -> None:
    def cliff(x: F8, y: F8) -> F8:
        return np.where(x < 3.0, 0.0, -3.0) + 0.0 * y

    what, _, x, _, _ = failure(make_world(cliff), (9.0, 0.0), control=ControlConfig(speed=1.0))
    assert what == "robot tipped over"
    assert 2.5 < x < 4.5


def test_robot_gets_stuck_in_a_pit() -> None:
    def pit(x: F8, y: F8) -> F8:
        return np.where(np.hypot(x, y) < 1.2, 0.0, 1.5)

    what, when, x, y, _ = failure(make_world(pit), (9.0, 0.0))
    assert what == "robot stuck (moved less than 0.3 m in 5 s)"
    assert when < 20.0
    assert np.hypot(x, y) < 1.2


@pytest.mark.slow
def test_circling_a_waypoint_counts_as_stuck() -> None:
    control = ControlConfig(speed=1.0, max_turn_rate=0.6, arrival_distance=0.5)
    what, *_, waypoint = failure(make_world(), (3.0, 0.0), (3.0, 2.0), control=control)
    assert what == "robot stuck (no closer to its waypoint for 40 s)"
    assert waypoint == "2 of 2"
