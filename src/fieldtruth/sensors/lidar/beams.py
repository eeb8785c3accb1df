# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Elevations of the LiDAR's rings, and when its columns and rays leave; without the ray tracer."""

import numpy as np
from numpy.typing import NDArray

from fieldtruth.sensors.lidar.config import LidarConfig


def column_times_ns(config: LidarConfig) -> NDArray[np.int64]:
    """Times (columns,) [ns] after the stamp at which the columns of a spinning LiDAR begin."""
    return np.asarray(np.rint(np.arange(config.columns) * (1e9 / config.rate_hz / config.columns)), np.int64)


def sweep_times_ns(config: LidarConfig) -> NDArray[np.int64]:
    """Times (columns + 1,) [ns] after the stamp of ``column_times_ns``, and of the end of the last column."""
    return np.append(column_times_ns(config), round(1e9 / config.rate_hz))


def ray_times_ns(config: LidarConfig) -> NDArray[np.int64]:
    """Times (columns, rings) [ns] after the stamp at which the rays of a spinning LiDAR leave."""
    offsets = np.array(config.firing_offsets_ns or (0,) * config.rings, np.int64)
    return np.asarray(column_times_ns(config)[:, None] + offsets, np.int64)
