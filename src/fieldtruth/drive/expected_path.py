# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The line that an experiment drives, without driving it, and where to stand on it.

A rehearsal leaves out the ground and how tyres slip on it. In the park the real drive stays within 0.25 m of it (5 cm
on average); it takes 20 ms instead of 20 s.
"""

import numpy as np

from fieldtruth.core import frames
from fieldtruth.core.arrays import Array
from fieldtruth.drive.kinematics import KinematicSimulator
from fieldtruth.drive.physics import resting_pose
from fieldtruth.drive.plan import plan_route
from fieldtruth.experiment.catalogue import experiment_names
from fieldtruth.experiment.config import Experiment, RandomRouteConfig
from fieldtruth.experiment.files import load_experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.route import metres_from_route
from fieldtruth.world.model import Heightfield, World


def experiments_in(environment: str) -> list[Experiment]:
    """Return the experiments that ship with the package and drive in this environment, by name."""
    experiments = map(load_experiment, experiment_names())
    return [experiment for experiment in experiments if experiment.environment == environment]


def expected_path(experiment: Experiment, world: World) -> Array:
    """Where the robot will be, every few centimetres: (n, 3) x, y [m] and heading [rad], from the start to the end.

    Raises:
        RouteError: a random route for which there is no room.
    """
    route = plan_route(world, experiment) if isinstance(experiment.route, RandomRouteConfig) else experiment.route
    legs, _ = KinematicSimulator(experiment).legs(metres_from_route(route))
    return np.concatenate(legs)


def poses_along(path: Array, spacing: float) -> Array:
    """Rows (m, 3) of a path (n, 3), one each ``spacing`` [m] of way, the first half of that from the start."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1))])
    at = np.arange(spacing / 2, max(way[-1], spacing), spacing)
    return path[np.minimum(np.searchsorted(way, at), len(path) - 1)]


def standing_pose(field: Heightfield, station: Array, rig: Rig) -> Array:
    """Pose world_from_base (4, 4) of a robot that stands on the ground at x, y [m] with a heading [rad]."""
    x, y, heading = station
    return frames.pose_from_quaternion_wxyz(*resting_pose(field, np.array([x, y]), float(heading), rig))
