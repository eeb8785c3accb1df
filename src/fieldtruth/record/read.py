# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Read a bag back: messages in time order, and the arrays in them. Works on any bag with these message types."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import simplejpeg
from numpy.typing import NDArray
from rosbags.interfaces import Connection
from rosbags.rosbag1 import Reader, ReaderError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from fieldtruth import frames
from fieldtruth.errors import FieldtruthError, UnknownNameError
from fieldtruth.record import topics as table
from fieldtruth.record.ros import F8


class BagError(FieldtruthError):
    """A file that is no readable bag."""


class Reading(NamedTuple):
    """One message of a bag: its stamp in the bag [ns], its topic and the message, with ROS's field names."""

    stamp_ns: int
    topic: str
    message: Any


_NUMPY: Final = dict(enumerate(["i1", "u1", "<i2", "<u2", "<i4", "<u4", "<f4", "<f8"], start=1))
"""NumPy type by sensor_msgs/PointField's number."""


def read_bag(path: Path, topics: Sequence[str] = ()) -> Iterator[Reading]:
    """Read the messages of some topics, or of all, in time order; one chunk of the bag is in memory at a time.

    Raises:
        BagError: no such file, or it is no bag.
        UnknownNameError: a topic that the bag does not have.
    """
    try:
        with Reader(path) as reader:
            store = _store_for(reader)
            for connection, stamp_ns, data in reader.messages(_chosen(reader, topics)):
                yield Reading(stamp_ns, connection.topic, store.deserialize_ros1(data, connection.msgtype))
    except (ReaderError, OSError) as error:
        raise BagError(f"cannot read {path}: {error}") from error


def count_messages(path: Path) -> dict[str, int]:
    """Count the messages of each topic.

    Raises:
        BagError: no such file, or it is no bag.
    """
    try:
        with Reader(path) as reader:
            return {topic: info.msgcount for topic, info in reader.topics.items()}
    except (ReaderError, OSError) as error:
        raise BagError(f"cannot read {path}: {error}") from error


def static_transforms(path: Path) -> dict[tuple[str, str], F8]:
    """Every fixed ``parent_from_child`` (4, 4) in /tf_static by (parent, child)."""
    return {
        (stamped.header.frame_id, stamped.child_frame_id): matrix(stamped.transform)
        for reading in read_bag(path, [table.TF_STATIC])
        for stamped in reading.message.transforms
    }


def matrix(transform: Any) -> F8:
    """(4, 4) of a geometry_msgs/Transform."""
    return _matrix(transform.translation, transform.rotation)


def pose_matrix(pose: Any) -> F8:
    """(4, 4) of a geometry_msgs/Pose."""
    return _matrix(pose.position, pose.orientation)


def points(cloud: Any) -> NDArray[np.void]:
    """Structured array (height * width) of a sensor_msgs/PointCloud2, with the cloud's own fields."""
    fields = cloud.fields
    kinds = [_NUMPY[f.datatype] if f.count == 1 else (_NUMPY[f.datatype], (f.count,)) for f in fields]
    dtype = np.dtype(
        {
            "names": [f.name for f in fields],
            "formats": kinds,
            "offsets": [f.offset for f in fields],
            "itemsize": cloud.point_step,
        }
    )
    rows = np.asarray(cloud.data).reshape(cloud.height, cloud.row_step)[:, : cloud.width * cloud.point_step]
    return np.ascontiguousarray(rows).reshape(-1).view(dtype)


def image(message: Any) -> NDArray[np.uint8]:
    """(h, w, 3) RGB of a sensor_msgs/Image (rgb8) or a sensor_msgs/CompressedImage (JPEG)."""
    if hasattr(message, "format"):
        photo: NDArray[np.uint8] = simplejpeg.decode_jpeg(message.data.tobytes(), "RGB")
        return photo
    if message.encoding != "rgb8":
        raise ValueError(f"image is {message.encoding!r}; only rgb8 can be read")
    rows: NDArray[np.uint8] = np.asarray(message.data).reshape(message.height, message.step)
    return rows[:, : 3 * message.width].reshape(message.height, message.width, 3)


def stamp_ns(header: Any) -> int:
    """Stamp [ns] of a std_msgs/Header."""
    return int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec)


def _matrix(xyz: Any, q: Any) -> F8:
    return frames.pose_from_quaternion_wxyz([xyz.x, xyz.y, xyz.z], [q.w, q.x, q.y, q.z])


def _chosen(reader: Reader, topics: Sequence[str]) -> list[Connection]:
    for topic in topics:
        if topic not in reader.topics:
            raise UnknownNameError("topic", topic, reader.topics)
    return [c for c in reader.connections if not topics or c.topic in topics]


def _store_for(reader: Reader) -> Typestore:
    """Return the types as the bag itself defines them."""
    store = get_typestore(Stores.EMPTY)
    for msgtype, definition in {c.msgtype: c.msgdef.data for c in reader.connections}.items():
        store.register(get_types_from_msg(definition, msgtype))
    return store
