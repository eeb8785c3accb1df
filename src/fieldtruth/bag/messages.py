# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of ROS 1: the store of their types, and those of the robot and its motion.

Small messages, which come at up to 1000 Hz, are serialised many at once: ROS 1 writes the fields of a message one after
the other, little-endian. Only here quaternions are converted to ROS's order (x, y, z, w). Covariances are all zero: the
poses are exact. ROS reads zeros as "unknown", so a filter must be given its own.
"""

import struct
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.stores import ros1_noetic as noetic

from fieldtruth.bag.topics import ROBOT
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.geodesy import PAPER_ORIGIN, Origin, earth_from_world
from fieldtruth.core.transforms import xyzw_from_wxyz
from fieldtruth.drive.track import Motion, Stamps
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import WHEELS
from fieldtruth.experiment.sensor_config import BASE
from fieldtruth.world.model import World

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


def header(seq: int, stamp_ns: int, frame_id: str) -> Header:
    """Return the header of the ``seq``-th message of a topic, counted from 0."""
    return Header(seq, noetic.builtin_interfaces__msg__Time(*divmod(int(stamp_ns), 10**9)), frame_id)


Field = bytes | ArrayLike
"""Bytes of a field that all messages share, or an array (n, ...) with a row for each; of one message the row alone."""


def serialized(count: int, *fields: Field) -> list[bytes]:
    """Serialise ``count`` messages of one size by their fields, in the order of their type."""
    parts = []
    for field in fields:
        if isinstance(field, bytes):
            parts.append(np.broadcast_to(np.frombuffer(field, np.uint8), (count, len(field))))
        else:
            parts.append(np.ascontiguousarray(field).reshape(count, -1).view(np.uint8))
    table = np.concatenate(parts, axis=1)
    data, size = table.tobytes(), table.shape[1]
    return [data[at : at + size] for at in range(0, len(data), size)]


def text_field(text: str) -> bytes:
    """Return the field of a string."""
    encoded = text.encode()
    return struct.pack("<L", len(encoded)) + encoded


def time_field(stamps_ns: Any) -> Field:
    """Return the field of times (n,) [ns]: seconds and nanoseconds."""
    return np.stack(np.divmod(stamps_ns, 10**9), axis=-1).astype("<u4")


def header_fields(seq: Any, stamps_ns: Any, frame_id: str) -> tuple[Field, Field, Field]:
    """Return the fields of headers (n,) in one frame."""
    return np.asarray(seq, "<u4"), time_field(stamps_ns), text_field(frame_id)


WHEEL_FRAMES: Final = tuple(f"{wheel}_wheel" for wheel in WHEELS)
JOINTS: Final = tuple(f"{wheel}_wheel_joint" for wheel in WHEELS)
"""Names of the wheels' joints, as in the URDF of ``fieldtruth gazebo``; a differential robot has the first two."""
WORLD: Final = "world"
EARTH: Final = "earth"
"""Frame of WGS 84, earth-centred and earth-fixed (REP-105)."""
_NO_COVARIANCE: Final = bytes(8 * 36)


def clocks(stamps_ns: Stamps) -> list[bytes]:
    """Serialise rosgraph_msgs/Clock: the simulated time (n,) [ns]."""
    return serialized(len(stamps_ns), time_field(stamps_ns))


def commands(command: Array) -> list[bytes]:
    """Serialise geometry_msgs/Twist: forward speed [m/s] and turn rate [rad/s] (n, 2) in base_link, without header."""
    return serialized(len(command), command[:, 0], bytes(16), bytes(16), command[:, 1])


def odometry(seq: Any, motion: Motion) -> list[bytes]:
    """Serialise nav_msgs/Odometry of the rows of a motion: the pose in the world, the twist in base_link."""
    base_from_world = np.swapaxes(transforms.rotation_from_quaternion_wxyz(motion.quaternion_wxyz), -1, -2)
    velocities = (motion.linear_velocity, motion.angular_velocity)
    twist = [(base_from_world @ velocity[..., None])[..., 0] for velocity in velocities]
    return serialized(
        len(motion.stamps_ns),
        *header_fields(seq, motion.stamps_ns, WORLD),
        text_field(BASE),
        motion.position,
        xyzw_from_wxyz(motion.quaternion_wxyz),
        _NO_COVARIANCE,
        *twist,
        _NO_COVARIANCE,
    )


def wheel_mounts(rig: Rig) -> list[Array]:
    """Return base_from_wheel (4, 4) of wheels that have not turned, in the order of their frames."""
    mounts = rig.mounts()
    return [mounts[name].base_from_sensor for name in WHEEL_FRAMES if name in mounts]


def wheel_transforms(mounts: Sequence[Array], angles: Array) -> dict[str, Array]:
    """Return base_from_wheel (..., 4, 4) by frame for the angles (..., wheels) [rad] of the wheels."""
    turned = np.zeros((*angles.shape, 3))
    turned[..., 1] = np.rad2deg(angles)
    return {
        WHEEL_FRAMES[wheel]: mount @ transforms.pose((0.0, 0.0, 0.0), turned[..., wheel, :])
        for wheel, mount in enumerate(mounts[: angles.shape[-1]])
    }


def rig_transforms(rig: Rig) -> dict[tuple[str, str], Array]:
    """Return all fixed ``parent_from_child`` (4, 4) by (parent, child), with the optical frames."""
    result = {(BASE, name): mount.base_from_sensor for name, mount in rig.mounts().items()}
    optical = [frame for sensor in rig.sensors for frame in sensor.optical_frames().items()]
    return result | {(parent, name): parent_from_optical for name, (parent, parent_from_optical) in optical}


def fixed_transforms(rig: Rig, origin: Origin = PAPER_ORIGIN) -> dict[tuple[str, str], Array]:
    """Return those of ``rig_transforms`` that belong to /tf_static: without the wheels if these turn.

    A world whose origin is not that of the paper is below ``earth`` (REP-105), which says where it is.
    """
    turning = () if not rig.reports_wheels else WHEEL_FRAMES
    fixed = {pair: transform for pair, transform in rig_transforms(rig).items() if pair[1] not in turning}
    return fixed if origin == PAPER_ORIGIN else {(EARTH, WORLD): earth_from_world(origin), **fixed}


def tf_static(stamp_ns: int, transforms: Mapping[tuple[str, str], Array]) -> bytes:
    """Serialise tf2_msgs/TFMessage of all fixed transforms."""
    fields = (_transform_fields(0, stamp_ns, pair, pose) for pair, pose in transforms.items())
    return serialized(1, *_list_of(fields))[0]


def tf(seq: Any, motion: Motion, wheels: Mapping[str, Array]) -> list[bytes]:
    """Serialise tf2_msgs/TFMessage of base_link in the world, and of the wheels: base_from_wheel (n, 4, 4) by frame."""
    stamps = motion.stamps_ns
    base = *header_fields(seq, stamps, WORLD), text_field(BASE), motion.position, xyzw_from_wxyz(motion.quaternion_wxyz)
    turning = [_transform_fields(seq, stamps, (BASE, name), poses) for name, poses in wheels.items()]
    return serialized(len(stamps), *_list_of([base, *turning]))


def _transform_fields(seq: Any, stamps_ns: Any, frames: tuple[str, str], parent_from_child: Array) -> tuple[Field, ...]:
    """Return the fields of geometry_msgs/TransformStamped (n,) from a child to its parent."""
    parent, child = frames
    xyzw = xyzw_from_wxyz(transforms.quaternion_wxyz_from_rotation(parent_from_child[..., :3, :3]))
    return *header_fields(seq, stamps_ns, parent), text_field(child), parent_from_child[..., :3, 3], xyzw


def _list_of(items: Iterable[tuple[Field, ...]]) -> list[Field]:
    """Return the fields of a list: the number of its items, and theirs."""
    fields = list(items)
    return [struct.pack("<L", len(fields)), *(field for each in fields for field in each)]


class Actors(Protocol):
    """What is known of actors."""

    names: tuple[str, ...]
    joint_names: tuple[str, ...]

    def at(self, stamp_ns: int) -> tuple[Array, Array]:
        """Return poses (actors, 7), position and quaternion_xyzw, and twists (actors, 6) at a stamp [ns]."""

    def joints(self, knots_ns: NDArray[np.int64]) -> tuple[Array, Array]:
        """Return values and speeds (n, joints) at knots (n,) [ns]."""


def actor_joints(actors: Actors, seq: Any, stamps_ns: NDArray[np.int64]) -> list[bytes]:
    """Serialise sensor_msgs/JointState of the joints of all actors, NAME/JOINT, at knots; no torques."""
    values, speeds = actors.joints(stamps_ns)
    count = struct.pack("<L", len(actors.joint_names))
    names = count + b"".join(map(text_field, actors.joint_names)) + count
    fields = *header_fields(seq, stamps_ns, WORLD), names, values, count, speeds, struct.pack("<L", 0)
    return serialized(len(stamps_ns), *fields)


class ModelStatesWriter:
    """Writes gazebo_msgs/ModelStates, in which only robots and actors move.

    Row i is the object with id i, as in the cloud's ``instance``: first the robot, then the ground, then the rest, or
    only the first ``rows``. The twist is that of base_link's origin in the world frame, as in Gazebo. Behind them are
    the robots of an experiment with several, of which one is the first row, too; after its motion each stands still.
    Then come the actors.
    """

    def __init__(
        self,
        world: World,
        rows: int | None = None,
        robots: Mapping[str, Motion] | None = None,
        actors: Actors | None = None,
    ) -> None:
        self._robots, self._actors = list((robots or {}).values()), actors
        moving = [*(robots or {}), *(actors.names if actors else ())]
        names = [ROBOT, *world.object_names[1 : len(world.object_names) - len(moving)]][:rows]
        poses = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (len(names), 1))
        for instance in world.instances:
            if instance.object_id < len(names):
                poses[instance.object_id] = _pose(instance.world_from_object)
        self._count = struct.pack("<L", len(names) + len(moving))
        self._before = self._count + b"".join(map(text_field, [*names, *moving])) + self._count
        self._between, self._still = poses[1:].tobytes(), bytes(48 * (len(names) - 1))
        self.template = b"".join([self._before, poses.tobytes(), self._count, bytes(48), self._still])
        """The message with the robot at the origin, of a world with one robot."""

    def message(self, k: int, motion: Motion) -> bytes:
        """Serialise the message at row ``k`` of the motion."""
        (pose, twist), others = _state(motion, k), [_state(each, k) for each in self._robots]
        poses, twists = (b"".join(parts) for parts in zip(*others, strict=True)) if others else (b"", b"")
        if self._actors is not None:
            own, own_twists = self._actors.at(int(motion.stamps_ns[k]))
            poses, twists = poses + own.tobytes(), twists + own_twists.tobytes()
        return b"".join([self._before, pose, self._between, poses, self._count, twist, self._still, twists])


def _state(motion: Motion, k: int) -> tuple[bytes, bytes]:
    """Pose and twist of a row; behind the last one it stands where it was."""
    if k >= len(motion.stamps_ns):
        return _state(motion, len(motion.stamps_ns) - 1)[0], bytes(48)
    w, x, y, z = motion.quaternion_wxyz[k]
    pose = struct.pack("<7d", *motion.position[k], x, y, z, w)
    return pose, struct.pack("<6d", *motion.linear_velocity[k], *motion.angular_velocity[k])


def _pose(world_from_object: Array) -> Array:
    """Return position and quaternion (x, y, z, w) of an object, whose matrix may also scale."""
    rotation = world_from_object[:3, :3] / np.cbrt(np.linalg.det(world_from_object[:3, :3]))
    xyzw = xyzw_from_wxyz(transforms.quaternion_wxyz_from_rotation(rotation))
    return np.concatenate([world_from_object[:3, 3], xyzw])
