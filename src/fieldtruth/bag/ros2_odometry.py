# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Odometry in bags of ROS 2: a folder with metadata.yaml or a database (.db3); an MCAP file is read as any bag."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.interfaces import Connection
from rosbags.typesys import Stores, get_typestore

from fieldtruth.bag.file import BagError, read_errors
from fieldtruth.bag.geometry import Trajectory
from fieldtruth.bag.readings import given_stamps, rising_rows
from fieldtruth.core.errors import FieldtruthError

ODOMETRY: Final = "nav_msgs/msg/Odometry"


def is_ros2_bag(path: Path) -> bool:
    """Whether a path looks like a bag of ROS 2, other than an MCAP file."""
    return path.suffix.lower() == ".db3" or (path / "metadata.yaml").is_file()


def odometry_topics(path: Path) -> list[str]:
    """Return the topics of type nav_msgs/Odometry.

    Raises:
        BagError: the bag cannot be read.
    """
    with _opened(path) as bag:
        return sorted({connection.topic for connection in _odometry(bag)})


def read_ros2_odometry(path: Path, topic: str) -> tuple[Trajectory, str]:
    """Read the poses of an odometry topic, by the stamps of their headers; and the name of their frame.

    If all headers have the stamp 0, those of the bag are used, with a warning.

    Raises:
        BagError: the bag cannot be read, or the stamps do not rise.
    """
    stamps, recorded, rows, frame = list[int](), list[int](), list[tuple[float, ...]](), ""
    with _opened(path) as bag:
        for connection, bag_ns, data in bag.messages([c for c in _odometry(bag) if c.topic == topic]):
            message: Any = bag.deserialize(data, connection.msgtype)
            p, q, stamp = message.pose.pose.position, message.pose.pose.orientation, message.header.stamp
            stamps.append(stamp.sec * 10**9 + stamp.nanosec)
            recorded.append(bag_ns)
            rows.append((p.x, p.y, p.z, q.w, q.x, q.y, q.z))
            frame = frame or message.child_frame_id.strip("/")
    stamps_ns = given_stamps(np.array(stamps, np.int64), np.array(recorded, np.int64), topic, path)
    poses = np.array(rows, np.float64).reshape(-1, 7)
    order = rising_rows(stamps_ns, topic, path, coarse=True)
    return Trajectory(stamps_ns[order], poses[order, :3], poses[order, 3:]), frame


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
