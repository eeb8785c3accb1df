# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of an inertial measurement unit."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import Field

from fieldtruth.core.readings import Inertial, Reading
from fieldtruth.experiment.fields import Mount, Rate
from fieldtruth.experiment.sensor_config import FrameName, MountedConfig, Section, SensorName, TopicName
from fieldtruth.experiment.topic import Output
from fieldtruth.sensors.imu.signal import ImuSignal

_SAMPLING: Final = {
    "mean": "reads means over the interval that ends at the stamp, from the motion at 1 kHz: turns about all\n"
    "  axes are added up as rotations, and the specific force is expressed in `{frame}` at the stamp.",
    "instant": "reads the last millisecond before each stamp: what shakes faster than half its rate appears\n"
    "  as slower motion.",
}


_SHORT: Final = {"mean": "means between stamps", "instant": "the last millisecond before each stamp"}


class ImuConfig(MountedConfig):
    """Inertial measurement unit; by default the paper's, in imu_link."""

    noun: ClassVar[str] = "IMU"
    gives: ClassVar[type[Reading]] = Inertial
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

    def figures(self) -> str:
        """Return how it samples the motion."""
        return "mean over the interval" if self.sampling == "mean" else "at the instant"

    def summary(self) -> str:
        """Return rate, frame and sampling."""
        return f"{self.rate_hz:g} Hz in `{self.frame}`, {_SHORT[self.sampling]}."

    def notes(self, named: str) -> list[str]:
        """Return how it samples the motion."""
        return [f"{named} {_SAMPLING[self.sampling].format(frame=self.frame)}"]

    def outputs(self) -> tuple[Output, ...]:
        """Its readings, and the ideal ones if it is not ideal."""
        return self.with_truth(self.output(self.new_topic(self.topic, "sensor_msgs/msg/Imu"), reading=Inertial))
