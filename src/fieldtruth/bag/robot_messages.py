# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""From the true motion to messages: clock, transforms, odometry, model states.

Covariances are all zero: the poses are exact. ROS reads zeros as "unknown", so a filter must be given its own.
"""

import struct
from collections.abc import Mapping
from typing import Final

import numpy as np
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__PoseWithCovariance as PoseWithCovariance
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__TwistWithCovariance as TwistWithCovariance
from rosbags.typesys.stores.ros1_noetic import nav_msgs__msg__Odometry as Odometry
from rosbags.typesys.stores.ros1_noetic import rosgraph_msgs__msg__Clock as Clock

from fieldtruth.bag import types as ros
from fieldtruth.bag.base_messages import BASE, WHEEL_FRAMES
from fieldtruth.bag.model_states import ROBOT
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.drive.track import Motion, State
from fieldtruth.experiment.rig import Rig
from fieldtruth.world.model import World

WORLD: Final = "world"


def clock(stamp_ns: int) -> bytes:
    """Serialise rosgraph_msgs/Clock: the simulated time."""
    return ros.serialize(Clock(ros.time(stamp_ns)), "rosgraph_msgs/msg/Clock")


def rig_transforms(rig: Rig) -> dict[tuple[str, str], Array]:
    """Return all fixed ``parent_from_child`` (4, 4) by (parent, child), with the optical frames."""
    result = {(BASE, name): mount.base_from_sensor for name, mount in rig.mounts().items()}
    optical = [frame for sensor in rig.sensors for frame in sensor.optical_frames().items()]
    return result | {(parent, name): parent_from_optical for name, (parent, parent_from_optical) in optical}


def fixed_transforms(rig: Rig) -> dict[tuple[str, str], Array]:
    """Return those of ``rig_transforms`` that belong to /tf_static: without the wheels if these turn."""
    turning = () if not rig.reports_wheels else WHEEL_FRAMES
    return {pair: transform for pair, transform in rig_transforms(rig).items() if pair[1] not in turning}


def tf_static(stamp_ns: int, transforms: Mapping[tuple[str, str], Array]) -> bytes:
    """Serialise tf2_msgs/TFMessage of all fixed transforms."""
    stamped = [
        ros.transform_stamped(ros.header(0, stamp_ns, parent), child, parent_from_child)
        for (parent, child), parent_from_child in transforms.items()
    ]
    return ros.serialize(ros.TFMessage(stamped), "tf2_msgs/msg/TFMessage")


def tf(seq: int, stamp_ns: int, state: State, wheels: Mapping[str, Array]) -> bytes:
    """Serialise tf2_msgs/TFMessage of base_link in the world, and of the wheels: base_from_wheel (4, 4) by frame."""
    transform = ros.Transform(ros.vector(state.position), ros.quaternion(state.quaternion_wxyz))
    stamped = [ros.TransformStamped(ros.header(seq, stamp_ns, WORLD), BASE, transform)]
    head = ros.header(seq, stamp_ns, BASE)
    stamped += [ros.transform_stamped(head, name, base_from_wheel) for name, base_from_wheel in wheels.items()]
    return ros.serialize(ros.TFMessage(stamped), "tf2_msgs/msg/TFMessage")


def odometry(seq: int, stamp_ns: int, state: State) -> bytes:
    """Serialise nav_msgs/Odometry: the pose in the world, the twist in base_link."""
    base_from_world = transforms.rotation_from_quaternion_wxyz(state.quaternion_wxyz).T
    linear, angular = base_from_world @ state.linear_velocity, base_from_world @ state.angular_velocity
    twist = ros.Twist(ros.vector(linear), ros.vector(angular))
    pose = ros.Pose(ros.point(state.position), ros.quaternion(state.quaternion_wxyz))
    message = Odometry(
        ros.header(seq, stamp_ns, WORLD),
        BASE,
        PoseWithCovariance(pose, np.zeros(36)),
        TwistWithCovariance(twist, np.zeros(36)),
    )
    return ros.serialize(message, "nav_msgs/msg/Odometry")


class ModelStatesWriter:
    """Writes gazebo_msgs/ModelStates at the physics rate: only the robot moves, so 104 bytes of a template are patched.

    Row i is the object with id i, as in the cloud's ``instance``: first the robot, then the ground, then the rest, or
    only the first ``rows``. The twist is that of base_link's origin in the world frame, as in Gazebo.
    """

    def __init__(self, world: World, rows: int | None = None) -> None:
        names = [ROBOT, *world.object_names[1:]][:rows]
        origin = ros.Pose(ros.Point(0.0, 0.0, 0.0), ros.Quaternion(0.0, 0.0, 0.0, 1.0))
        still = ros.Twist(ros.Vector3(0.0, 0.0, 0.0), ros.Vector3(0.0, 0.0, 0.0))
        poses = [origin] * len(names)
        for instance in world.instances:
            if instance.object_id < len(names):
                poses[instance.object_id] = _pose(instance.world_from_object)
        message = ros.ModelStates(names, poses, [still] * len(names))
        self.template = ros.serialize(message, "gazebo_msgs/msg/ModelStates")
        self._pose_at = 4 + sum(4 + len(name.encode()) for name in names) + 4
        self._twist_at = self._pose_at + 56 * len(names) + 4

    def message(self, k: int, motion: Motion) -> bytes:
        """Serialise the message at row ``k`` of the motion."""
        data = bytearray(self.template)
        w, x, y, z = motion.quaternion_wxyz[k]
        struct.pack_into("<7d", data, self._pose_at, *motion.position[k], x, y, z, w)
        struct.pack_into("<6d", data, self._twist_at, *motion.linear_velocity[k], *motion.angular_velocity[k])
        return bytes(data)


def _pose(world_from_object: Array) -> ros.Pose:
    """Return the pose of an object, whose matrix may also scale."""
    rotation = world_from_object[:3, :3] / np.cbrt(np.linalg.det(world_from_object[:3, :3]))
    orientation = ros.quaternion(transforms.quaternion_wxyz_from_rotation(rotation))
    return ros.Pose(ros.point(world_from_object[:3, 3]), orientation)
