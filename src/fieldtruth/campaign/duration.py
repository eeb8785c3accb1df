# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""How much time an experiment simulates, as far as it is known before the drive."""

import numpy as np

from fieldtruth.bag.track_file import read_track_file
from fieldtruth.experiment.config import FRAME_RATE, Experiment, RandomRouteConfig
from fieldtruth.experiment.route import metres_from_route


def simulated_s(experiment: Experiment) -> float:
    """Return the simulated time [s]: until the route's end at the controller's speed, at most ``seconds``."""
    if experiment.frames is not None:
        return experiment.frames.count / FRAME_RATE
    limit = float("inf") if experiment.seconds is None else experiment.seconds
    if experiment.drive is not None:
        if experiment.seconds is not None:
            return limit
        stamps = read_track_file(experiment.drive).poses.stamps_ns
        return float(stamps[-1] - stamps[0]) / 1e9
    route = experiment.route
    if isinstance(route, RandomRouteConfig):
        length = route.random.length_m
    else:
        length = float(np.linalg.norm(np.diff(metres_from_route(route), axis=0), axis=1).sum())
    return min(limit, length / experiment.control.speed)


def motion_of(experiment: Experiment) -> str:
    """Say what moves the robot: runs of one environment that differ in it differ in cost, too."""
    if experiment.frames is not None:
        return "frames"
    if experiment.drive is not None:
        return "track file"
    return "random route" if isinstance(experiment.route, RandomRouteConfig) else "route"
