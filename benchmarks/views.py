# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Views along a route, at which benchmarks and pictures look, and recordings of them that are timed."""

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from fieldtruth.bench.sensors import Stretches, recording, seconds_of
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.drive.physics import resting_pose
from fieldtruth.drive.track import Track
from fieldtruth.experiment.config import Route, metres_from_route
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.scanning_config import ScanningConfig
from fieldtruth.render.bake import BakedScene
from fieldtruth.world.model import World


def poses_on_route(route: Route | None, world: World, rig: Rig, count: int) -> list[Array]:
    """Poses world_from_base (4, 4) of the robot at rest, evenly spaced on the route and facing along it."""
    corners = metres_from_route(route)
    legs = np.diff(corners, axis=0)
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(legs, axis=1))])
    poses = []
    for at in travelled[-1] * (np.arange(count) + 0.5) / count:
        leg = int(np.searchsorted(travelled, at)) - 1
        xy = np.array([np.interp(at, travelled, corners[:, axis]) for axis in range(2)])
        yaw = float(np.arctan2(legs[leg, 1], legs[leg, 0]))
        poses.append(transforms.pose_from_quaternion_wxyz(*resting_pose(world.terrain.field, xy, yaw, rig)))
    return poses


class Recorded(NamedTuple):
    """Time [s] of a recording, and what it recorded."""

    took_s: float
    images: int
    scans: int


def record(baked: BakedScene, track: Track, rig: Rig, stretches: Stretches, *, workers: int) -> Recorded:
    """Record what the cameras and LiDARs of a rig see, with ``workers`` threads.

    The time is that of all threads over their number, as in a long recording, in which none waits at the end.
    """
    with recording(baked, track, rig, stretches, workers) as slices, ThreadPoolExecutor(workers) as pool:
        took = sum(pool.map(lambda k: float(seconds_of(slices.make_one, k)[1]), stretches.seconds)) / workers
    clouds = {lidar.topic for lidar in rig.enabled(ScanningConfig)}
    scans = sum(len(stream.stamps_ns) for stream in slices.streams if clouds.issuperset(stream.topics))
    return Recorded(took, sum(len(stream.stamps_ns) for stream in slices.streams) - scans, scans)
