# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The ROS 1 message types of our bags, as typed classes, and the store that serialises them.

Only here quaternions are converted to ROS's order (x, y, z, w).
"""

from dataclasses import dataclass
from typing import Final

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.stores.ros1_noetic import builtin_interfaces__msg__Time as Time
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__Point as Point
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__Pose as Pose
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__Quaternion as Quaternion
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__Transform as Transform
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__TransformStamped as TransformStamped
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__Twist as Twist
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__Vector3 as Vector3
from rosbags.typesys.stores.ros1_noetic import std_msgs__msg__Header as Header

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array

# Wording as in ROS, so that the MD5 sums are ROS's own.
TF_MESSAGE: Final = "geometry_msgs/TransformStamped[] transforms\n"
MODEL_STATES: Final = """\
# broadcast all model states in world frame
string[] name                 # model names
geometry_msgs/Pose[] pose     # desired pose in world frame
geometry_msgs/Twist[] twist   # desired twist in world frame
"""

STORE: Final = get_typestore(Stores.ROS1_NOETIC)
"""All message types of the common packages of ROS noetic, and the two that rosbags lacks."""
STORE.register(get_types_from_msg(TF_MESSAGE, "tf2_msgs/msg/TFMessage"))
STORE.register(get_types_from_msg(MODEL_STATES, "gazebo_msgs/msg/ModelStates"))


@dataclass(frozen=True)
class TFMessage:
    """tf2_msgs/TFMessage."""

    transforms: list[TransformStamped]


@dataclass(frozen=True)
class ModelStates:
    """gazebo_msgs/ModelStates."""

    name: list[str]
    pose: list[Pose]
    twist: list[Twist]


def register(definition: str, msgtype: str) -> type:
    """Make a type of messages known that rosbags lacks, and return its class.

    Args:
        definition: text of its .msg file.
        msgtype: like ``my_package/msg/Sonar``.
    """
    if msgtype not in STORE.fielddefs:
        STORE.register(get_types_from_msg(definition, msgtype))
    return STORE.types[msgtype]


def serialize(message: object, msgtype: str) -> bytes:
    """Serialise a message; ``msgtype`` is like ``sensor_msgs/msg/Imu``."""
    return bytes(STORE.serialize_ros1(message, msgtype))


def time(stamp_ns: int) -> Time:
    """Convert a stamp [ns] to ROS's seconds and nanoseconds."""
    return Time(*divmod(int(stamp_ns), 10**9))


def header(seq: int, stamp_ns: int, frame_id: str) -> Header:
    """Return the header of the ``seq``-th message of a topic, counted from 0."""
    return Header(seq, time(stamp_ns), frame_id)


def vector(xyz: Array) -> Vector3:
    """Convert (3,) to a Vector3."""
    return Vector3(*map(float, xyz))


def point(xyz: Array) -> Point:
    """Convert (3,) [m] to a Point."""
    return Point(*map(float, xyz))


def quaternion(wxyz: Array) -> Quaternion:
    """Convert (4,) in the order (w, x, y, z) to a Quaternion."""
    return Quaternion(*map(float, transforms.xyzw_from_wxyz(wxyz)))


def transform_stamped(head: Header, child: str, parent_from_child: Array) -> TransformStamped:
    """Convert (4, 4), from ``child`` to the header's frame, to a TransformStamped."""
    rotation = transforms.quaternion_wxyz_from_rotation(parent_from_child[:3, :3])
    return TransformStamped(head, child, Transform(vector(parent_from_child[:3, 3]), quaternion(rotation)))


__all__ = [
    "STORE",
    "Header",
    "ModelStates",
    "Point",
    "Pose",
    "Quaternion",
    "TFMessage",
    "Time",
    "Transform",
    "TransformStamped",
    "Twist",
    "Vector3",
    "header",
    "point",
    "quaternion",
    "register",
    "serialize",
    "time",
    "transform_stamped",
    "vector",
]
