# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Satellites of GPS and Galileo: positions from the stored almanac, and directions from the world.

The positions follow IS-GPS-200, section 20.3.3.5.2.1 and table 20-IV, reduced to the terms of an almanac, which are
good to a few kilometres within a fortnight: 0.01 deg seen from the ground.
"""

from datetime import UTC, datetime, timedelta
from functools import cache
from importlib.resources import files
from typing import Final, NamedTuple

import numpy as np
import pymap3d

from fieldtruth.core.arrays import Array
from fieldtruth.core.geodesy import ORIGIN_HEIGHT, ORIGIN_LATITUDE, ORIGIN_LONGITUDE

GRAVITATION: Final = 3.986005e14
"""Gravitational constant of the Earth [m^3/s^2] in IS-GPS-200."""
EARTH_RATE: Final = 7.2921151467e-5
"""Rotation of the Earth [rad/s] in IS-GPS-200."""
TIME_OF_WEEK: Final = 61440.0
"""Time of applicability of the almanac [s] of GPS week 2429."""
_LEAP: Final = timedelta(seconds=18)  # GPS time less UTC since 2017
WEEK_START: Final = datetime(1980, 1, 6, tzinfo=UTC) + timedelta(weeks=2429) - _LEAP
"""UTC at which the week of the almanac begins."""
_SYSTEMS: Final = {"gps": "G", "galileo": "E"}


class Almanac(NamedTuple):
    """Orbits of n satellites; arrays (n,), angles in radians as in the data file."""

    names: tuple[str, ...]
    sqrt_a: Array  # [m^0.5]
    eccentricity: Array
    inclination: Array
    node: Array  # longitude of the ascending node at the beginning of the week
    node_rate: Array  # [rad/s]
    perigee: Array
    anomaly: Array  # mean anomaly at the time of applicability


@cache
def read_almanac(systems: tuple[str, ...]) -> Almanac:
    """Return the satellites of the systems, ``gps`` and ``galileo``, from ``almanac.csv``, which states its sources."""
    text = (files("fieldtruth.sensors.gnss") / "almanac.csv").read_text(encoding="utf-8")
    rows = [line.split(",") for line in text.splitlines() if not line.startswith("#")][1:]
    rows = [row for system in systems for row in rows if row[0].startswith(_SYSTEMS[system])]
    return Almanac(tuple(row[0] for row in rows), *np.array([row[1:] for row in rows], np.float64).T)


def seconds_of_week(utc: datetime) -> float:
    """Seconds [s] from the beginning of the almanac's week to a time."""
    return (utc - WEEK_START).total_seconds()


def eccentric_anomaly(mean: Array, eccentricity: Array) -> Array:
    """Solve Kepler's equation E - e sin E = M [rad] by Newton's method, for e below 0.5."""
    result = mean + eccentricity * np.sin(mean)
    for _ in range(5):  # the error is squared each time: e = 0.02 needs two
        result = result - (result - eccentricity * np.sin(result) - mean) / (1.0 - eccentricity * np.cos(result))
    return result


def positions(almanac: Almanac, seconds: Array) -> Array:
    """Earth-fixed positions (t, n, 3) [m] at times (t,) [s] from the beginning of the almanac's week."""
    elapsed = np.asarray(seconds)[:, None] - TIME_OF_WEEK
    axis = almanac.sqrt_a**2
    mean = almanac.anomaly + np.sqrt(GRAVITATION / axis**3) * elapsed
    anomaly = eccentric_anomaly(mean, almanac.eccentricity)
    sine = np.sqrt(1.0 - almanac.eccentricity**2) * np.sin(anomaly)
    latitude = np.arctan2(sine, np.cos(anomaly) - almanac.eccentricity) + almanac.perigee  # argument of latitude
    radius = axis * (1.0 - almanac.eccentricity * np.cos(anomaly))
    node = almanac.node + (almanac.node_rate - EARTH_RATE) * elapsed - EARTH_RATE * TIME_OF_WEEK
    along, across = radius * np.cos(latitude), radius * np.sin(latitude)
    level = across * np.cos(almanac.inclination)
    return np.stack(
        [
            along * np.cos(node) - level * np.sin(node),
            along * np.sin(node) + level * np.cos(node),
            across * np.sin(almanac.inclination),
        ],
        axis=-1,
    )


def directions(almanac: Almanac, seconds: Array) -> Array:
    """Unit vectors (t, n, 3) in the world frame (north, west, up) from its origin to the satellites.

    Seen from elsewhere in a world of 1 km they differ by 3e-5 rad; the signal's travel turns the Earth by 5e-6 rad.
    """
    x, y, z = np.moveaxis(positions(almanac, seconds), -1, 0)
    east, north, up = pymap3d.ecef2enu(x, y, z, ORIGIN_LATITUDE, ORIGIN_LONGITUDE, ORIGIN_HEIGHT)
    vectors = np.stack([north, -east, up], axis=-1)
    unit: Array = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return unit
