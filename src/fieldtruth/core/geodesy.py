# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Conversion between the world frame [m] and WGS 84.

The world frame is North-West-Up, the plane that touches the ellipsoid below the origin: x north, y west, z up. The
origin of built-in worlds is at 49.9 deg N, 8.9 deg E, 0 m (paper, 2.2).
"""

from typing import Final, NamedTuple

import numpy as np
import pymap3d
from numpy.typing import ArrayLike, NDArray


class Origin(NamedTuple):
    """Origin of a world frame: latitude and longitude [deg] on WGS 84, and height [m] above its ellipsoid."""

    latitude: float
    longitude: float
    height: float


PAPER_ORIGIN: Final = Origin(49.9, 8.9, 0.0)


def earth_from_world(origin: Origin) -> NDArray[np.float64]:
    """Pose (4, 4) of a world frame in the frame ``earth`` of REP-105, WGS 84's earth-centred, earth-fixed one [m]."""
    latitude, longitude = np.radians(origin[:2])
    (sin, cos), (sin_east, cos_east) = ((np.sin(a), np.cos(a)) for a in (latitude, longitude))
    north, up = (-sin * cos_east, -sin * sin_east, cos), (cos * cos_east, cos * sin_east, sin)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([north, (sin_east, -cos_east, 0.0), up])
    pose[:3, 3] = pymap3d.geodetic2ecef(*origin)
    return pose


def origin_of_world(earth_from_world: NDArray[np.float64]) -> Origin:
    """Origin of a world frame by its pose in ``earth``."""
    return Origin(*(float(value) for value in pymap3d.ecef2geodetic(*earth_from_world[:3, 3])))


def geodetic_from_world(points_world: ArrayLike, origin: Origin = PAPER_ORIGIN) -> NDArray[np.float64]:
    """Latitude [deg], longitude [deg] and ellipsoidal height [m], (..., 3), of points (..., 3) in the world frame."""
    x, y, z = np.moveaxis(np.asarray(points_world, np.float64), -1, 0)
    geodetic = pymap3d.enu2geodetic(-y, x, z, *origin)
    return np.stack([np.asarray(v, np.float64) for v in geodetic], axis=-1)


def world_from_geodetic(geodetic: ArrayLike, origin: Origin = PAPER_ORIGIN) -> NDArray[np.float64]:
    """Points (..., 3) [m] in the world frame of latitude [deg], longitude [deg] and height [m], (..., 3)."""
    latitude, longitude, height = np.moveaxis(np.asarray(geodetic, np.float64), -1, 0)
    e, n, u = pymap3d.geodetic2enu(latitude, longitude, height, *origin)
    return np.stack([np.asarray(n, np.float64), -np.asarray(e, np.float64), np.asarray(u, np.float64)], axis=-1)
