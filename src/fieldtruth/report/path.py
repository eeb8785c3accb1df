# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The line that an experiment drives, without driving it: the way-point follower on flat ground, and where to stand.

The follower is the drive's own, fixes and all; what is left out is the ground and how tyres slip on it. In the park
the real drive stays within 0.25 m of this line (5 cm on average), which costs 20 ms instead of 20 s.
"""

import math
from typing import Final

import numpy as np

from fieldtruth import frames
from fieldtruth.drive.controller import WaypointFollower
from fieldtruth.drive.physics import resting_pose
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.route import metres_from_route
from fieldtruth.frames import Array
from fieldtruth.geodesy import geodetic_from_world
from fieldtruth.world.model import Heightfield

STEP_S: Final = 0.1
_LONGEST_S: Final = 20_000.0  # a route that is not finished then circles about a way-point for ever


def expected_path(experiment: Experiment) -> Array:
    """Where the robot will be every 0.1 s: (n, 3) x, y [m] and heading [rad], from the start to the last way-point."""
    corners, rig = metres_from_route(experiment.route), experiment.rig
    waypoints = geodetic_from_world(np.column_stack([corners[1:], np.zeros(len(corners) - 1)]))[:, :2]
    follower = WaypointFollower(waypoints, experiment.control)
    (x, y), (north, west) = corners[0], corners[1] - corners[0]
    heading, path, due = math.atan2(west, north), [], 0.0
    for step in range(round(_LONGEST_S / STEP_S)):
        path.append((x, y, heading))
        if step * STEP_S >= due - 1e-9:
            due += 1.0 / rig.gnss.rate_hz
            antenna = frames.transform(frames.pose((x, y, 0.0), (0, 0, math.degrees(heading))), [rig.gnss.mount.xyz])
            latitude, longitude, _ = geodetic_from_world(antenna * (1, 1, 0))[0]
            follower.see_fix(latitude, longitude)
        if follower.finished:
            break
        speed, turn_rate = follower.command(heading)
        heading += turn_rate * STEP_S
        x, y = x + speed * STEP_S * math.cos(heading), y + speed * STEP_S * math.sin(heading)
    return np.array(path)


def stations(path: Array, spacing: float) -> Array:
    """Rows (m, 3) of a path (n, 3), one each ``spacing`` [m] of way, the first half of that from the start."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1))])
    at = np.arange(spacing / 2, max(way[-1], spacing), spacing)
    return path[np.minimum(np.searchsorted(way, at), len(path) - 1)]


def stand(field: Heightfield, station: Array, rig: Rig) -> Array:
    """Pose world_from_base (4, 4) of a robot that stands on the ground at x, y [m] with a heading [rad]."""
    x, y, heading = station
    return frames.pose_from_quaternion_wxyz(*resting_pose(field, np.array([x, y]), float(heading), rig))
