# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The inertial measurement unit as a kind of sensor."""

from collections.abc import Iterable

from fieldtruth.core.random import rng_of
from fieldtruth.drive.track import Track
from fieldtruth.experiment.topic import Output
from fieldtruth.sensors.imu import message
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.imu.message import ImuReading
from fieldtruth.sensors.imu.noise import MeasuredImu, measured_imu
from fieldtruth.sensors.imu.sensing import read_imu
from fieldtruth.sensors.kind import At, MotionSensor


class Imu(MotionSensor):
    """An inertial measurement unit."""

    config_type = ImuConfig
    config: ImuConfig

    def true_series(self, track: Track) -> MeasuredImu:
        """Return the readings of an ideal IMU; its covariances are unknown."""
        return MeasuredImu(read_imu(track.motion, self.config), *message.UNKNOWN)

    def signal_series(self, true: MeasuredImu, track: Track) -> MeasuredImu:
        """Return what a real IMU reads."""
        assert self.config.signal is not None
        rng = rng_of(self.place.seed, self.config.name)
        return measured_imu(true.readings, self.config.signal, self.config.rate_hz, rng)

    def reading(self, output: Output, at: At, series: MeasuredImu) -> ImuReading:
        """Return one reading."""
        found, *covariances = series
        return ImuReading(
            **at.stamps,
            frame=self.config.frame,
            angular_velocity=found.angular_velocity[at.number],
            linear_acceleration=found.linear_acceleration[at.number],
            orientation_wxyz=found.quaternion_wxyz[at.number],
            covariances=(covariances[0], covariances[1], covariances[2]),
        )

    def messages(self, output: Output, number: int, reading: ImuReading) -> Iterable[bytes]:
        """Serialise sensor_msgs/Imu."""
        return [message.imu(number, reading)]
