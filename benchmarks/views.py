# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Views along a route, at which benchmarks and pictures look."""

import numpy as np

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.drive.physics import resting_pose
from fieldtruth.experiment.config import Route, metres_from_route
from fieldtruth.experiment.rig import Rig
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
