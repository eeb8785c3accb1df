# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The LiDAR as a kind of sensor."""

from collections.abc import Iterable

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.readings import Cloud
from fieldtruth.experiment.sensor_config import Output
from fieldtruth.kernels.lidar import Scan
from fieldtruth.kernels.lidar_noise import Reading
from fieldtruth.sensors.kind import At, Rays, Sensor, SensorWorld
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.message import MEASURED, point_cloud
from fieldtruth.sensors.lidar.sensing import IdealLidar, Lidar, Traced, ray_directions, sweep_times_ns


class LidarSensor(Sensor):
    """A LiDAR, which scans from one pose or, if it spins, from those of its turn."""

    config_type = LidarConfig
    config: LidarConfig

    def __init__(self, config: LidarConfig, sensor_world: SensorWorld) -> None:
        super().__init__(config, sensor_world)
        made = sensor_world
        self._lidar = Lidar(config, made.scene, made.robot_parts, made.weather, seed=made.seed)
        self._sweep_ns = sweep_times_ns(config)

    def truth(self, output: Output, at: At) -> Cloud | Traced:
        """Scan; with a signal, trace the echoes of all rays."""
        pose = self._pose(at)
        if self.config.signal is None:
            return self._cloud(self._lidar.scan(pose, at.stamp_ns, at.number), at)
        return self._lidar.trace(pose, at.stamp_ns)

    def signal(self, output: Output, at: At, truth: Traced) -> Cloud:
        """Measure the echoes that were traced last."""
        return self._cloud(self._lidar.measure(truth, at.number), at)

    def rays(self) -> Rays:
        """Rays by column and ring; they give a labelled scan."""
        scan = IdealLidar(self.config, self.sensor_world.scene).scan
        return Rays(
            ray_directions(self.config).astype(np.float32), self.config.max_range, ({self.config.family: scan},)
        )

    def messages(self, output: Output, number: int, reading: Cloud) -> Iterable[bytes]:
        """Serialise sensor_msgs/PointCloud2."""
        yield point_cloud(number, reading.header_ns, reading, self.config, wide_ids=self.sensor_world.wide_ids)

    def _pose(self, at: At) -> Array:
        stamps = at.stamp_ns + self._sweep_ns if self.config.spinning else at.stamp_ns
        return at.movement.pose(stamps) @ self.config.mount.base_from_sensor

    def _cloud(self, scan: Scan | Reading, at: At) -> Cloud:
        return Cloud(
            **at.stamps,
            frame=self.config.frame,
            xyz=scan.xyz,
            label=scan.label,
            instance=scan.instance,
            ring=scan.ring,
            column=scan.column,
            t_ns=scan.t_ns if self.config.spinning else None,
            others={} if self.config.signal is None else {name: getattr(scan, name) for name in MEASURED},
        )
