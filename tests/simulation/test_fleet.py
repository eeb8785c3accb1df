# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Robots that are stepped together: they see each other, touch each other, and are equal however they are stepped."""

from typing import Any

import numpy as np
import pytest
from sense_worlds import make_world

from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError, DriveError, UnknownNameError
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.rig import body_parts
from fieldtruth.sense.robot import part_table
from fieldtruth.simulation.due import Frame
from fieldtruth.simulation.fleet import Fleet
from fieldtruth.simulation.stepped import Simulation
from fieldtruth.world.model import World

RIG = {
    "sensors": [
        {"kind": "imu"},
        {"kind": "gnss"},
        {"kind": "lidar", "columns": 512, "rings": 32, "max_range": 30.0},
    ]
}


def route(*points: tuple[float, float]) -> dict[str, Any]:
    return {"metres": {"start": points[0], "waypoints": points[1:]}}


def duo(leader: dict[str, Any], follower: dict[str, Any], **values: Any) -> Experiment:
    """Two robots with a LiDAR each."""
    given = {"name": "duo", "environment": "park", "rig": RIG, "robots": {"leader": leader, "follower": follower}}
    return Experiment.model_validate(given | values)


@pytest.fixture(name="world", scope="module")
def _world() -> World:
    return make_world()


def driven(fleet: Fleet, seconds: list[float]) -> dict[str, list[Frame]]:
    frames: dict[str, list[Frame]] = {name: [] for name in fleet.robots}
    fleet.reset()
    for each in seconds:
        for name, frame in fleet.step(each).items():
            frames[name].append(frame)
    return frames


def clouds(frames: list[Frame]) -> list[Any]:
    return [cloud for frame in frames for cloud in frame.all.get("lidar", ())]
