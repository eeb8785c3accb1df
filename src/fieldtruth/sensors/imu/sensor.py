# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The inertial measurement unit as a kind of sensor, and its message, Imu.

Covariances of ideal readings are all zero. ROS reads zeros as "unknown", so a filter must be given its own.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from fieldtruth.bag import messages as ros
from fieldtruth.core.arrays import Array
from fieldtruth.core.random import rng_of
from fieldtruth.core.readings import Inertial
from fieldtruth.core.transforms import xyzw_from_wxyz
from fieldtruth.drive.track import Track
from fieldtruth.experiment.sensor_config import Output
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.imu.sensing import ImuErrors, ImuTruth, MeasuredImu
from fieldtruth.sensors.kind import At, MotionSensor

Covariances = tuple[Array, Array, Array]
UNKNOWN: Final = (np.zeros(9), np.zeros(9), np.zeros(9))
"""Covariances of an ideal IMU, which ROS reads as unknown."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ImuReading(Inertial):
    """A reading with the covariances (9,) of orientation, angular velocity and linear acceleration."""

    covariances: Covariances = UNKNOWN


def imu(k: Any, reading: ImuReading) -> list[bytes]:
    """Serialise sensor_msgs/Imu, all of it in the IMU's frame (REP-145); the orientation is world_from_imu."""
    attitude, rate, force = (each.tobytes() for each in reading.covariances)
    return ros.serialized(
        np.size(k),
        *ros.header_fields(k, reading.header_ns, reading.frame),
        xyzw_from_wxyz(reading.orientation_wxyz),
        attitude,
        reading.angular_velocity,
        rate,
        reading.linear_acceleration,
        force,
    )


class Imu(MotionSensor):
    """An inertial measurement unit."""

    config_type = ImuConfig
    config: ImuConfig

    def begin(self) -> tuple[ImuTruth, ImuErrors | None]:
        """Return the readings of an ideal IMU and the errors of a real one, which go on as the motion grows."""
        config, rng = self.config, rng_of(self.sensor_world.seed, self.config.name)
        return ImuTruth(config), None if config.signal is None else ImuErrors(config.signal, config.rate_hz, rng)

    def extend(self, memory: tuple[ImuTruth, ImuErrors | None], track: Track) -> tuple[MeasuredImu, MeasuredImu]:
        """Return what an ideal IMU reads, whose covariances are unknown, and what a real one reads."""
        truth, errors = memory
        true = MeasuredImu(truth.extend(track.motion), *UNKNOWN)
        return true, true if errors is None else errors.extend(true.readings)

    def reading(self, output: Output, at: At, series: MeasuredImu) -> ImuReading:
        """Return readings."""
        found, *covariances = series
        return ImuReading(
            **at.stamps,
            frame=self.config.frame,
            angular_velocity=found.angular_velocity[at.number],
            linear_acceleration=found.linear_acceleration[at.number],
            orientation_wxyz=found.quaternion_wxyz[at.number],
            covariances=(covariances[0], covariances[1], covariances[2]),
        )

    def messages(self, output: Output, number: Any, reading: ImuReading) -> Iterable[bytes]:
        """Serialise sensor_msgs/Imu."""
        return imu(number, reading)
