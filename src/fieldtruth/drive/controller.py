# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Waypoint follower of the paper's section 3: constant speed, turn rate proportional to the heading error.

Its only inputs are the latest fix of the GNSS antenna and the heading of the IMU; between two fixes it steers from the
position of the last one.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fieldtruth.core.arrays import Array
from fieldtruth.core.geodesy import geodetic_from_world, world_from_geodetic
from fieldtruth.core.transforms import rotation_from_quaternion_wxyz
from fieldtruth.drive.robot import STOP, Command
from fieldtruth.experiment.config import ControlConfig
from fieldtruth.experiment.fields import Mount


class FollowerState(NamedTuple):
    """Waypoints, current one and last fix of a ``WaypointFollower``."""

    waypoints_xy: Array
    target: int
    antenna_xy: Array


class WaypointFollower:
    """Drives to each waypoint in turn and stops at the last one.

    ``waypoints`` (n, 2) are latitude and longitude [deg]. ``target`` is the row of the current waypoint, and the number
    of waypoints once the last one is reached. ``antenna_xy`` [m] is the last fix.
    """

    def __init__(self, waypoints: ArrayLike, control: ControlConfig) -> None:
        # Each by itself: of many at once, the last digit can depend on how many there are.
        self.waypoints_xy: Array = np.array([horizontal_from_geodetic(w) for w in np.asarray(waypoints)])  # (n, 2) [m]
        self.target = 0
        self._control = control
        self.antenna_xy = self.waypoints_xy[0]

    @property
    def finished(self) -> bool:
        """True once the last waypoint is reached."""
        return self.target == len(self.waypoints_xy)

    def update_fix(self, latitude_deg: float, longitude_deg: float) -> None:
        """Take a GNSS fix; below the arrival distance the next waypoint becomes the target."""
        self._arrive(horizontal_from_geodetic((latitude_deg, longitude_deg)))

    def add(self, waypoint: ArrayLike) -> None:
        """Drive on to a waypoint (2,) after those that there are."""
        self.waypoints_xy = np.vstack([self.waypoints_xy, horizontal_from_geodetic(waypoint)])
        self._arrive(self.antenna_xy)

    def save(self) -> FollowerState:
        """Return what ``restore`` needs to go on from here."""
        return FollowerState(self.waypoints_xy, self.target, self.antenna_xy)

    def restore(self, saved: FollowerState) -> None:
        """Go on from where ``save`` was called, and forget waypoints that were added since then."""
        self.waypoints_xy, self.target, self.antenna_xy = saved

    def _arrive(self, antenna_xy: Array) -> None:
        self.antenna_xy = antenna_xy
        while not self.finished and self.distance < self._control.arrival_distance:
            self.target += 1

    @property
    def distance(self) -> float:
        """Distance [m] from the last fix to the target."""
        return math.dist(self.antenna_xy, self.waypoints_xy[self.target])

    def command(self, heading: float) -> Command:
        """Command at this ``heading`` [rad]: 0 is north, positive towards west."""
        if self.finished:
            return STOP
        north, west = self.waypoints_xy[self.target] - self.antenna_xy
        return Command(self._control.speed, turn_rate(math.atan2(west, north) - heading, self._control))


def turn_rate(heading_error: float, control: ControlConfig) -> float:
    """Turn rate [rad/s], proportional to the heading error [rad] up to the limit."""
    rate = control.heading_gain * math.remainder(heading_error, math.tau)
    return min(max(rate, -control.max_turn_rate), control.max_turn_rate)


def horizontal_from_geodetic(geodetic: ArrayLike) -> Array:
    """World x, y (..., 2) [m] of latitude and longitude (..., 2) [deg] at height 0."""
    latitude_longitude = np.asarray(geodetic, np.float64)
    height = np.zeros((*latitude_longitude.shape[:-1], 1))
    return world_from_geodetic(np.concatenate([latitude_longitude, height], axis=-1))[..., :2]


def antenna_geodetic(position: Array, quaternion_wxyz: Array, mount: Mount) -> Array:
    """Latitude [deg], longitude [deg], height [m] (n, 3) of the antenna for poses of base_link (n, 3) and (n, 4)."""
    lever = rotation_from_quaternion_wxyz(quaternion_wxyz) @ np.array(mount.xyz)
    return geodetic_from_world(position + lever)


def heading(quaternion_wxyz: Array) -> float:
    """Heading [rad] of base_link (the attitude of an IMU, turned by its mount): 0 north, positive towards west."""
    w, x, y, z = quaternion_wxyz
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
