# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Odometry in bags of ROS 2 that are no single MCAP file: a folder with metadata.yaml, or a database (.db3)."""

from array import array
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from rosbags.highlevel import AnyReader
from rosbags.interfaces import Connection
from rosbags.typesys import Stores, get_typestore

from fieldtruth.bag.errors import BagError, read_errors
from fieldtruth.bag.trajectory import Rows
from fieldtruth.core.errors import FieldtruthError

ODOMETRY: Final = "nav_msgs/msg/Odometry"


def is_ros2_bag(path: Path) -> bool:
    """Whether a path looks like a bag of ROS 2."""
    return path.suffix.lower() == ".db3" or (path / "metadata.yaml").is_file()


def odometry_topics(path: Path) -> list[str]:
    """Return the topics of type nav_msgs/Odometry.

    Raises:
        BagError: the bag cannot be read.
    """
    with _opened(path) as bag:
        return sorted({connection.topic for connection in _odometry(bag)})


def read_ros2_odometry(path: Path, topic: str) -> tuple[Rows, str]:
    """Read the poses of an odometry topic, as they are, with the stamps of their headers; and the name of their frame.

    Raises:
        BagError: the bag cannot be read.
    """
    stamps, rows, frame = array("q"), array("d"), ""
    with _opened(path) as bag:
        for connection, _, data in bag.messages([c for c in _odometry(bag) if c.topic == topic]):
            message: Any = bag.deserialize(data, connection.msgtype)
            p, q, stamp = message.pose.pose.position, message.pose.pose.orientation, message.header.stamp
            stamps.append(stamp.sec * 10**9 + stamp.nanosec)
            rows.extend((p.x, p.y, p.z, q.x, q.y, q.z, q.w))
            frame = frame or message.child_frame_id.strip("/")
    return (stamps, rows), frame


@contextmanager
def _opened(path: Path) -> Iterator[AnyReader]:
    """Open a bag of ROS 2; definitions that it lacks, as databases do, are those of ROS 2 Humble."""
    with read_errors(path):
        try:
            with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
                yield bag
        except (FieldtruthError, OSError):
            raise
        except Exception as error:  # the library raises any exception on invalid bytes
            raise BagError(f"cannot read {path}: {str(error) or type(error).__name__}") from error


def _odometry(bag: AnyReader) -> list[Connection]:
    return [connection for connection in bag.connections if connection.msgtype == ODOMETRY]
