# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Classes of ROS's messages of motion, and vectors as these, for bags that tests make."""

from typing import Any

from numpy.typing import NDArray
from rosbags.typesys.stores import ros1_noetic as noetic

from fieldtruth.bag.messages import STORE, header, serialize
from fieldtruth.core import transforms

__all__ = ["STORE", "header", "serialize"]

Point = noetic.geometry_msgs__msg__Point
Pose = noetic.geometry_msgs__msg__Pose
Quaternion = noetic.geometry_msgs__msg__Quaternion
Transform = noetic.geometry_msgs__msg__Transform
TransformStamped = noetic.geometry_msgs__msg__TransformStamped
Twist = noetic.geometry_msgs__msg__Twist
Vector3 = noetic.geometry_msgs__msg__Vector3
ModelStates: Any = STORE.types["gazebo_msgs/msg/ModelStates"]
TFMessage: Any = STORE.types["tf2_msgs/msg/TFMessage"]


def vector(xyz: NDArray[Any]) -> Vector3:
    return Vector3(*map(float, xyz))


def point(xyz: NDArray[Any]) -> Point:
    return Point(*map(float, xyz))


def quaternion(wxyz: NDArray[Any]) -> Quaternion:
    return Quaternion(*map(float, transforms.xyzw_from_wxyz(wxyz)))


def transform_stamped(head: Any, child: str, parent_from_child: NDArray[Any]) -> TransformStamped:
    rotation = transforms.quaternion_wxyz_from_rotation(parent_from_child[:3, :3])
    return TransformStamped(head, child, Transform(vector(parent_from_child[:3, 3]), quaternion(rotation)))
