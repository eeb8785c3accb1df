# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of ROS 1: typed classes, the store that serialises them, and those of the robot and its motion.

Only here quaternions are converted to ROS's order (x, y, z, w). Covariances are all zero: the poses are exact. ROS
reads zeros as "unknown", so a filter must be given its own.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.stores import ros1_noetic as noetic

from fieldtruth.bag.topics import ROBOT
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.drive.track import Commands, Motion, State
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import WHEELS
from fieldtruth.experiment.sensor_config import BASE
from fieldtruth.world.model import World

Time = noetic.builtin_interfaces__msg__Time
Point = noetic.geometry_msgs__msg__Point
Pose = noetic.geometry_msgs__msg__Pose
PoseWithCovariance = noetic.geometry_msgs__msg__PoseWithCovariance
Quaternion = noetic.geometry_msgs__msg__Quaternion
Transform = noetic.geometry_msgs__msg__Transform
TransformStamped = noetic.geometry_msgs__msg__TransformStamped
Twist = noetic.geometry_msgs__msg__Twist
TwistWithCovariance = noetic.geometry_msgs__msg__TwistWithCovariance
Vector3 = noetic.geometry_msgs__msg__Vector3
Odometry = noetic.nav_msgs__msg__Odometry
Clock = noetic.rosgraph_msgs__msg__Clock
Header = noetic.std_msgs__msg__Header

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


WHEEL_FRAMES: Final = tuple(f"{wheel}_wheel" for wheel in WHEELS)
JOINTS: Final = tuple(f"{wheel}_wheel_joint" for wheel in WHEELS)
"""Names of the wheels' joints, as in the URDF of ``fieldtruth gazebo``; a differential robot has the first two."""


def command(k: int, commands: Commands) -> bytes:
    """Serialise geometry_msgs/Twist: forward speed [m/s] and turn rate [rad/s] in base_link; it has no header."""
    speed, turn_rate = map(float, commands.command[k])
    message = Twist(Vector3(speed, 0.0, 0.0), Vector3(0.0, 0.0, turn_rate))
    return serialize(message, "geometry_msgs/msg/Twist")


def wheel_transforms(rig: Rig, angles: Array) -> dict[str, Array]:
    """Return base_from_wheel (4, 4) by frame for the angles (n,) [rad] of the wheels about their axles."""
    mounts = rig.mounts()
    return {
        name: mounts[name].base_from_sensor @ transforms.pose((0.0, 0.0, 0.0), (0.0, float(np.rad2deg(angle)), 0.0))
        for name, angle in zip(WHEEL_FRAMES[: len(angles)], angles, strict=True)
    }


WORLD: Final = "world"


def clock(stamp_ns: int) -> bytes:
    """Serialise rosgraph_msgs/Clock: the simulated time."""
    return serialize(Clock(time(stamp_ns)), "rosgraph_msgs/msg/Clock")


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
        transform_stamped(header(0, stamp_ns, parent), child, parent_from_child)
        for (parent, child), parent_from_child in transforms.items()
    ]
    return serialize(TFMessage(stamped), "tf2_msgs/msg/TFMessage")


def tf(seq: int, stamp_ns: int, state: State, wheels: Mapping[str, Array]) -> bytes:
    """Serialise tf2_msgs/TFMessage of base_link in the world, and of the wheels: base_from_wheel (4, 4) by frame."""
    transform = Transform(vector(state.position), quaternion(state.quaternion_wxyz))
    stamped = [TransformStamped(header(seq, stamp_ns, WORLD), BASE, transform)]
    head = header(seq, stamp_ns, BASE)
    stamped += [transform_stamped(head, name, base_from_wheel) for name, base_from_wheel in wheels.items()]
    return serialize(TFMessage(stamped), "tf2_msgs/msg/TFMessage")


def odometry(seq: int, stamp_ns: int, state: State) -> bytes:
    """Serialise nav_msgs/Odometry: the pose in the world, the twist in base_link."""
    base_from_world = transforms.rotation_from_quaternion_wxyz(state.quaternion_wxyz).T
    linear, angular = base_from_world @ state.linear_velocity, base_from_world @ state.angular_velocity
    twist = Twist(vector(linear), vector(angular))
    pose = Pose(point(state.position), quaternion(state.quaternion_wxyz))
    message = Odometry(
        header(seq, stamp_ns, WORLD),
        BASE,
        PoseWithCovariance(pose, np.zeros(36)),
        TwistWithCovariance(twist, np.zeros(36)),
    )
    return serialize(message, "nav_msgs/msg/Odometry")


class ModelStatesWriter:
    """Writes gazebo_msgs/ModelStates at the physics rate: only the robot moves, so 104 bytes of a template are patched.

    Row i is the object with id i, as in the cloud's ``instance``: first the robot, then the ground, then the rest, or
    only the first ``rows``. The twist is that of base_link's origin in the world frame, as in Gazebo.
    """

    def __init__(self, world: World, rows: int | None = None) -> None:
        names = [ROBOT, *world.object_names[1:]][:rows]
        origin = Pose(Point(0.0, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))
        still = Twist(Vector3(0.0, 0.0, 0.0), Vector3(0.0, 0.0, 0.0))
        poses = [origin] * len(names)
        for instance in world.instances:
            if instance.object_id < len(names):
                poses[instance.object_id] = _pose(instance.world_from_object)
        message = ModelStates(names, poses, [still] * len(names))
        self.template = serialize(message, "gazebo_msgs/msg/ModelStates")
        self._pose_at = 4 + sum(4 + len(name.encode()) for name in names) + 4
        self._twist_at = self._pose_at + 56 * len(names) + 4

    def message(self, k: int, motion: Motion) -> bytes:
        """Serialise the message at row ``k`` of the motion."""
        data = bytearray(self.template)
        w, x, y, z = motion.quaternion_wxyz[k]
        struct.pack_into("<7d", data, self._pose_at, *motion.position[k], x, y, z, w)
        struct.pack_into("<6d", data, self._twist_at, *motion.linear_velocity[k], *motion.angular_velocity[k])
        return bytes(data)


def _pose(world_from_object: Array) -> Pose:
    """Return the pose of an object, whose matrix may also scale."""
    rotation = world_from_object[:3, :3] / np.cbrt(np.linalg.det(world_from_object[:3, :3]))
    orientation = quaternion(transforms.quaternion_wxyz_from_rotation(rotation))
    return Pose(point(world_from_object[:3, 3]), orientation)
