# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Topics of a bag with message type and rate: the paper's Table 5, with additions, for the sensors of a rig.

Their order is that of connection numbers, and of messages with the same stamp.
"""

from collections.abc import Container
from typing import Final

from fieldtruth.core.readings import Inertial
from fieldtruth.experiment.config import FRAME_RATE, Experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import KINDS
from fieldtruth.experiment.topic import Topic

TRUTH_RATE: Final = 1000.0  # [Hz]; the physics rate
MOST_REPEATED: Final = 500
"""Named objects that ``static_objects: auto`` repeats in every /gazebo/model_states. Each takes some 120 bytes; below
64 kB LZ4 finds the previous message, which is nearly the same."""
POSE_RATE: Final = 50.0  # [Hz]; /tf and odometry have a pose at every default stamp of IMU, cameras and LiDAR

CLOCK: Final = "/clock"
TF_STATIC: Final = "/tf_static"
MODEL_STATES: Final = "/gazebo/model_states"
STATIC_MODEL_STATES: Final = "/gazebo/static_model_states"
ODOMETRY: Final = "/ground_truth/odom"
TF: Final = "/tf"
COMMANDS: Final = "/cmd_vel"

_TRUTH: Final = (
    Topic(CLOCK, "rosgraph_msgs/msg/Clock", TRUTH_RATE),
    Topic(TF_STATIC, "tf2_msgs/msg/TFMessage", None),
    Topic(STATIC_MODEL_STATES, "gazebo_msgs/msg/ModelStates", None, "objects"),
    Topic(MODEL_STATES, "gazebo_msgs/msg/ModelStates", TRUTH_RATE),
    Topic(ODOMETRY, "nav_msgs/msg/Odometry", POSE_RATE),
    Topic(TF, "tf2_msgs/msg/TFMessage", POSE_RATE),
)


def topics_of(rig: Rig, *, latched: bool = False) -> tuple[Topic, ...]:
    """Topics that this rig publishes; ``latched``: static objects have a topic of their own."""
    rows = [row for row in _TRUTH if latched or row.kind != "objects"]
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
    rows = topics_of(experiment.rig, latched=latched)
    if experiment.frames is None:
        return rows
    still = (row for row in rows if row.kind not in KINDS or KINDS[row.kind].sees)
    return tuple(row if row.latched else row._replace(rate_hz=FRAME_RATE) for row in still)


PAPER_RIG: Final = Rig().with_extras(("depth", "instances"))
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


def objects_topic(present: Container[str]) -> str:
    """Return the topic of a bag, which has the topics ``present``, whose rows are the instance ids."""
    return STATIC_MODEL_STATES if STATIC_MODEL_STATES in present else MODEL_STATES


def latches_objects(experiment: Experiment, objects: int) -> bool:
    """Whether a run publishes its static objects once, by its option and the number of named objects in its world."""
    option = experiment.static_objects
    return objects > MOST_REPEATED if option == "auto" else option == "latched"
