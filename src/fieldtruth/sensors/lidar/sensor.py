# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The LiDAR as a kind of sensor, and its message, PointCloud2."""

from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__PointCloud2 as PointCloud2
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__PointField as PointField

from fieldtruth.bag import messages as ros
from fieldtruth.core.arrays import Array
from fieldtruth.core.readings import Cloud
from fieldtruth.drive.passability import Passability
from fieldtruth.experiment.sensor_config import Output
from fieldtruth.kernels.lidar import Scan
from fieldtruth.kernels.lidar_noise import Reading
from fieldtruth.sensors.kind import At, Rays, Sensor, SensorWorld
from fieldtruth.sensors.lidar.config import MEASURED, PASSING, LidarConfig
from fieldtruth.sensors.lidar.sensing import IdealLidar, Lidar, Traced, ray_directions, sweep_times_ns

_DATATYPES: Final = {
    "<f4": PointField.FLOAT32,
    "<f8": PointField.FLOAT64,
    "<u4": PointField.UINT32,
    "<u2": PointField.UINT16,
    "|u1": PointField.UINT8,
}


def point_cloud(
    seq: int, stamp_ns: int, scan: Scan | Reading | Cloud, config: LidarConfig, *, wide_ids: bool = False
) -> bytes:
    """Serialise sensor_msgs/PointCloud2 of the returns, in the order of the scan; with ``t`` if the LiDAR spins.

    The scan of a LiDAR with a signal has ``true_range``, ``signal``, ``reflectivity``, ``echo`` and ``mixed``, which
    become fields. An Ouster's ``reflectivity`` is that in percent, at most 255, or without a signal the label; its
    ``range`` [mm] is that of the point, and its ``ambient`` zero. A Livox's ``line`` is the ring, its ``timestamp``
    [ns] the time of the ray, and its ``tag`` zero: a sure return. An organised cloud has a row for each ring, NaN as
    coordinates of rays without a return, and zero in their other fields but ring and column.
    """
    measured: Mapping[str, NDArray[Any]] = scan.others if isinstance(scan, Cloud) else _others(scan, config, None)
    t_ns = np.zeros(len(scan.xyz), np.int64) if scan.t_ns is None else scan.t_ns.astype(np.int64)
    kind, clock, maker = config.point_type(wide_ids=wide_ids), config.time_field, config.point_fields
    points = np.zeros(len(scan.xyz), kind)
    points["x"], points["y"], points["z"] = scan.xyz.T
    points["intensity"] = measured["reflectivity"] if config.intensity == "reflectivity" else scan.label
    for name, values in measured.items():
        points[name] = values
    if config.spinning:
        points["t"] = t_ns
    if config.spinning and clock:
        points[clock] = (t_ns + (stamp_ns if clock == "timestamp" else 0)) / 1e9
    points["ring"], points["column"] = scan.ring, scan.column
    points["label"], points["instance"] = scan.label, scan.instance
    if maker == "ouster":
        points["reflectivity"] = scan.label
        if config.signal is not None:
            points["reflectivity"] = np.minimum(np.rint(100.0 * measured["reflectivity"]), 255)
        points["range"] = np.rint(1000.0 * np.linalg.norm(scan.xyz.astype(np.float64), axis=1))
    if maker == "livox":
        points["line"], points["timestamp"] = scan.ring, stamp_ns + t_ns
    rows = _organised(points, config) if config.organised else points[None]
    message = PointCloud2(
        ros.header(seq, stamp_ns, config.frame),
        height=rows.shape[0],
        width=rows.shape[1],
        fields=[
            PointField(name, offset, _DATATYPES[base.str], 1)
            for name, (base, offset, *_) in (kind.fields or {}).items()
        ],
        is_bigendian=False,
        point_step=kind.itemsize,
        row_step=rows.shape[1] * kind.itemsize,
        data=rows.reshape(-1).view(np.uint8),
        is_dense=not config.organised,
    )
    return ros.serialize(message, "sensor_msgs/msg/PointCloud2")


def _others(scan: Scan | Reading, config: LidarConfig, passing: Passability | None) -> dict[str, NDArray[Any]]:
    """Return the fields that a LiDAR has with a signal, and with extras."""
    names = [*(MEASURED if config.signal is not None else ()), *["part"] * config.parts]
    found = {name: getattr(scan, name) for name in names}
    if passing is not None:
        found |= zip(PASSING, passing.of(scan.top, scan.label).T, strict=True)
    return found


def _organised(points: NDArray[np.void], config: LidarConfig) -> NDArray[np.void]:
    """Spread points over all rays, (rings, columns)."""
    spread = np.zeros((config.rings, config.columns), points.dtype)
    for axis in "xyz":
        spread[axis] = np.nan
    spread["ring"], spread["column"] = np.arange(config.rings)[:, None], np.arange(config.columns)
    spread[points["ring"], points["column"]] = points
    return spread


class LidarSensor(Sensor):
    """A LiDAR, which scans from one pose or, if it spins, from those of its turn."""

    config_type = LidarConfig
    config: LidarConfig

    def __init__(self, config: LidarConfig, sensor_world: SensorWorld) -> None:
        super().__init__(config, sensor_world)
        made = sensor_world
        self._lidar = Lidar(config, made.scene, made.robot_parts, made.weather, seed=made.seed)
        self._lidar.workers = made.workers
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
        tasks = {self.config.family: IdealLidar(self.config, self.sensor_world.scene).scan}
        return Rays(ray_directions(self.config).astype(np.float32), self.config.max_range, (tasks,))

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
            others=_others(scan, self.config, self.sensor_world.passability if self.config.passability else None),
        )
