# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The ROS 1 messages that a bag holds, as typed classes, and the store that turns them into bytes and back.

Quaternions change to ROS's (x, y, z, w) here and nowhere else.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
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

from fieldtruth.core import frames

F8 = NDArray[np.float64]

# Wording as in ROS, so that the MD5 sums are ROS's own.
TF_MESSAGE: Final = "geometry_msgs/TransformStamped[] transforms\n"
MODEL_STATES: Final = """\
# broadcast all model states in world frame
string[] name                 # model names
geometry_msgs/Pose[] pose     # desired pose in world frame
geometry_msgs/Twist[] twist   # desired twist in world frame
"""

STORE: Final = get_typestore(Stores.ROS1_NOETIC)
"""All message types of ROS noetic's common packages, and the two that the store lacks."""
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


def serialize(message: object, msgtype: str) -> bytes:
    """Bytes of a message; ``msgtype`` is like ``sensor_msgs/msg/Imu``."""
    return bytes(STORE.serialize_ros1(message, msgtype))


def time(stamp_ns: int) -> Time:
    """Stamp [ns] as ROS's seconds and nanoseconds."""
    return Time(*divmod(int(stamp_ns), 10**9))


def header(seq: int, stamp_ns: int, frame_id: str) -> Header:
    """Header of the ``seq``-th message of a topic, counted from 0."""
    return Header(seq, time(stamp_ns), frame_id)


def vector(xyz: F8) -> Vector3:
    """Vector of (3,)."""
    return Vector3(*map(float, xyz))


def point(xyz: F8) -> Point:
    """Point of (3,) [m]."""
    return Point(*map(float, xyz))


def quaternion(wxyz: F8) -> Quaternion:
    """Quaternion of (4,) in (w, x, y, z)."""
    return Quaternion(*map(float, frames.xyzw_from_wxyz(wxyz)))


def transform_stamped(head: Header, child: str, parent_from_child: F8) -> TransformStamped:
    """Transform (4, 4) from ``child`` to the header's frame."""
    rotation = frames.quaternion_wxyz_from_rotation(parent_from_child[:3, :3])
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
    "serialize",
    "time",
    "transform_stamped",
    "vector",
]
