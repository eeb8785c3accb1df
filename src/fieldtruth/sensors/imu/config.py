# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of an inertial measurement unit."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from fieldtruth.experiment.fields import Mount, Rate
from fieldtruth.experiment.sensor_config import FrameName, MountedConfig, Section, SensorName, TopicName
from fieldtruth.experiment.topic import Output
from fieldtruth.sensors.imu.signal import ImuSignal


class ImuConfig(MountedConfig):
    """Inertial measurement unit; by default the paper's, in imu_link."""

    sees: ClassVar[bool] = False
    bag_order: ClassVar[float] = 1
    frame_order: ClassVar[float] = 4

    sections: ClassVar[Mapping[str, Section]] = {"imu": Section()}
    datasheet: ClassVar[str] = "3dm_gx5_25"

    kind: Literal["imu"] = "imu"
    name: SensorName = "imu"
    topic: TopicName = "/imu/data"
    frame: FrameName = "imu_link"
    mount: Mount = Mount(xyz=(0.19, 0.0, 0.149), rpy_deg=(0.0, -90.0, 180.0))
    rate_hz: Rate = 50.0
    sampling: Annotated[Literal["mean", "instant"], Field(description="mean or instant")] = "mean"
    """mean: over the interval between two readings, so that integrating gives the motion; instant: over the physics
    step that ends at the stamp, as in Gazebo."""
    signal: ImuSignal | None = None

    @classmethod
    def of_name(cls, name: str) -> dict[str, Any]:
        """Topic and frame that an IMU has by its name."""
        return {**super().of_name(name), "topic": f"/{name}/data"}

    def outputs(self) -> tuple[Output, ...]:
        """Its readings, and the ideal ones if it is not ideal."""
        return self.with_truth(self.output(self.new_topic(self.topic, "sensor_msgs/msg/Imu")))
