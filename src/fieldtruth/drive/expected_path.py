# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The expected path of an experiment, without physics, and the poses of the robot on it.

The kinematic simulation ignores slip and uneven ground. In the park the real drive stays within 0.25 m of it (5 cm on
average); it takes 20 ms instead of 20 s.
"""

import numpy as np

from fieldtruth.core import transforms
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
    """Return the built-in experiments of an environment, by name."""
    experiments = map(load_experiment, experiment_names())
    return [experiment for experiment in experiments if experiment.environment == environment]


def expected_path(experiment: Experiment, world: World) -> Array:
    """Return the expected poses, every few centimetres: (n, 3) of x, y [m] and heading [rad], from start to end.

    Raises:
        RouteError: no free random route was found.
    """
    route = plan_route(world, experiment) if isinstance(experiment.route, RandomRouteConfig) else experiment.route
    legs, _ = KinematicSimulator(experiment).drive_route(metres_from_route(route))
    return np.concatenate(legs)


def poses_along(path: Array, spacing: float) -> Array:
    """Return rows (m, 3) of a path (n, 3), one every ``spacing`` [m], the first at half of that."""
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1))])
    at = np.arange(spacing / 2, max(arc[-1], spacing), spacing)
    return path[np.minimum(np.searchsorted(arc, at), len(path) - 1)]


def pose_on_ground(field: Heightfield, pose: Array, rig: Rig) -> Array:
    """Return world_from_base (4, 4) of a robot at rest on the ground at x, y [m] with a heading [rad]."""
    x, y, heading = pose
    return transforms.pose_from_quaternion_wxyz(*resting_pose(field, np.array([x, y]), float(heading), rig))
