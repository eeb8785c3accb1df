# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Read a bag back: messages in time order, and the arrays in them. Works on any bag with these message types."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import BagError, decoder, open_bag
from fieldtruth.bag.types import F8
from fieldtruth.core import frames
from fieldtruth.core.classes import PALETTE


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
    with open_bag(path) as bag:
        decode = decoder(bag)
        for raw in bag.messages(topics):
            yield Reading(raw.stamp_ns, raw.topic, decode(raw))


def count_messages(path: Path) -> dict[str, int]:
    """Count the messages of each topic.

    Raises:
        BagError: no such file, or it is no bag.
    """
    with open_bag(path) as bag:
        return dict(bag.counts)


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
    """(h, w, 3) RGB of a sensor_msgs/Image (rgb8, bgr8, 8UC3) or a sensor_msgs/CompressedImage (JPEG).

    8UC3 names no order of colours; Gazebo's cameras, and the published data set, mean blue first by it.

    Raises:
        BagError: another encoding, or bytes that are no image.
    """
    if hasattr(message, "format"):
        try:
            photo: NDArray[np.uint8] = simplejpeg.decode_jpeg(message.data, "RGB")
        except ValueError as error:
            raise BagError(f"a compressed image ({message.format!r}) is no JPEG: {error}") from error
        return photo
    if message.encoding not in _COLOUR_ORDER:
        raise BagError(f"image is {message.encoding!r}; only {', '.join(_COLOUR_ORDER)} can be read")
    colours: NDArray[np.uint8] = _pixels(message, np.dtype("u1"), 3)[..., _COLOUR_ORDER[message.encoding]]
    return colours


def depth(message: Any) -> NDArray[np.float32]:
    """(h, w) metres along the optical axis of a sensor_msgs/Image, 32FC1; infinite where nothing is (REP-118)."""
    if message.encoding != "32FC1":
        raise BagError(f"depth is {message.encoding!r}; only 32FC1 can be read")
    metres: NDArray[np.float32] = _pixels(message, np.dtype("<f4"))
    return metres


def instances(message: Any) -> NDArray[np.uint16]:
    """(h, w) object ids of a sensor_msgs/Image, 16UC1; 0 where nothing is."""
    if message.encoding not in ("16UC1", "mono16"):
        raise BagError(f"instances are {message.encoding!r}; only 16UC1 can be read")
    ids: NDArray[np.uint16] = _pixels(message, np.dtype("<u2"))
    return ids


def labels(tag_image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Class ids (h, w) of a tag image (h, w, 3).

    Raises:
        BagError: a colour that no class has; says which and where.
    """
    code = _colour_codes(tag_image)
    edge = np.ones(code.size, np.bool_)
    edge[1:] = code[1:] != code[:-1]
    first = np.flatnonzero(edge)  # colours are flat: there are far fewer runs of a colour than pixels
    run = code[first]
    found = _SLOTS[run * _HASH >> np.uint32(32 - _HASH_BITS)]
    if (bad := _CODES[found] != run).any():
        row, column = divmod(int(first[bad][0]), tag_image.shape[1])
        colour = " ".join(map(str, tag_image[row, column]))
        raise BagError(f"tag image: pixel in row {row}, column {column} has the colour {colour}, which no class has")
    label: NDArray[np.uint8] = np.repeat(found, np.diff(first, append=code.size)).reshape(tag_image.shape[:-1])
    return label


def _colour_codes(tag_image: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Each pixel's three bytes as one number, red the lowest; read as four bytes, of which the last is cut off."""
    padded = np.zeros(tag_image.size + 1, np.uint8)
    padded[:-1] = tag_image.reshape(-1)
    return np.ndarray(tag_image.size // 3, "<u4", padded, strides=(3,)) & np.uint32(0xFFFFFF)


def stamp_ns(header: Any) -> int:
    """Stamp [ns] of a std_msgs/Header."""
    return int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec)


def _pixels(message: Any, dtype: np.dtype[Any], channels: int = 1) -> NDArray[Any]:
    """(h, w) or (h, w, channels) of an image's rows, which may be longer than the image is wide."""
    if message.is_bigendian and dtype.itemsize > 1:
        dtype = dtype.newbyteorder(">")
    length = message.width * channels * dtype.itemsize
    if message.step < length or len(message.data) != message.height * message.step:
        raise BagError(
            f"image of {message.width} x {message.height} {message.encoding} holds {len(message.data)} bytes"
        )
    rows = np.asarray(message.data).reshape(message.height, message.step)[:, :length]
    values = np.ascontiguousarray(rows).view(dtype).reshape(message.height, message.width, channels)
    return values[..., 0] if channels == 1 else values


def _perfect_hash() -> tuple[np.uint32, NDArray[np.uint8]]:
    """Find a multiplier that sends the colours of all classes to slots of their own, and the class in each slot."""
    codes = _CODES[1:]
    for multiplier in np.random.default_rng(0).integers(1, 2**32, 10_000, np.uint32) | np.uint32(1):
        slots = codes * multiplier >> np.uint32(32 - _HASH_BITS)
        if len(np.unique(slots)) == len(codes):
            table = np.zeros(1 << _HASH_BITS, np.uint8)
            table[slots] = np.arange(1, len(_CODES))
            return multiplier, table
    raise AssertionError("no multiplier keeps the colours apart")


_COLOUR_ORDER: Final = {"rgb8": slice(None), "bgr8": slice(None, None, -1), "8UC3": slice(None, None, -1)}
_RADIX: Final = np.array([1, 256, 65536], np.uint32)
_CODES: Final[NDArray[np.uint32]] = (PALETTE.astype(np.uint32) @ _RADIX).astype(np.uint32)
_CODES[0] = 0xFF000000  # void has no colour
_HASH_BITS: Final = 8
_HASH, _SLOTS = _perfect_hash()


def _matrix(xyz: Any, q: Any) -> F8:
    wxyz = [q.w, q.x, q.y, q.z]
    if not any(wxyz):
        raise BagError("a pose has a quaternion of four zeros, which is no attitude")
    return frames.pose_from_quaternion_wxyz([xyz.x, xyz.y, xyz.z], wxyz)
