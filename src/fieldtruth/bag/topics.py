# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Topics of a bag with message type and rate: the paper's Table 5, with additions.

The table's order is that of connection numbers, and of messages with the same stamp.
"""

from collections.abc import Callable, Container
from typing import Final, Literal, NamedTuple

from fieldtruth.experiment.config import FRAME_RATE, Experiment
from fieldtruth.experiment.rig import WHEELS, Rig

TRUTH_RATE: Final = 1000.0  # [Hz]; the physics rate
MOST_REPEATED: Final = 500
"""Named objects that ``static_objects: auto`` repeats in every /gazebo/model_states. Each takes some 120 bytes; below
64 kB LZ4 finds the previous message, which is nearly the same."""
POSE_RATE: Final = 50.0  # [Hz]; /tf and odometry have a pose at every default stamp of IMU, cameras and LiDAR
SIDES: Final = ("left", "right")

CLOCK: Final = "/clock"
TF_STATIC: Final = "/tf_static"
MODEL_STATES: Final = "/gazebo/model_states"
STATIC_MODEL_STATES: Final = "/gazebo/static_model_states"
ODOMETRY: Final = "/ground_truth/odom"
TF: Final = "/tf"
IMU: Final = "/imu/data"
NAVSAT: Final = "/navsat/fix"
WHEEL_SPEEDS: Final = tuple(f"/gazebo_client/{wheel}_speed" for wheel in WHEELS)
JOINT_STATES: Final = "/joint_states"
WHEEL_ODOMETRY: Final = "/odometry/wheel"
COMMANDS: Final = "/cmd_vel"
POINTS: Final = "/os1_cloud_node/points"


class Topic(NamedTuple):
    """A row of the table; ``rate_hz`` reads the rate [Hz] from the rig; None for one message per bag."""

    name: str
    msgtype: str
    rate_hz: Callable[[Rig], float] | None
    sensor: Literal["robot", "objects", "wheels", "lidar", "cameras", "depth", "instances"] = "robot"

    @property
    def latched(self) -> bool:
        """Whether late subscribers get the last message; true for topics that are published once."""
        return self.rate_hz is None

    def exists(self, rig: Rig) -> bool:
        """Whether this rig publishes it."""
        cameras = rig.cameras
        return {
            "robot": True,
            "objects": True,
            "wheels": rig.tachometers.enabled,
            "lidar": rig.lidar.enabled,
            "cameras": cameras.enabled,
            "depth": cameras.enabled and cameras.depth,
            "instances": cameras.enabled and cameras.instances,
        }[self.sensor]


def camera_info(side: str) -> str:
    """Topic of a camera's calibration."""
    return f"/stereo/camera/{side}/camera_info"


def photograph(side: str) -> str:
    """Topic of a camera's realistic images."""
    return f"/stereo/camera/{side}/real/compressed"


def tag(side: str) -> str:
    """Topic of a camera's tag images: the flat colour of the class at each pixel's centre."""
    return f"/stereo/camera/{side}/tag/img_raw"


def depth(side: str) -> str:
    """Topic of a camera's depth images: metres along the optical axis, 32FC1."""
    return f"/stereo/camera/{side}/depth"


def instances(side: str) -> str:
    """Topic of a camera's instance ids, 16UC1 or 32SC1: rows of ``objects_topic``, as the cloud's ``instance``."""
    return f"/stereo/camera/{side}/instances"


def _rate(rig: Rig) -> float:
    return rig.cameras.rate_hz


def _camera_topics(side: str) -> tuple[Topic, ...]:
    return (
        Topic(camera_info(side), "sensor_msgs/msg/CameraInfo", _rate, "cameras"),
        Topic(photograph(side), "sensor_msgs/msg/CompressedImage", _rate, "cameras"),
        Topic(tag(side), "sensor_msgs/msg/Image", _rate, "cameras"),
        Topic(depth(side), "sensor_msgs/msg/Image", _rate, "depth"),
        Topic(instances(side), "sensor_msgs/msg/Image", _rate, "instances"),
    )


TOPICS: Final[tuple[Topic, ...]] = (
    Topic(CLOCK, "rosgraph_msgs/msg/Clock", lambda rig: TRUTH_RATE),
    Topic(TF_STATIC, "tf2_msgs/msg/TFMessage", None),
    Topic(STATIC_MODEL_STATES, "gazebo_msgs/msg/ModelStates", None, "objects"),
    Topic(MODEL_STATES, "gazebo_msgs/msg/ModelStates", lambda rig: TRUTH_RATE),
    Topic(ODOMETRY, "nav_msgs/msg/Odometry", lambda rig: POSE_RATE),
    Topic(TF, "tf2_msgs/msg/TFMessage", lambda rig: POSE_RATE),
    Topic(IMU, "sensor_msgs/msg/Imu", lambda rig: rig.imu.rate_hz),
    Topic(NAVSAT, "sensor_msgs/msg/NavSatFix", lambda rig: rig.gnss.rate_hz),
    *(Topic(name, "std_msgs/msg/Float32", lambda rig: rig.tachometers.rate_hz, "wheels") for name in WHEEL_SPEEDS),
    Topic(JOINT_STATES, "sensor_msgs/msg/JointState", lambda rig: rig.odometry.rate_hz, "wheels"),
    Topic(WHEEL_ODOMETRY, "nav_msgs/msg/Odometry", lambda rig: rig.odometry.rate_hz, "wheels"),
    Topic(COMMANDS, "geometry_msgs/msg/Twist", lambda rig: rig.imu.rate_hz, "wheels"),  # the controller's rate
    Topic(POINTS, "sensor_msgs/msg/PointCloud2", lambda rig: rig.lidar.rate_hz, "lidar"),
    *_camera_topics("left"),
    *_camera_topics("right"),
)


_PUBLISHED: Final = {
    "/os0_cloud_node/points": POINTS,
    **{f"/gazebo_client/back_{side}_speed": f"/gazebo_client/rear_{side}_speed" for side in SIDES},
    **{f"/stereo/camera/{side}/tag/image_raw": tag(side) for side in SIDES},
}
"""Topics of the paper's data set whose names differ from the paper's Table 5."""


def standard_name(topic: str) -> str:
    """Return our name of a topic of the paper's data set, some of which lack the leading slash; others unchanged."""
    absolute = f"/{topic.lstrip('/')}"
    name = _PUBLISHED.get(absolute, absolute)
    return name if any(row.name == name for row in TOPICS) else topic


def objects_topic(present: Container[str]) -> str:
    """Return the topic of a bag, which has the topics ``present``, whose rows are the instance ids."""
    return STATIC_MODEL_STATES if STATIC_MODEL_STATES in present else MODEL_STATES


def latches_objects(experiment: Experiment, objects: int) -> bool:
    """Whether a run publishes its static objects once, by its option and the number of named objects in its world."""
    option = experiment.static_objects
    return objects > MOST_REPEATED if option == "auto" else option == "latched"


def topics_of(rig: Rig, *, latched: bool = False) -> tuple[Topic, ...]:
    """Rows that this rig publishes, in the table's order; ``latched``: static objects have a topic of their own."""
    return tuple(row for row in TOPICS if row.exists(rig) and (latched or row.sensor != "objects"))


def topics_of_run(experiment: Experiment, *, latched: bool) -> tuple[Topic, ...]:
    """Rows that a run of this experiment publishes: frames have all that has a meaning at one pose, at one rate."""
    rows = topics_of(experiment.rig, latched=latched)
    if experiment.frames is None:
        return rows
    still = (row for row in rows if row.sensor != "wheels" and row.name not in (IMU, NAVSAT))
    return tuple(row if row.latched else row._replace(rate_hz=lambda rig: FRAME_RATE) for row in still)
