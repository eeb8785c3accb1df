# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of a GNSS receiver."""

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from fieldtruth.core.readings import Fix, Reading
from fieldtruth.experiment.fields import Mount, Rate
from fieldtruth.experiment.sensor_config import FrameName, MountedConfig, Section, SensorName, TopicName
from fieldtruth.experiment.topic import Output
from fieldtruth.sensors.gnss.signal import GnssSignal


class GnssConfig(MountedConfig):
    """GNSS receiver; the mount is that of its antenna, by default the paper's GNSS_link."""

    noun: ClassVar[str] = "GNSS receiver"
    gives: ClassVar[type[Reading]] = Fix
    sees: ClassVar[bool] = False
    in_hull: ClassVar[bool] = False
    bag_order: ClassVar[float] = 2
    frame_order: ClassVar[float] = 1

    sections: ClassVar[Mapping[str, Section]] = {"gnss": Section()}
    datasheet: ClassVar[str] = "duro"

    kind: Literal["gnss"] = "gnss"
    name: SensorName = "gnss"
    topic: TopicName = "/navsat/fix"
    frame: FrameName = "GNSS_link"
    mount: Mount = Mount(xyz=(0.10, 0.0, 0.890))
    rate_hz: Rate = 2.0
    signal: GnssSignal | None = None

    @classmethod
    def of_name(cls, name: str) -> dict[str, Any]:
        """Topic and frame that an antenna has by its name."""
        return {**super().of_name(name), "topic": f"/{name}/fix"}

    def summary(self) -> str:
        """Return rate and frame."""
        return f"{self.rate_hz:g} Hz, antenna at `{self.frame}`."

    def outputs(self) -> tuple[Output, ...]:
        """Its positions, and the ideal ones if it is not ideal."""
        return self.with_truth(self.output(self.new_topic(self.topic, "sensor_msgs/msg/NavSatFix"), reading=Fix))
