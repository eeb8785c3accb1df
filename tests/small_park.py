# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A park of 24 m with one or two objects of each kind, for all that does not need a full world."""

from typing import Any, Final

from kept_worlds import KEPT

from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.rig import paper_rig
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.world.model import World

_ONE_OF_EACH = ("large_trees", "small_trees", "benches", "lamp_posts", "tables", "trash_bins", "individuals")
LAYOUT: Final[dict[str, Any]] = {
    "size": [24.0, 24.0], "trails": [[[-14.0, -6.0], [14.0, -6.0]]], "bushes": 2, **dict.fromkeys(_ONE_OF_EACH, 1),
}  # fmt: skip
ROUTE: Final = {"metres": {"start": [-6.0, 0.0], "waypoints": [[2.0, 0.0], [2.0, 8.0]]}}
RIG: Final = paper_rig(cameras=StereoConfig(width=64, height=48), lidar=LidarConfig(columns=64, rings=16))


def small_park() -> World:
    """The world, made once in a process, which runs in it have as well where their worlds are kept."""
    return KEPT.world_of(in_small_park())


def in_small_park(**values: Any) -> Experiment:
    """An experiment in the small park; ``values`` replace or add keys."""
    usual = {"name": "small", "environment": "park", "layout": LAYOUT, "route": ROUTE}
    return Experiment.model_validate(usual | values)
