# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Which rays of a LiDAR meet the robot that carries it: the same in each scan, as both move together."""

from collections.abc import Sequence

import numpy as np

from fieldtruth.core.arrays import Array, Index
from fieldtruth.experiment.robot_body import Box, Cylinder
from fieldtruth.experiment.sensor_families import ScanningConfig
from fieldtruth.sense.robot_rays import material_of, meet, part_table


class RobotScan:
    """The rays of a LiDAR, by ``column`` and ``ring`` (n,), that meet its robot, at ``range_m`` (n,) [m].

    ``material`` (n,) is one of ``robot_rays``, ``cosine`` (n,) that of the angle of incidence.
    """

    def __init__(self, parts: Sequence[Box | Cylinder], config: ScanningConfig, directions: Array) -> None:
        self._table, self._farthest = part_table(parts), config.max_range
        self._base_from_sensor = config.mount.base_from_sensor
        self.column: Index
        self.ring: Index
        self.aim(directions)

    def aim(self, directions: Array) -> None:
        """Trace rays in other unit ``directions`` (columns, rings, 3) in the LiDAR's frame."""
        rays = directions.reshape(-1, 3) @ self._base_from_sensor[:3, :3].T
        found = meet(self._table, self._base_from_sensor[:3, 3], rays)
        number = np.flatnonzero(found.range_m <= self._farthest)
        self.column, self.ring = np.divmod(number, directions.shape[1])
        self.range_m = found.range_m[number].astype(np.float32)
        self.material = material_of(self._table, found.face[number])
        self.cosine = np.abs((found.normal[number] * rays[number]).sum(axis=1))
