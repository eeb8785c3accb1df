# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A small park, a plain, and an experiment and a rig for them."""

from dataclasses import replace
from functools import cache

import numpy as np

from fieldtruth.experiment.config import Experiment, route_from_metres
from fieldtruth.experiment.rig import paper_rig
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.world.environments.park.build import build as build_park
from fieldtruth.world.environments.park.config import Config as ParkConfig
from fieldtruth.world.model import Heightfield, Raster, World

RIG = paper_rig(cameras=StereoConfig(width=64, height=48), lidar=LidarConfig(columns=64, rings=16))
EXPERIMENT = Experiment(
    name="small_1", environment="park", rig=RIG, route=route_from_metres((-8.0, 0.0), [(0.0, 0.0), (8.0, 0.0)])
)


@cache
def small_park() -> World:
    """A park of 24 m with one or two objects of each kind."""
    config = ParkConfig(
        size=(24.0, 24.0), trails=(((-14, -6), (14, -6)),), large_trees=1, small_trees=1, bushes=2, benches=1,
        lamp_posts=1, tables=1, trash_bins=1, individuals=1,
    )  # fmt: skip
    return build_park(0, [], config)


def plain(side: float = 8000.0, *, height: float = 0.0, trail_north_of_0: bool = False) -> World:
    """Flat ground without objects; optionally, everything north of x = 0 is trail."""
    park, half = small_park(), side / 2
    x = np.array([half, -half] if trail_north_of_0 else [1.0, 1.0], np.float32)
    ground = Heightfield(heights=np.full((2, 2), height, np.float32), spacing=side, x0=-half, y0=-half)
    trail = Raster(values=np.column_stack([x, x]), spacing=side, x0=-half, y0=-half)
    terrain = replace(park.terrain, field=ground, layer=None, trail_distance=trail)
    return replace(park, size=(side, side), terrain=terrain, meshes={}, instances=(), swarms=(), backdrop=None)
