# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Topics of a bag with message type and rate, and the sensors of a rig as a bag has them.

Topics are those of the paper's Table 5, with additions; each sensor's own is in `sensors/KIND/config.py`, the
images' in `experiment/image_topics.py`. Their order is that of connection numbers, and of messages with the same
stamp.
"""

from collections.abc import Collection, Container, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from fieldtruth.core import readings
from fieldtruth.core.readings import Inertial
from fieldtruth.experiment.config import FRAME_RATE, Experiment
from fieldtruth.experiment.imaging_config import ImagingConfig
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import KINDS, SensorConfig, Topic

TRUTH_RATE: Final = 1000.0  # [Hz]; the physics rate
MOST_REPEATED: Final = 500
"""Named objects that ``static_objects: auto`` repeats in every /gazebo/model_states. Each takes some 120 bytes; below
64 kB LZ4 finds the previous message, which is nearly the same."""
POSE_RATE: Final = 50.0  # [Hz]; /tf and odometry have a pose at every default stamp of IMU, cameras and LiDAR
KNOT_RATE: Final = 100.0
"""Knots per second of the motion of what moves beside the robot."""
CLOCK: Final = "/clock"
TF_STATIC: Final = "/tf_static"
MODEL_STATES: Final = "/gazebo/model_states"
STATIC_MODEL_STATES: Final = "/gazebo/static_model_states"
ODOMETRY: Final = "/ground_truth/odom"
TF: Final = "/tf"
ACTOR_JOINTS: Final = "/actors/joint_states"
COMMANDS: Final = "/cmd_vel"
ROBOT: Final = "husky"
"""The robot in the topics of model states, which the paper drives."""
_TRUTH: Final = (
    Topic(CLOCK, "rosgraph_msgs/msg/Clock", TRUTH_RATE),
    Topic(TF_STATIC, "tf2_msgs/msg/TFMessage", None),
    Topic(STATIC_MODEL_STATES, "gazebo_msgs/msg/ModelStates", None, "objects"),
    Topic(MODEL_STATES, "gazebo_msgs/msg/ModelStates", TRUTH_RATE),
    Topic(ODOMETRY, "nav_msgs/msg/Odometry", POSE_RATE),
    Topic(TF, "tf2_msgs/msg/TFMessage", POSE_RATE),
    Topic(ACTOR_JOINTS, "sensor_msgs/msg/JointState", KNOT_RATE, "actors"),
)


def topics_of(rig: Rig, *, latched: bool = False, actors: bool = False) -> tuple[Topic, ...]:
    """Topics that this rig publishes, beside ``actors``; ``latched``: static objects have a topic of their own."""
    left_out = [*["objects"] * (not latched), *["actors"] * (not actors)]
    rows = [row for row in _TRUTH if row.kind not in left_out]
    for sensor in rig.in_order():
        rows += (topic for output in sensor.outputs_on(rig.robot) for topic in output.topics)
        if sensor.needs_wheels:
            # The controller's rate is that of the IMU.
            rows.append(
                Topic(COMMANDS, "geometry_msgs/msg/Twist", rig.first(Inertial).rate_hz, sensor.kind, sensor.name)
            )
    return tuple(rows)


def topics_of_run(experiment: Experiment, *, latched: bool) -> tuple[Topic, ...]:
    """Topics that a run of this experiment publishes: frames have all that has a meaning at one pose, at one rate."""
    rows = topics_of(experiment.rig, latched=latched, actors=bool(experiment.actors))
    if experiment.frames is None:
        return rows
    still = (row for row in rows if row.kind not in KINDS or KINDS[row.kind].sees)
    return tuple(row if row.latched else row._replace(rate_hz=FRAME_RATE) for row in still)


PAPER_RIG: Final = Rig().with_sensors(ImagingConfig, depth=True, instances=True)
"""The paper's rig, with depth and instances."""
PAPER_TOPICS: Final = topics_of(PAPER_RIG, latched=True)
"""Topics of this rig."""
_PUBLISHED: Final = {
    "/os0_cloud_node/points": "/os1_cloud_node/points",
    **{f"/gazebo_client/back_{side}_speed": f"/gazebo_client/rear_{side}_speed" for side in ("left", "right")},
    **{f"/stereo/camera/{side}/tag/image_raw": f"/stereo/camera/{side}/tag/img_raw" for side in ("left", "right")},
}
"""Topics of the paper's data set whose names differ from the paper's Table 5."""


def standard_name(topic: str) -> str:
    """Return our name of a topic of the paper's data set, some of which lack the leading slash; others unchanged."""
    absolute = f"/{topic.lstrip('/')}"
    name = _PUBLISHED.get(absolute, absolute)
    return name if any(row.name == name for row in PAPER_TOPICS) else topic


def in_namespace(topic: str, namespace: str | None) -> str:
    """Return the name of a topic in the bag of one of several robots: all but /clock are in its namespace."""
    return topic if namespace is None or topic == CLOCK else f"/{namespace}{topic}"


def namespace_of(topics: Collection[str]) -> str | None:
    """Return the namespace of the topics of a bag of ours, as ``in_namespace`` adds it; None without one."""
    name = next((topic.removesuffix(ODOMETRY)[1:] for topic in topics if topic.endswith(ODOMETRY)), "")
    inside = name and all(topic == CLOCK or topic.startswith(f"/{name}/") for topic in topics)
    return name if inside else None


def objects_topic(present: Container[str]) -> str:
    """Return the topic of a bag, which has the topics ``present``, whose rows are the instance ids."""
    return STATIC_MODEL_STATES if STATIC_MODEL_STATES in present else MODEL_STATES


def latches_objects(experiment: Experiment, objects: int) -> bool:
    """Return True if a run publishes its static objects once: by its option and the number of objects in its world."""
    option = experiment.static_objects
    return objects > MOST_REPEATED if option == "auto" else option == "latched"


EXTRAS: Final = ("depth", "instance", "normal", "flow", "part", "passability")
"""Fields of an image that are recorded on demand."""
_TYPES: Final[Mapping[str, type[readings.Reading]]] = {
    "sensor_msgs/msg/PointCloud2": readings.Cloud,
    "sensor_msgs/msg/Imu": readings.Inertial,
    "sensor_msgs/msg/NavSatFix": readings.Fix,
    "sensor_msgs/msg/JointState": readings.Joints,
    "nav_msgs/msg/Odometry": readings.Odometry,
}
"""Type of the readings of an output that does not state it, by that of its messages."""


@dataclass(frozen=True)
class Source:
    """A sensor that gives readings: a LiDAR, one view of a camera, the wheels' speeds, their odometry, ..."""

    name: str
    """Of the sensor, with a part behind a slash where it has several, as ``NAME/left``."""
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
        """Return whether a bag has some parts, by default the first."""
        return all(topic in present for topic in ([self.topics[part] for part in parts] or [self.topic]))


def sources_of(rig: Rig, *, disabled: bool = False) -> dict[str, Source]:
    """Sources of the sensors of a rig, with ``disabled`` also of those that are not enabled, by name, in its order."""
    enabled = (sensor for sensor in rig.sensors if sensor.enabled or disabled)
    return {source.name: source for sensor in enabled for source in _sources(sensor)}


def _sources(sensor: SensorConfig) -> Iterator[Source]:
    for output in (each for each in sensor.outputs() if not each.ideal):
        fields = output.fields or {"main": output.topics[0]}
        kind = output.reading
        if kind is readings.Message:
            kind = _TYPES.get(output.topics[0].msgtype, kind)
        yield Source(
            name=output.name,
            label=output.label or output.name,
            type=kind,
            topics={part: topic.name for part, topic in fields.items()},
            msgtypes={topic.name: topic.msgtype for topic in fields.values()},
            frame=output.frame,
            config=sensor,
            device=sensor.name,
            side=output.part if kind is readings.Image else "",
            info=output.info,
        )
