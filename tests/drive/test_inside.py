# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Motions through the ground, water and obstacles are named with time, depth, object and position."""

import numpy as np
import pytest
from drive_worlds import make_world, obstacle

from fieldtruth.core.errors import TrackError
from fieldtruth.experiment.rig import Rig, paper_rig
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.simulation.motion import check_motion, motion_along
from fieldtruth.world.model import World

BARE = paper_rig(cameras=StereoConfig(enabled=False), lidar=LidarConfig(enabled=False))
WALL = make_world(
    obstacles=[
        obstacle("pole", "cylinder", (0.5, 2.0), 6.0, 0.0, scale=2.0),
        obstacle("table", "box", (4.0, 0.2, 1.0), 6.0, 5.0, yaw=90.0),
    ]
)


def fly(
    world: World, start: tuple[float, float, float], end: tuple[float, float, float], rig: Rig = BARE, **how: bool
) -> None:
    """Fly ten seconds on a straight line, facing north, with stamps from 100 s on."""
    stamps = np.arange(100, 111, dtype=np.int64) * 10**9
    motion = motion_along(stamps, np.linspace(start, end, 11), np.tile((1.0, 0.0, 0.0, 0.0), (11, 1)), int(stamps[0]))
    check_motion(world, motion, rig, "flight.csv", int(stamps[0]), allow_inside=how.get("allow_inside", False))


def refusal(*arguments: object) -> str:
    with pytest.raises(TrackError) as error:
        fly(*arguments)  # type: ignore[arg-type]
    return str(error.value).removesuffix("; drive: {allow_inside: true} senses there")


def test_below_the_ground() -> None:
    slope = make_world(lambda x, y: 0.1 * x)
    text = refusal(slope, (0.0, -1.0, 0.45), (10.0, -1.0, 0.45))  # the ground is as high at x 4.5 m, after 4.5 s
    where = "at x 10.00 m, y -1.00 m, z 0.45 m"
    assert text == f"flight.csv: from 104.501 s on base_link is below the ground, up to 0.55 m {where}"
    fly(slope, (0.0, -1.0, 0.45), (4.4, -1.0, 0.45))
    fly(slope, (0.0, -1.0, 0.45), (10.0, -1.0, 0.45), allow_inside=True)


def test_inside_a_scaled_cylinder() -> None:
    text = refusal(WALL, (0.0, 0.0, 1.0), (10.0, 0.0, 1.0))  # from x 5 m on, as the scale is 2
    assert "from 105.001 s on base_link is inside the object 'pole', up to 1.00 m at x 6.00 m" in text
    fly(WALL, (0.0, 0.0, 4.01), (10.0, 0.0, 4.01))
    fly(WALL, (0.0, 1.01, 1.0), (10.0, 1.01, 1.0))
    assert "'pole'" in refusal(WALL, (0.0, 0.99, 3.9), (10.0, 0.99, 3.9))


def test_inside_a_turned_box() -> None:
    """4 m along y and 0.2 m along x after the turn."""
    text = refusal(WALL, (0.0, 6.9, 0.9), (10.0, 6.9, 0.9))
    assert "from 105.901 s on base_link is inside the object 'table', up to 0.10 m at x 6.00 m" in text
    fly(WALL, (0.0, 7.1, 0.9), (10.0, 7.1, 0.9))
    fly(WALL, (0.0, 6.9, 1.1), (10.0, 6.9, 1.1))


def test_the_sensors_count_where_they_are() -> None:
    lidar = paper_rig(cameras=StereoConfig(enabled=False))
    above = make_world(obstacles=[obstacle("bar", "box", (0.2, 0.2, 0.2), 6.0, 0.0, z=1.7)])
    fly(above, (0.0, 0.0, 1.0), (10.0, 0.0, 1.0))
    assert "os1_lidar is" in refusal(above, (0.0, 0.0, 1.0), (10.0, 0.0, 1.0), lidar)
    beside = refusal(above, (0.0, -0.1, 1.1), (10.0, -0.1, 1.1), paper_rig(lidar=LidarConfig(enabled=False)))
    assert "left_camera is inside the object 'bar', up to 0.06 m" in beside


def test_the_first_time_counts_whatever_is_checked_first() -> None:
    valley = make_world(
        lambda x, y: np.where(x > 8.0, 5.0, 0.0), obstacles=[obstacle("tree", "cylinder", (0.5, 3.0), 3, 0)]
    )
    assert "'tree'" in refusal(valley, (0.0, 0.0, 1.0), (10.0, 0.0, 1.0))


def test_under_water_and_only_where_there_is_water() -> None:
    lake = make_world(lambda x, y: np.where(x < 0.0, -2.0, 0.0), water_level=-0.5)
    text = refusal(lake, (-10.0, 0.0, 1.0), (-5.0, 0.0, -1.0))
    assert "base_link is under water, up to 0.50 m at x -5.00 m" in text
    fly(lake, (-10.0, 0.0, 1.0), (-5.0, 0.0, -0.4))


def test_outside_the_world_even_if_it_may_be_inside() -> None:
    with pytest.raises(TrackError) as error:
        fly(make_world(), (0.0, 0.0, 1.0), (0.0, -20.0, 1.0), allow_inside=True)
    assert str(error.value) == (
        "flight.csv: at 105.001 s base_link is at x 0.00 m, y -10.00 m, z 1.00 m, outside the world test, "
        "which spans x -20 to 20 m, y -10 to 10 m"
    )
