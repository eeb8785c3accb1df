# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Series of ideal readings along a drive."""

from types import SimpleNamespace
from typing import Any

from fieldtruth.core.geodesy import PAPER_ORIGIN
from fieldtruth.drive.track import Track
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import SensorConfig
from fieldtruth.sensors.gnss.sensing import GnssReadings, read_gnss
from fieldtruth.sensors.imu.sensing import ImuReadings, read_imu
from fieldtruth.sensors.kind import At, SensorWorld, movement_of
from fieldtruth.sensors.known import sensor_class
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig
from fieldtruth.sensors.wheel_odometry.sensing import TachometerReadings, TrueWheels, WheelOdometry, WheelTruth


def imu_along(track: Track, rig: Rig | None = None) -> ImuReadings:
    return read_imu(track.motion, (rig or Rig()).imu)


def fixes_along(track: Track, rig: Rig | None = None) -> GnssReadings:
    return read_gnss(track.motion, (rig or Rig()).gnss)


def wheels_along(track: Track, rig: Rig | None = None) -> TrueWheels:
    assert track.base is not None
    return WheelTruth(WheelOdometryConfig(), (rig or Rig()).wheels).extend(track.motion.stamps_ns, track.base.wheels)


def tachometers_along(track: Track, rig: Rig | None = None) -> TachometerReadings:
    return wheels_along(track, rig).tachometers


def odometry_along(track: Track, rig: Rig | None = None) -> WheelOdometry:
    return wheels_along(track, rig).odometry


def reading_of(config: SensorConfig, track: Track, k: int, part: str = "", rig: Rig | None = None) -> Any:
    """Reading ``k`` of an ideal sensor of motion."""
    world: Any = SimpleNamespace(origin=PAPER_ORIGIN)
    sensor = sensor_class(config)(config, SensorWorld(world, rig or Rig(), seed=0))
    (output,) = (each for each in config.outputs() if each.part == part)
    stamp = round((k + 1) * 1e9 / output.rate_hz)
    return sensor.read(output, At(k, stamp, stamp, movement_of(track)))
