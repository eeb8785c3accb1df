# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rays of LiDARs whose pattern does not repeat from scan to scan; without the ray tracer.

Livox publishes no formulas. These have the fields of view, lines and rates of the data sheets and depend on the time
alone, so that the scans of a LiDAR at rest fill its field of view: the Avia's repeat after 30 s, the Mid-360's never.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.sensors.lidar.beams import column_times_ns
from fieldtruth.sensors.lidar.config import LidarConfig

AVIA_FOV_DEG: Final = (70.4, 77.2)
PRISMS_HZ: Final = (7294.0 / 60.0, -4664.0 / 60.0)
"""Turns of the two prisms of the Mid-40 and the Mid-70: the spectra of their tables of rays (TATP-233/MuJoCo-LiDAR
22c0826, scan_mode) have their two highest peaks there, within 15 a minute."""
MID_360_ELEVATIONS_DEG: Final = (-7.0, 52.0)
MID_360_HZ: Final = (10.0 * 2.0**0.5, 100.0 * 3.0**0.5)
"""Turns of the head and swings of the elevation."""


def pattern_directions(config: LidarConfig, stamp_ns: int) -> Array:
    """Unit directions (columns, rings, 3) in the LiDAR's frame of a scan that begins at ``stamp_ns``.

    All lines of a column, its rings, leave at once.
    """
    seconds = np.asarray((stamp_ns + column_times_ns(config))[:, None] * 1e-9, np.float64)
    lines = np.arange(config.rings)
    return _avia(seconds, lines) if config.pattern == "avia" else _mid_360(seconds, lines)


def _avia(seconds: Array, lines: NDArray[np.int64]) -> Array:
    """Return the rays of lines above each other that two prisms deflect, to the first order: a rosette about +x."""
    width, height = np.radians(AVIA_FOV_DEG)
    turns = [np.exp(2j * np.pi * hz * seconds) for hz in PRISMS_HZ]
    aside = width / 4.0 * (turns[0] + turns[1])  # angle from +x, towards +y (real) and +z (imaginary)
    angle = np.abs(aside)
    slope = np.sinc(angle / np.pi)
    x, y, z = np.cos(angle), slope * aside.real, slope * aside.imag
    up = (height - width) * (lines / max(len(lines) - 1, 1) - 0.5)
    return np.stack([x * np.cos(up) - z * np.sin(up), y + 0.0 * up, x * np.sin(up) + z * np.cos(up)], axis=-1)


def _mid_360(seconds: Array, lines: NDArray[np.int64]) -> Array:
    """Return the rays of lines that are even around a turning head, each of which swings up and down evenly."""
    low, high = np.radians(MID_360_ELEVATIONS_DEG)
    ahead = 2.0 * np.pi * lines / len(lines)
    azimuth = -2.0 * np.pi * MID_360_HZ[0] * seconds - ahead
    swing = np.arcsin(np.sin(2.0 * np.pi * MID_360_HZ[1] * seconds + ahead)) / np.pi  # -0.5 to 0.5
    elevation = (low + high) / 2.0 + (high - low) * swing
    horizontal = np.cos(elevation)
    return np.stack([horizontal * np.cos(azimuth), horizontal * np.sin(azimuth), np.sin(elevation)], axis=-1)
