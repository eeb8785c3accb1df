# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The returns of a cloud spread over all rays of its LiDAR."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Mask
from fieldtruth.sensors.lidar.config import LidarConfig


class DenseCloud(NamedTuple):
    """A value for each ray of the LiDAR; 0 without a return."""

    xyz: NDArray[np.float32]
    label: NDArray[np.uint16]
    instance: NDArray[np.uint32]

    @classmethod
    def of(cls, config: LidarConfig, column: Any, ring: Any, *values: Any) -> "DenseCloud":
        """Spread returns over all rays; those of rays that do not exist are reported by the check of rays."""
        number, count = column.astype(np.int64) * config.rings + ring, config.columns * config.rings
        inside = (number >= 0) & (number < count)
        parts: list[NDArray[Any]] = [
            np.zeros((count, 3), np.float32),
            np.zeros(count, np.uint16),
            np.zeros(count, np.uint32),
        ]
        for part, value in zip(parts, values, strict=True):
            part[number[inside]] = value[inside]
        return cls(*parts)

    def first(self, count: int) -> "DenseCloud":
        """The values of the first ``count`` rays."""
        return DenseCloud(self.xyz[:count], self.label[:count], self.instance[:count])

    def labelled_as(self, other: "DenseCloud", where: Mask) -> "DenseCloud":
        """The same with class and instance of another one where ``where`` is true."""
        label, instance = np.where(where, other.label, self.label), np.where(where, other.instance, self.instance)
        return DenseCloud(self.xyz, label, instance)
