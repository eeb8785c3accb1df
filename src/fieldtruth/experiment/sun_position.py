# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Azimuth and elevation of the sun at a time and a position on Earth, within 0.02 deg from 1950 to 2050.

Meeus, Astronomical Algorithms (2nd edition, 1998), chapters 7, 12, 13 and 25 (low accuracy), and the refraction of
Bennett (1982, Journal of Navigation 35) in the form of Saemundsson, which the book gives in chapter 16.
"""

from datetime import date
from math import asin, atan2, cos, degrees, radians, sin, tan
from typing import Final

_EPOCH: Final = date(2000, 1, 1)
_DELTA_T: Final = 70.0  # [s] of terrestrial time ahead of UTC, in 2020; a minute moves the sun by 0.7 arc seconds


def sun_position(day: date, hours: float, latitude: float, longitude: float) -> tuple[float, float]:
    """Return azimuth (clockwise from north, 0 to 360) and apparent elevation of the sun's centre [deg].

    Args:
        day: date in UTC.
        hours: time of the day in UTC [h]; may be outside 0 to 24.
        latitude: north is positive [deg].
        longitude: east is positive [deg].
    """
    days = (day - _EPOCH).days - 0.5 + hours / 24.0  # since noon of 1 January 2000
    ascension, declination = _equatorial((days + _DELTA_T / 86400.0) / 36525.0)
    centuries = days / 36525.0
    sidereal = 280.46061837 + 360.98564736629 * days + 0.000387933 * centuries**2
    angle = radians(sidereal + longitude) - ascension  # west of the meridian
    phi = radians(latitude)
    up = sin(phi) * sin(declination) + cos(phi) * cos(declination) * cos(angle)
    south = sin(phi) * cos(declination) * cos(angle) - cos(phi) * sin(declination)
    west = cos(declination) * sin(angle)
    return degrees(atan2(-west, -south)) % 360.0, _refracted(degrees(asin(max(-1.0, min(1.0, up)))))


def _equatorial(t: float) -> tuple[float, float]:
    """Apparent right ascension and declination [rad] after ``t`` Julian centuries from J2000."""
    mean = 280.46646 + 36000.76983 * t + 0.0003032 * t * t
    anomaly = radians(357.52911 + 35999.05029 * t - 0.0001537 * t * t)
    centre = (1.914602 - 0.004817 * t) * sin(anomaly) + 0.019993 * sin(2 * anomaly) + 0.000289 * sin(3 * anomaly)
    node = radians(125.04 - 1934.136 * t)
    longitude = radians(mean + centre - 0.00569 - 0.00478 * sin(node))
    obliquity = radians(23.4392911 - 0.0130042 * t + 0.00256 * cos(node))
    return atan2(cos(obliquity) * sin(longitude), cos(longitude)), asin(sin(obliquity) * sin(longitude))


def _refracted(elevation: float) -> float:
    """Apparent elevation [deg] of a true one; far below the horizon air makes no difference."""
    if elevation < -1.5:
        return elevation
    return elevation + 1.02 / tan(radians(elevation + 10.3 / (elevation + 5.11))) / 60.0
