# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Which rays of a LiDAR meet the robot that carries it: the same in each scan, as both move together."""

from collections.abc import Sequence

import numpy as np

from fieldtruth.core.arrays import Array, Index
from fieldtruth.experiment.lidar_config import LidarConfig
from fieldtruth.experiment.robot_body import Box, Cylinder
from fieldtruth.sense.robot_rays import meet, part_table


class RobotScan:
    """The rays of a LiDAR, by ``column`` and ``ring`` (n,), that meet its robot, at ``range_m`` (n,) [m]."""

    def __init__(self, parts: Sequence[Box | Cylinder], config: LidarConfig, directions: Array) -> None:
        self._table, self._farthest = part_table(parts), config.max_range
        self._base_from_sensor = config.mount.base_from_sensor
        self.column: Index
        self.ring: Index
        self.aim(directions)

    def aim(self, directions: Array) -> None:
        """Trace rays in other unit ``directions`` (columns, rings, 3) in the LiDAR's frame."""
        rays = directions.reshape(-1, 3) @ self._base_from_sensor[:3, :3].T
        found = meet(self._table, self._base_from_sensor[:3, 3], rays).range_m.reshape(directions.shape[:2])
        self.column, self.ring = np.nonzero(found <= self._farthest)
        self.range_m = found[self.column, self.ring].astype(np.float32)
