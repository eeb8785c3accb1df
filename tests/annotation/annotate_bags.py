# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bags from elsewhere, written and read with the rosbags library alone."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

import numpy as np
import ros_types as ros
from rosbags.interfaces import Connection, ConnectionExtRosbag1
from rosbags.rosbag1 import Reader, Writer
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__PoseWithCovariance as PoseWithCovariance
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__TwistWithCovariance as TwistWithCovariance
from rosbags.typesys.stores.ros1_noetic import nav_msgs__msg__Odometry as Odometry

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array

ODOMETRY, STATES, STATIC = "/ground_truth/odom", "/gazebo/model_states", "/tf_static"


class Kind(NamedTuple):
    """A connection as a bag describes it."""

    topic: str
    msgtype: str
    definition: str
    md5sum: str
    callerid: str | None = None
    latching: int | None = None


class Message(NamedTuple):
    """A message in a bag: stamp [ns], connection, bytes."""

    stamp: int
    kind: Kind
    data: bytes


def kind_of(connection: Connection) -> Kind:
    assert isinstance(connection.ext, ConnectionExtRosbag1)
    return Kind(connection.topic, connection.msgtype, connection.msgdef.data, connection.digest, *connection.ext)


def standard(topic: str, msgtype: str, callerid: str | None = None, latching: int | None = None) -> Kind:
    return Kind(topic, msgtype, *ros.STORE.generate_msgdef(msgtype), callerid, latching)


def stored(path: Path) -> list[Message]:
    """Every message in the order of time; ties in that of the connections."""
    with Reader(path) as reader:
        rows = [(stamp, kind_of(connection), bytes(data)) for connection, stamp, data in reader.messages()]
    return [Message(*row) for row in rows]


def in_file(path: Path) -> list[tuple[int, str]]:
    """Stamp [ns] and topic of all messages in the order of the file, as a reader without an index finds them."""
    with Reader(path) as reader:
        topics = {connection.id: connection.topic for connection in reader.connections}
        rows = [(at.chunk_pos, at.offset, at.time, topics[k]) for k, found in reader.indexes.items() for at in found]
    return [(stamp, topic) for _, _, stamp, topic in sorted(rows)]


def write(path: Path, messages: Iterable[Message], packed: Writer.CompressionFormat | None = None) -> Path:
    """Write a bag, uncompressed by default, in chunks of 64 kB."""
    writer = Writer(path)
    writer.chunk_threshold = 65_536
    if packed is not None:
        writer.set_compression(packed)
    with writer:
        connections: dict[Kind, Connection] = {}
        for stamp, kind, data in messages:
            if kind not in connections:
                connections[kind] = writer.add_connection(
                    kind.topic,
                    kind.msgtype,
                    msgdef=kind.definition,
                    md5sum=kind.md5sum,
                    callerid=kind.callerid,
                    latching=kind.latching,
                )
            writer.write(connections[kind], stamp, data)
    return path


def ties_reversed(messages: Sequence[Message]) -> Iterator[Message]:
    """Messages of the same stamp in the opposite order."""
    for _, tied in groupby(messages, key=lambda message: message.stamp):
        yield from reversed(list(tied))


def sensed(topic: str) -> bool:
    """Return whether a topic is of a camera or the LiDAR."""
    return topic.startswith(("/stereo/", "/os1_cloud_node/"))


def odometry(
    stamp: int, pose: Array, child: str = "base_link", recorded: int | None = None, length: float = 1.0
) -> Message:
    """nav_msgs/Odometry of a frame at ``pose`` (4, 4) in the world; its quaternion has the length ``length``."""
    still = TwistWithCovariance(ros.Twist(ros.Vector3(0.0, 0.0, 0.0), ros.Vector3(0.0, 0.0, 0.0)), np.zeros(36))
    quaternion = ros.quaternion(length * transforms.quaternion_wxyz_from_rotation(pose[:3, :3]))
    located = PoseWithCovariance(ros.Pose(ros.point(pose[:3, 3]), quaternion), np.zeros(36))
    message = Odometry(ros.header(0, stamp, "world"), child, located, still)
    data = ros.serialize(message, "nav_msgs/msg/Odometry")
    return Message(stamp if recorded is None else recorded, standard(ODOMETRY, "nav_msgs/msg/Odometry"), data)


def states(stamp: int, models: dict[str, Array]) -> Message:
    """gazebo_msgs/ModelStates of models at (4, 4) in the world."""
    poses = [
        ros.Pose(ros.point(pose[:3, 3]), ros.quaternion(transforms.quaternion_wxyz_from_rotation(pose[:3, :3])))
        for pose in models.values()
    ]
    still = ros.Twist(ros.Vector3(0.0, 0.0, 0.0), ros.Vector3(0.0, 0.0, 0.0))
    message = ros.ModelStates(list(models), poses, [still] * len(poses))
    data = ros.serialize(message, "gazebo_msgs/msg/ModelStates")
    return Message(stamp, standard(STATES, "gazebo_msgs/msg/ModelStates"), data)


def static(transforms: dict[tuple[str, str], Array], stamp: int = 1) -> Message:
    """tf2_msgs/TFMessage of ``parent_from_child`` (4, 4) by (parent, child)."""
    stamped = [
        ros.transform_stamped(ros.header(0, stamp, parent), child, pose) for (parent, child), pose in transforms.items()
    ]
    data = ros.serialize(ros.TFMessage(stamped), "tf2_msgs/msg/TFMessage")
    return Message(stamp, standard(STATIC, "tf2_msgs/msg/TFMessage", "/state_publisher", 1), data)


def true_pose(t: float) -> Array:
    """Pose of a robot after ``t`` seconds: 0.3 m/s to the north-west, turning by 0.5 rad/s, pitched by 4 deg."""
    return transforms.pose((0.2 * t, 0.1 * t, 0.4 + 0.05 * t), (0.0, 4.0, np.degrees(0.5 * t)))


def rough(t: float) -> Array:
    """The same path over rough ground: no two steps are equal."""
    return true_pose(t) @ transforms.pose(
        (0.01 * np.sin(70.0 * t), 0.0, 0.02 * np.sin(90.0 * t)), (3.0 * np.sin(80.0 * t), 0, 0)
    )


def drive(pose: Callable[[float], Array] = true_pose, rate: int = 50, first: int = 1, last: int = 30) -> list[Message]:
    """Odometry at k / rate for k from ``first`` to ``last``."""
    return [odometry(k * 10**9 // rate, pose(k / rate)) for k in range(first, last + 1)]
