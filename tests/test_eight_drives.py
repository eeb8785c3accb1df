# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The eight built-in experiments driven to their ends: lengths and durations of the paper, counts of every stream.

The drives are slow proofs; what needs none runs by default.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
import paper_topics
import pytest
from imu_integration import errors

from fieldtruth.bag import topics
from fieldtruth.bag.messages import ModelStatesWriter
from fieldtruth.core.transforms import rotation_from_quaternion_wxyz
from fieldtruth.drive.ground import bearing_field
from fieldtruth.drive.physics import resting_pose
from fieldtruth.drive.simulate import drive
from fieldtruth.drive.track import Track
from fieldtruth.experiment.config import Experiment, metres_from_route
from fieldtruth.experiment.files import load_experiment
from fieldtruth.experiment.names import campaign_experiments
from fieldtruth.record.streams import streams_of
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.wheel_odometry.config import WHEEL_SPEEDS
from fieldtruth.world.build import world_of
from fieldtruth.world.model import World


class Row(NamedTuple):
    """Length [m] and duration [s] of the paper's Table 4."""

    length: float
    duration: float


TABLE_4 = {
    "park_1": Row(76.08, 253), "park_2": Row(217.51, 718), "lake_1": Row(186.85, 622), "lake_2": Row(190.45, 634),
    "forest_1": Row(80.52, 269), "forest_2": Row(73.38, 245), "hillside_1": Row(153.10, 514),
    "hillside_2": Row(159.34, 511),
}  # fmt: skip


@cache
def world(environment: str) -> World:
    return world_of(load_experiment(f"{environment}_1"))


@cache
def driven(name: str) -> tuple[Experiment, World, Track]:
    """Drive an experiment; contact with an obstacle, tipping over, getting stuck or water would be a DriveError."""
    experiment = load_experiment(name)
    driven_world = world(experiment.environment)
    return experiment, driven_world, drive(driven_world, experiment)


eight = pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.slow) for name in TABLE_4])


def test_built_in_experiments_are_those_of_the_table() -> None:
    assert set(campaign_experiments(every=False)) == set(TABLE_4)


@pytest.mark.parametrize("name", TABLE_4)
def test_waypoints_are_5_to_20_m_apart(name: str) -> None:
    gaps = np.linalg.norm(np.diff(metres_from_route(load_experiment(name).route), axis=0), axis=1)
    assert gaps.max() <= 20.0
    assert np.median(gaps) >= 5.0


@eight
def test_length_and_duration_match_the_paper(name: str) -> None:
    _, _, track = driven(name)
    length = np.linalg.norm(np.diff(track.motion.position, axis=0), axis=1).sum()
    assert length == pytest.approx(TABLE_4[name].length, rel=0.02)
    assert track.duration_s == pytest.approx(TABLE_4[name].duration, rel=0.02)


@eight
def test_message_counts_are_duration_times_rate(name: str) -> None:
    experiment, driven_world, track = driven(name)
    rates = {
        topics.CLOCK: 1000, topics.MODEL_STATES: 1000, paper_topics.IMU: 50, paper_topics.NAVSAT: 2,
        paper_topics.POINTS: 10,
        **{name(side): 25 for name in (paper_topics.photograph, paper_topics.tag) for side in paper_topics.SIDES},
        **dict.fromkeys(WHEEL_SPEEDS, 10),
    }  # fmt: skip
    found = {topic: len(s.stamps_ns) for s in streams_of(driven_world, track, experiment.rig) for topic in s.topics}
    for topic, rate in rates.items():
        assert abs(found[topic] - rate * track.duration_s) <= 1, topic


@eight
def test_robot_tilts_with_the_ground(name: str) -> None:
    """Its up axis is the normal of the plane below its wheels within some degrees, since bumps tilt it further."""
    experiment, driven_world, track = driven(name)
    off = []
    for row in range(2000, len(track.motion.position), 5000):
        x_axis, up = rotation_from_quaternion_wxyz(track.motion.quaternion_wxyz[row])[:, [0, 2]].T
        _, resting = resting_pose(
            bearing_field(driven_world),
            track.motion.position[row, :2],
            float(np.arctan2(x_axis[1], x_axis[0])),
            experiment.rig,
        )
        ground_up = rotation_from_quaternion_wxyz(resting)[:, 2]
        off.append(np.degrees(np.arccos(np.clip(up @ ground_up, -1.0, 1.0))))
    assert np.median(off) < 1.0
    assert np.quantile(off, 0.95) < 4.0
    # One of four wheels on a stone of 8.25 cm, the highest that is no obstacle: the mean plane tilts by 4.1 deg about x
    # and 4.6 about y, the robot stands on three wheels, up to 6.2 deg from it, and its tyres yield.
    assert max(off) < (8.0 if name.startswith("hillside") else 6.0)


@pytest.mark.slow
def test_robot_tilts_on_the_hillside_and_not_in_the_park() -> None:
    tilt = {}
    for name in ("park_1", "hillside_1"):
        up = rotation_from_quaternion_wxyz(driven(name)[2].motion.quaternion_wxyz)[:, 2, 2]
        tilt[name] = np.degrees(np.arccos(np.clip(up, -1.0, 1.0)))
    assert tilt["park_1"].mean() < 3.0
    assert tilt["hillside_1"].mean() > 6.0
    # The steepest slope of a route, and a wheel on a stone; 16 on smooth ground.
    assert tilt["hillside_1"].max() < 13.0 + 7.0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["park_1", "lake_1", "forest_1", "hillside_1"])
def test_imu_readings_of_a_minute_integrate_to_the_pose(name: str) -> None:
    attitude, _, position = errors(driven(name)[2].motion.first(60_000), ImuConfig())
    assert attitude < 0.01
    assert position < 0.05


@pytest.mark.parametrize(
    "environment", ["park", *(pytest.param(name, marks=pytest.mark.slow) for name in ("lake", "forest", "hillside"))]
)
def test_model_states_message_is_below_64_kb(environment: str) -> None:
    """The window of LZ4 is 64 kB: longer messages of the 1 kHz stream would not be compressed against the last one."""
    assert len(ModelStatesWriter(world(environment)).template) < 65_536
