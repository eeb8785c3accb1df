# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Conversion between the world frame [m] and WGS 84; the world's origin is at 49.9 deg N, 8.9 deg E, 0 m (paper, 2.2).

The world frame is North-West-Up, the plane that touches the ellipsoid in the origin: x north, y west, z up.
"""

from typing import Final

import numpy as np
import pymap3d
from numpy.typing import ArrayLike, NDArray

ORIGIN_LATITUDE: Final = 49.9  # [deg]
ORIGIN_LONGITUDE: Final = 8.9  # [deg]
ORIGIN_HEIGHT: Final = 0.0  # [m] above the ellipsoid


def geodetic_from_world(points_world: ArrayLike) -> NDArray[np.float64]:
    """Latitude [deg], longitude [deg] and ellipsoidal height [m], (..., 3), of points (..., 3) in the world frame."""
    x, y, z = np.moveaxis(np.asarray(points_world, np.float64), -1, 0)
    geodetic = pymap3d.enu2geodetic(-y, x, z, ORIGIN_LATITUDE, ORIGIN_LONGITUDE, ORIGIN_HEIGHT)
    return np.stack([np.asarray(v, np.float64) for v in geodetic], axis=-1)


def world_from_geodetic(geodetic: ArrayLike) -> NDArray[np.float64]:
    """Points (..., 3) [m] in the world frame of latitude [deg], longitude [deg] and height [m], (..., 3)."""
    latitude, longitude, height = np.moveaxis(np.asarray(geodetic, np.float64), -1, 0)
    e, n, u = pymap3d.geodetic2enu(latitude, longitude, height, ORIGIN_LATITUDE, ORIGIN_LONGITUDE, ORIGIN_HEIGHT)
    return np.stack([np.asarray(n, np.float64), -np.asarray(e, np.float64), np.asarray(u, np.float64)], axis=-1)
