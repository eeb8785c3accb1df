# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The sensors of a rig as a bag has them: topics, and the type of their readings. Only here a reader asks for kinds."""

from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from fieldtruth.core import readings
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import SensorConfig
from fieldtruth.experiment.sensor_families import Imager
from fieldtruth.experiment.topic import WHEELS
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.wheel_odometry.config import WHEEL_SPEEDS

PARTS: Final = {
    "photo": "photograph",
    "label": "tag",
    "depth": "depth",
    "instance": "instances",
    "normal": "normals",
    "flow": "flow",
}
"""Stream of a camera by the field of an image that it becomes."""
EXTRAS: Final = ("depth", "instance", "normal", "flow")
"""Fields of an image that are recorded on demand."""
_TYPES: Final[Mapping[str, type[readings.Reading]]] = {
    "sensor_msgs/msg/PointCloud2": readings.Cloud,
    "sensor_msgs/msg/Imu": readings.Inertial,
    "sensor_msgs/msg/NavSatFix": readings.Fix,
    "sensor_msgs/msg/JointState": readings.Joints,
    "nav_msgs/msg/Odometry": readings.Odometry,
}


@dataclass(frozen=True)
class Source:
    """A sensor that gives readings: a LiDAR, one view of a camera, the wheels' speeds, their odometry, ..."""

    name: str
    """That of the output: of the sensor, with a part behind a slash where it has several, as ``NAME/left``."""
    label: str
    """In files: the name, or that of a view: left and right of the paper's pair, ``NAME_left`` of others."""
    type: type[readings.Reading]
    topics: Mapping[str, str]
    """Topic by part: of an image by its field, of wheels by name; of others the only one is ``main``."""
    msgtypes: Mapping[str, str]
    """Type of message by topic."""
    frame: str
    """Of the readings, by the configuration; empty if they have none."""
    config: Any
    """Of the sensor."""
    device: str
    """Name of the sensor, which is that of both views of a pair."""
    side: str = ""
    """left or right of a pair."""
    info: str = ""
    """Topic of the calibration of a camera."""

    @property
    def topic(self) -> str:
        """The first topic: of the clouds, of the photographs."""
        return next(iter(self.topics.values()))

    def recorded(self, present: Container[str]) -> tuple[str, ...]:
        """Parts whose topics are in a bag."""
        return tuple(part for part, topic in self.topics.items() if topic in present)

    def has(self, present: Container[str], *parts: str) -> bool:
        """Whether a bag has some parts, by default the first."""
        return all(topic in present for topic in ([self.topics[part] for part in parts] or [self.topic]))


def sources_of(rig: Rig, *, disabled: bool = False) -> dict[str, Source]:
    """Sources of the sensors of a rig, with ``disabled`` also of those that are not enabled, by name, in its order."""
    enabled = (sensor for sensor in rig.sensors if sensor.enabled or disabled)
    return {source.name: source for sensor in enabled for source in _sources(sensor)}


def _sources(sensor: SensorConfig) -> Iterator[Source]:
    if isinstance(sensor, CameraConfig):
        yield from map(_view, sensor.imagers())
        return
    for output in sensor.outputs():
        if output.ideal:
            continue
        found: dict[type[readings.Reading], dict[str, str]] = {}
        for topic in output.topics:
            if topic.name in WHEEL_SPEEDS:
                parts, part = found.setdefault(readings.WheelSpeeds, {}), WHEELS[WHEEL_SPEEDS.index(topic.name)]
            else:
                parts, part = found.setdefault(_TYPES.get(topic.msgtype, readings.Message), {}), "main"
            parts[part if part not in parts else topic.name] = topic.name
        for kind, parts in found.items():
            name = output.name if output.topics[0].name in parts.values() else f"{output.name}/others"
            types = {topic.name: topic.msgtype for topic in output.topics if topic.name in parts.values()}
            yield Source(name, name, kind, parts, types, output.frame, sensor, sensor.name)


def _view(imager: Imager) -> Source:
    sensor = imager.config
    topics = {part: imager.topic_of(stream) for part, stream in PARTS.items()}
    name = f"{sensor.name}/{imager.side}" if imager.side else imager.name
    image = "sensor_msgs/msg/Image"
    types: dict[str, Any] = dict.fromkeys(topics.values(), image)
    types[topics["photo"]] = "sensor_msgs/msg/CompressedImage"
    return Source(
        name, imager.name, readings.Image, topics, types, imager.optical_frame, sensor, sensor.name, imager.side,
        imager.topic_of("camera_info"),
    )  # fmt: skip
