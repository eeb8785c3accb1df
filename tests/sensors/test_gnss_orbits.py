# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Orbits against Kepler's laws and a computation of the test's own; directions against an ellipsoid by hand."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from fieldtruth.sensors.gnss.sensing import (
    EARTH_RATE,
    GRAVITATION,
    TIME_OF_WEEK,
    Almanac,
    directions,
    eccentric_anomaly,
    positions,
    read_almanac,
    seconds_of_week,
)

GPS, GALILEO = read_almanac(("gps",)), read_almanac(("galileo",))
BOTH = read_almanac(("gps", "galileo"))
SIDEREAL_DAY = 2.0 * np.pi / EARTH_RATE


def _one(almanac: Almanac, k: int) -> dict[str, float]:
    return {key: float(values[k]) for key, values in almanac._asdict().items() if key != "names"}


def _by_rotations(almanac: Almanac, k: int, seconds: float) -> np.ndarray:
    """Position of a satellite by a root finder and three rotations: perigee, inclination, node."""
    s, elapsed = _one(almanac, k), seconds - TIME_OF_WEEK
    axis, e = s["sqrt_a"] ** 2, s["eccentricity"]
    mean = (s["anomaly"] + elapsed * np.sqrt(GRAVITATION / axis**3)) % (2.0 * np.pi)
    anomaly = brentq(lambda x: x - e * np.sin(x) - mean, -1.0, 8.0, xtol=1e-14)
    plane = [axis * (np.cos(anomaly) - e), axis * np.sqrt(1.0 - e * e) * np.sin(anomaly), 0.0]
    node = s["node"] + s["node_rate"] * elapsed - EARTH_RATE * seconds  # of the turning Earth
    return np.asarray(Rotation.from_euler("ZXZ", [node, s["inclination"], s["perigee"]]).apply(plane))


def test_constellations() -> None:
    assert len(GPS.names) == 31
    assert "G13" not in GPS.names  # not healthy
    assert BOTH.names == GPS.names + GALILEO.names
    planes = np.sort(np.degrees(GPS.node) % 60.0)  # six planes, 60 deg apart, from which satellites drift by degrees
    assert np.ptp(planes) < 17.0
    assert np.degrees(GPS.inclination) == pytest.approx(55.0, abs=2.5)


def test_galileo_has_the_slots_of_its_reference() -> None:
    """Slots at 2016-11-21 00:00 UTC: nodes by sidereal time (Meeus, equation 12.4), argument of latitude."""
    days = (datetime(2026, 7, 26, 17, 3, 42, tzinfo=UTC) - datetime(2016, 11, 21, tzinfo=UTC)) / timedelta(days=1)
    sidereal = 280.46061837 + 360.98564736629 * ((2457713.5 + days) - 2451545.0)
    node = np.degrees(GALILEO.node - EARTH_RATE * TIME_OF_WEEK) + sidereal + 0.02764398 * days
    slots = [(node, first + 45.0 * (k - 4)) for node, first in ((317.632, 0.153), (77.632, 15.153), (197.632, 30.153))
             for k in range(8)]  # fmt: skip
    latitude = np.degrees(GALILEO.perigee + GALILEO.anomaly) - 613.72253566 * days
    off = (np.stack([node, latitude], axis=-1) - slots + 180.0) % 360.0 - 180.0
    assert np.abs(off).max() < 2e-4


def test_kepler() -> None:
    mean = np.linspace(-7.0, 7.0, 400)[:, None]
    eccentricity = np.array([0.0, 0.001, 0.02, 0.3])
    found = eccentric_anomaly(mean, eccentricity)
    assert found - eccentricity * np.sin(found) == pytest.approx(np.broadcast_to(mean, found.shape), abs=1e-12)


def test_positions_are_those_by_rotations() -> None:
    times = np.array([0.0, 61440.0, 200_000.0, 604_800.0])
    found = positions(BOTH, times)
    own = [[_by_rotations(BOTH, k, t) for k in range(len(BOTH.names))] for t in times]
    assert found == pytest.approx(np.array(own), abs=1e-3)


def test_radius_and_period() -> None:
    """GPS goes round twice in a sidereal day at 26,560 km, Galileo 17 times in 10 days at 29,600 km."""
    for almanac, radius, period in ((GPS, 26.56e6, SIDEREAL_DAY / 2.0), (GALILEO, 29.5998e6, 10.0 * SIDEREAL_DAY / 17)):
        axis = almanac.sqrt_a**2
        assert axis == pytest.approx(radius, rel=1e-4)
        assert 2.0 * np.pi * np.sqrt(axis**3 / GRAVITATION) == pytest.approx(period, rel=2e-4)
        distance = np.linalg.norm(positions(almanac, np.linspace(0.0, 43_000.0, 50)), axis=-1)
        assert (np.abs(distance / axis - 1.0) <= almanac.eccentricity + 1e-12).all()
    now, later = positions(GPS, np.array([1000.0, 1000.0 + SIDEREAL_DAY]))
    assert np.linalg.norm(later - now, axis=-1).max() < 2e5  # the same sky, but for the drift of 1 % of a degree


def test_a_ground_track_moves_west_between_ascents() -> None:
    """Twelve hours later the Earth has turned by half: the node is on the other side."""
    half = SIDEREAL_DAY / 2.0
    now, later = positions(GPS, np.array([0.0, half]))
    longitude = np.arctan2(later[:, 1], later[:, 0]) - np.arctan2(now[:, 1], now[:, 0])
    assert np.abs(np.abs((longitude + np.pi) % (2 * np.pi) - np.pi) - np.pi).max() < 0.02


def test_directions_by_an_ellipsoid_by_hand() -> None:
    latitude, longitude = np.radians([49.9, 8.9])
    a, f = 6_378_137.0, 1.0 / 298.257223563
    squared = f * (2.0 - f)
    normal = a / np.sqrt(1.0 - squared * np.sin(latitude) ** 2)
    up = np.array([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)])
    origin = up * [normal, normal, normal * (1.0 - squared)]
    east = np.array([-np.sin(longitude), np.cos(longitude), 0.0])
    times = np.array([0.0, 30_000.0])
    line = positions(BOTH, times) - origin
    line /= np.linalg.norm(line, axis=-1, keepdims=True)
    own = np.stack([line @ np.cross(up, east), -(line @ east), line @ up], axis=-1)  # north, west, up
    assert directions(BOTH, times) == pytest.approx(own, abs=1e-9)


def test_no_gps_satellite_in_the_north() -> None:
    """Their inclination of 55 deg leaves a hole around the pole, north of a receiver in Germany."""
    over_a_day = directions(GPS, np.arange(0.0, 86_400.0, 120.0)).reshape(-1, 3)
    elevation = np.degrees(np.arcsin(over_a_day[:, 2]))
    azimuth = np.degrees(np.arctan2(-over_a_day[:, 1], over_a_day[:, 0]))
    assert not ((elevation > 10.0) & (elevation < 40.0) & (np.abs(azimuth) < 15.0)).any()
    assert ((elevation > 10.0) & (elevation < 40.0) & (np.abs(azimuth) > 165.0)).any()


def test_time() -> None:
    assert seconds_of_week(datetime(2026, 7, 26, 0, 0, tzinfo=UTC)) == 18.0  # leap seconds
    assert seconds_of_week(datetime(2026, 7, 27, 8, 20, tzinfo=UTC)) == 86_400.0 + 8 * 3600 + 20 * 60 + 18
