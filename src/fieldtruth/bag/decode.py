# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Decoded messages of a bag, and the arrays in them; for any bag with these message types."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import BagError, decoder, open_bag
from fieldtruth.core import frames
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import PALETTE


class Reading(NamedTuple):
    """One message of a bag: its stamp in the bag [ns], its topic and the message, with ROS's field names."""

    stamp_ns: int
    topic: str
    message: Any


_NUMPY: Final = dict(enumerate(["i1", "u1", "<i2", "<u2", "<i4", "<u4", "<f4", "<f8"], start=1))
"""NumPy type by the datatype of sensor_msgs/PointField."""


def read_bag(path: Path | str, topics: Sequence[str] = ()) -> Iterator[Reading]:
    """Read the messages of some topics, or of all, in time order; one chunk of the bag is in memory at a time.

    Topics of the paper's data set can be given with the names in the bag or with ours.

    Raises:
        BagError: no such file, or not a bag.
        UnknownNameError: the bag has no such topic.
    """
    with open_bag(path, own_names=True) as bag:
        named = all(topic in bag.counts for topic in topics)
    with open_bag(path, own_names=named) as bag:
        decode = decoder(bag)
        for raw in bag.messages(topics):
            yield Reading(raw.stamp_ns, raw.topic, decode(raw))


def count_messages(path: Path | str) -> dict[str, int]:
    """Count the messages of each topic.

    Raises:
        BagError: no such file, or not a bag.
    """
    with open_bag(path, own_names=True) as bag:
        return dict(bag.counts)


def static_transforms(path: Path | str) -> dict[tuple[str, str], Array]:
    """Read every fixed ``parent_from_child`` (4, 4) in /tf_static by (parent, child)."""
    return {
        (stamped.header.frame_id, stamped.child_frame_id): matrix(stamped.transform)
        for reading in read_bag(path, [table.TF_STATIC])
        for stamped in reading.message.transforms
    }


def matrix(transform: Any) -> Array:
    """Return the matrix (4, 4) of a geometry_msgs/Transform."""
    return _matrix(transform.translation, transform.rotation)


def pose_matrix(pose: Any) -> Array:
    """Return the matrix (4, 4) of a geometry_msgs/Pose."""
    return _matrix(pose.position, pose.orientation)


def points(cloud: Any) -> NDArray[np.void]:
    """Return the points of a sensor_msgs/PointCloud2, (height * width), as a structured array with its own fields."""
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


MEASURED: Final = ("true_range", "signal", "reflectivity", "echo", "mixed")
"""Fields of a cloud whose LiDAR has a signal. Clouds without ``true_range`` may have another ``reflectivity``."""


def image(message: Any) -> NDArray[np.uint8]:
    """Return the pixels (h, w, 3) RGB of a sensor_msgs/Image (rgb8, bgr8, 8UC3) or sensor_msgs/CompressedImage (JPEG).

    8UC3 leaves the order of channels open; it is read as BGR, as Gazebo and the paper's published data set use it.

    Raises:
        BagError: another encoding, or bytes that are not an image.
    """
    if hasattr(message, "format"):
        try:
            photo: NDArray[np.uint8] = simplejpeg.decode_jpeg(message.data, "RGB")
        except ValueError as error:
            raise BagError(f"a compressed image ({message.format!r}) is not a JPEG: {error}") from error
        return photo
    if message.encoding not in _COLOUR_ORDER:
        raise BagError(f"encoding of an image must be one of {', '.join(_COLOUR_ORDER)}, got {message.encoding!r}")
    colours: NDArray[np.uint8] = _pixels(message, np.dtype("u1"), 3)[..., _COLOUR_ORDER[message.encoding]]
    return colours


def depth(message: Any) -> NDArray[np.float32]:
    """Return depth (h, w) [m] of a sensor_msgs/Image, 32FC1, along the optical axis; infinite for the sky (REP-118)."""
    if message.encoding != "32FC1":
        raise BagError(f"encoding of a depth image must be 32FC1, got {message.encoding!r}")
    metres: NDArray[np.float32] = _pixels(message, np.dtype("<f4"))
    return metres


def instances(message: Any) -> NDArray[np.uint16] | NDArray[np.uint32]:
    """Return the instance ids (h, w) of a sensor_msgs/Image, 16UC1 or 32SC1; 0 for no object."""
    if message.encoding == "32SC1":
        return _pixels(message, np.dtype("<i4")).astype(np.uint32)
    if message.encoding not in ("16UC1", "mono16"):
        raise BagError(f"encoding of an instance image must be 16UC1 or 32SC1, got {message.encoding!r}")
    ids: NDArray[np.uint16] = _pixels(message, np.dtype("<u2"))
    return ids


def normals(message: Any) -> NDArray[np.float32]:
    """Return unit normals (h, w, 3) of a sensor_msgs/Image, 32FC3, in the optical frame, towards it; 0 for sky."""
    if message.encoding != "32FC3":
        raise BagError(f"encoding of an image of normals must be 32FC3, got {message.encoding!r}")
    return _pixels(message, np.dtype("<f4"), 3)


def flow(message: Any) -> NDArray[np.float32]:
    """Return optical flow (h, w, 2) [pixel] of a sensor_msgs/Image, 32FC2: to the right and down.

    It leads to the camera's next image, and is NaN where that does not show the same point.
    """
    if message.encoding != "32FC2":
        raise BagError(f"encoding of an image of optical flow must be 32FC2, got {message.encoding!r}")
    return _pixels(message, np.dtype("<f4"), 2)


def labels(tag_image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the class ids (h, w) of a tag image (h, w, 3).

    Raises:
        BagError: a colour that no class has, with its pixel.
    """
    code = _colour_codes(tag_image)
    edge = np.ones(code.size, np.bool_)
    edge[1:] = code[1:] != code[:-1]
    first = np.flatnonzero(edge)  # flat colours: far fewer runs of equal colour than pixels
    run = code[first]
    found = _SLOTS[run * _HASH >> np.uint32(32 - _HASH_BITS)]
    if (bad := _CODES[found] != run).any():
        row, column = divmod(int(first[bad][0]), tag_image.shape[1])
        colour = " ".join(map(str, tag_image[row, column]))
        raise BagError(f"tag image: pixel in row {row}, column {column} has the colour {colour}, which no class has")
    label: NDArray[np.uint8] = np.repeat(found, np.diff(first, append=code.size)).reshape(tag_image.shape[:-1])
    return label


def _colour_codes(tag_image: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Return each pixel's three bytes as one number, red the lowest; read as four bytes with the last masked."""
    padded = np.zeros(tag_image.size + 1, np.uint8)
    padded[:-1] = tag_image.reshape(-1)
    return np.ndarray(tag_image.size // 3, "<u4", padded, strides=(3,)) & np.uint32(0xFFFFFF)


def stamp_ns(header: Any) -> int:
    """Return the stamp [ns] of a std_msgs/Header."""
    return int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec)


def _pixels(message: Any, dtype: np.dtype[Any], channels: int = 1) -> NDArray[Any]:
    """Return (h, w) or (h, w, channels) of an image, whose rows may be padded."""
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
    """Find a multiplier that hashes the colours of all classes without collision, and the class in each slot."""
    codes = _CODES[1:]
    for multiplier in np.random.default_rng(0).integers(1, 2**32, 10_000, np.uint32) | np.uint32(1):
        slots = codes * multiplier >> np.uint32(32 - _HASH_BITS)
        if len(np.unique(slots)) == len(codes):
            table = np.zeros(1 << _HASH_BITS, np.uint8)
            table[slots] = np.arange(1, len(_CODES))
            return multiplier, table
    raise AssertionError("no multiplier without collision")


_COLOUR_ORDER: Final = {"rgb8": slice(None), "bgr8": slice(None, None, -1), "8UC3": slice(None, None, -1)}
_RADIX: Final = np.array([1, 256, 65536], np.uint32)
_CODES: Final[NDArray[np.uint32]] = (PALETTE.astype(np.uint32) @ _RADIX).astype(np.uint32)
_CODES[0] = 0xFF000000  # void has no colour
_HASH_BITS: Final = 8
_HASH, _SLOTS = _perfect_hash()


def _matrix(xyz: Any, q: Any) -> Array:
    wxyz = [q.w, q.x, q.y, q.z]
    if not any(wxyz):
        raise BagError("the quaternion of a pose must not be zero")
    return frames.pose_from_quaternion_wxyz([xyz.x, xyz.y, xyz.z], wxyz)
