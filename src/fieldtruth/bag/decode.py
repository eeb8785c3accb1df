# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Decoded messages of a bag, and the arrays in them; for any bag with these message types."""

import struct
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import simplejpeg
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from fieldtruth.bag import topics as table
from fieldtruth.bag.file import BagError
from fieldtruth.bag.reader import ORIGIN, decoder, open_bag
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import CLASSES, ClassTable


class Reading(NamedTuple):
    """One message of a bag: its stamp in the bag [ns], its topic and the message, with ROS's field names."""

    stamp_ns: int
    topic: str
    message: Any


UNIT: Final = 0.01
"""Largest deviation of a quaternion's length from 1; below it the numbers are rounded, above it something else."""
_NUMPY: Final = dict(enumerate(["i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"], start=1))
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
        (stamped.header.frame_id.strip("/"), stamped.child_frame_id.strip("/")): matrix(stamped.transform)
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
    """Return the points of a sensor_msgs/PointCloud2, (height * width), as a structured array with its own fields.

    Big-endian numbers are converted. A count of 0 means 1, as old versions of PCL write it; fields without a name, or
    named ``_`` as PCL's padding, are left out. Where ``row_step`` does not fit, the points follow each other if the
    length of the data says so.

    Raises:
        BagError: fields or lengths that contradict each other, or coordinates that are not floating-point numbers.
    """
    where, order = _where(cloud, "cloud"), ">" if cloud.is_bigendian else "<"
    width, height, size = int(cloud.width), int(cloud.height), int(cloud.point_step)
    rows = _rows(cloud.data, height, width * size, int(cloud.row_step))
    if rows is None:
        held = f"{len(cloud.data)} bytes with a row_step of {cloud.row_step}"
        raise BagError(f"{where}: {width} x {height} points of {size} bytes do not fit {held}")
    fields, end = dict[str, tuple[int, int, int]](), size if rows.size else _LARGEST_POINT
    for field in (each for each in cloud.fields if each.name.strip("_ ")):
        found = field.offset, field.datatype, max(1, field.count)
        if fields.setdefault(field.name, found) != found:
            raise BagError(f"{where} has two different fields {field.name!r}")
        if field.datatype not in _NUMPY:
            raise BagError(
                f"{where}: datatype of field {field.name!r} must be 1 to {len(_NUMPY)}, got {field.datatype}"
            )
        if found[2] > 1 and field.name in _SCALARS:
            raise BagError(f"{where}: field {field.name!r} must have one value per point, got a count of {field.count}")
        if field.name in ("x", "y", "z") and _NUMPY[field.datatype][0] != "f":
            raise BagError(f"{where}: field {field.name!r} must be float32 or float64, got {_NUMPY[field.datatype]}")
        if field.offset + np.dtype(_NUMPY[field.datatype]).itemsize * found[2] > end:
            raise BagError(f"{where}: field {field.name!r} ends behind the point_step of {cloud.point_step} bytes")
    kinds = [(order + _NUMPY[kind], (count,) if count > 1 else ()) for _, kind, count in fields.values()]
    if not rows.size:
        return np.zeros(
            0, np.dtype([(name, *kind) for name, kind in zip(fields, kinds, strict=True)]).newbyteorder("=")
        )
    offsets = [offset for offset, _, _ in fields.values()]
    dtype = np.dtype({"names": list(fields), "formats": kinds, "offsets": offsets, "itemsize": size})
    stored = rows.reshape(-1).view(dtype)
    return stored.astype(dtype.newbyteorder("=")) if cloud.is_bigendian else stored


def _rows(data: Any, height: int, length: int, step: int) -> NDArray[np.uint8] | None:
    """Return the used bytes (height, length) of rows that start ``step`` bytes apart; the last one may end early.

    If that does not fit the number of bytes, the rows may follow each other without a gap; else it returns None.
    """
    held = np.asarray(data)
    if len(held) == height * length:
        return held.reshape(height, length) if len(held) else np.zeros((0, 0), np.uint8)
    if not (0 < length <= step and step * (height - 1) + length <= len(held) <= step * height):
        return None
    return np.ascontiguousarray(np.ndarray((height, length), np.uint8, held, strides=(step, 1)))


_SCALARS: Final = frozenset(
    ("x", "y", "z", "intensity", "label", "instance", "ring", "column", "t", "time", "timestamp")
)
"""Fields of a cloud that are read as one number per point."""
_LARGEST_POINT: Final = 2**16
"""Bytes of a point that a cloud without points may describe."""
MEASURED: Final = ("true_range", "signal", "reflectivity", "echo", "mixed")
"""Fields of a cloud whose LiDAR has a signal. Clouds without ``true_range`` may have another ``reflectivity``."""


def image(message: Any) -> NDArray[np.uint8]:
    """Return the pixels (h, w, 3) RGB of a sensor_msgs/Image in colour or grey, or of a sensor_msgs/CompressedImage.

    The latter holds JPEG, PNG or TIFF. 8UC3 and 8UC4 leave the order of channels open; they are read as BGR, as Gazebo
    and the paper's published data set use it. Alpha is left out; of 16 bits the upper ones count.

    Raises:
        BagError: another encoding, or bytes that are not an image of that size.
    """
    if hasattr(message, "format"):
        values = _unpacked(message)
    else:
        encoding = message.encoding.strip()
        if encoding not in _COLOURS:
            where = _where(message, "image")
            raise BagError(f"{where}: its encoding must be one of {', '.join(_COLOURS)}, got {message.encoding!r}")
        kind, channels, order = _COLOURS[encoding]
        values = _pixels(message, kind, channels)[..., order]
    if values.dtype.itemsize > 1:
        values = (values >> 8).astype(np.uint8)
    colours: NDArray[np.uint8] = values if values.shape[-1] == 3 else np.repeat(values, 3, axis=2)
    return colours


def tag_image(message: Any) -> NDArray[np.uint8]:
    """Return the pixels (h, w, 3) RGB of a tag image, which is an image in colour; raises as ``image``."""
    if (encoding := getattr(message, "encoding", _TAGS[0])).strip() not in _TAGS:
        where = _where(message, "tag image")
        raise BagError(f"{where}: its encoding must be one of {', '.join(_TAGS)}, got {encoding!r}")
    return image(message)


def depth(message: Any) -> NDArray[np.float32]:
    """Return depth (h, w) [m] along the optical axis; infinite for the sky, NaN for unknown (REP-118).

    Of a sensor_msgs/Image in 32FC1 or 64FC1 [m], or 16UC1 or mono16 [mm], or a sensor_msgs/CompressedImage with 16 bits
    [mm] or the quantised inverse depth of ``compressedDepth``.

    Raises:
        BagError: another encoding, or bytes that are not an image of that size.
    """
    scale: tuple[float, float] | None = None
    if hasattr(message, "format"):
        values = _unpacked(message)[..., 0]
        if values.dtype.itemsize == 1:
            raise BagError(f"{_where(message, 'compressed depth image')} ({message.format!r}) must have 16 bits")
        if message.format.startswith("32FC1"):
            scale = struct.unpack_from("<ff", bytes(message.data[4:12]))
    else:
        values = _pixels(message, _encoded(message, "depth image", _DEPTHS))[..., 0]
    if values.dtype.kind == "f":
        return values.astype(np.float32, copy=False)
    with np.errstate(divide="ignore"):
        metres = values / np.float32(1000.0) if scale is None else scale[0] / (values - np.float32(scale[1]))
    return np.where(values == 0, np.float32(np.nan), metres).astype(np.float32)


def instances(message: Any) -> NDArray[np.uint16] | NDArray[np.uint32]:
    """Return the instance ids (h, w) of a sensor_msgs/Image, 8UC1, 16UC1 or 32SC1; 0 for no object.

    Raises:
        BagError: another encoding, a negative id, or bytes that are not an image of that size.
    """
    ids = _pixels(message, _encoded(message, "instance image", _IDS))[..., 0]
    if ids.dtype.kind == "i" and ids.size and ids.min() < 0:
        raise BagError(f"{_where(message, 'instance image')}: an id must not be negative, got {ids.min()}")
    numbers: NDArray[np.uint16] | NDArray[np.uint32]
    numbers = ids.astype(np.uint32) if ids.dtype.kind == "i" else ids.astype(np.uint16, copy=False)
    return numbers


def normals(message: Any) -> NDArray[np.float32]:
    """Return unit normals (h, w, 3) of a sensor_msgs/Image, 32FC3, in the optical frame, towards it; 0 for sky."""
    xyz: NDArray[np.float32] = _pixels(message, _encoded(message, "image of normals", {"32FC3": "f4"}), 3)
    return xyz


def flow(message: Any) -> NDArray[np.float32]:
    """Return optical flow (h, w, 2) [pixel] of a sensor_msgs/Image, 32FC2: to the right and down.

    It leads to the camera's next image, and is NaN where that does not show the same point.
    """
    uv: NDArray[np.float32] = _pixels(message, _encoded(message, "image of optical flow", {"32FC2": "f4"}), 2)
    return uv


def parts(message: Any) -> NDArray[np.uint8]:
    """Return the parts of plants (h, w) of a sensor_msgs/Image, mono8."""
    found: NDArray[np.uint8] = _pixels(message, _encoded(message, "image of parts", {"mono8": "u1"}))[..., 0]
    return found


def passability(message: Any) -> NDArray[np.float32]:
    """Return passability, 0 solid to 1 free, and force [N] (h, w, 2) of a sensor_msgs/Image, 32FC2."""
    found: NDArray[np.float32] = _pixels(message, _encoded(message, "image of passability", {"32FC2": "f4"}), 2)
    return found


def labels(tag_image: NDArray[np.uint8], classes: ClassTable = CLASSES) -> NDArray[np.uint8]:
    """Return the class ids (h, w) of a tag image (h, w, 3).

    Raises:
        BagError: a colour that no class has, with its pixel.
    """
    code = _colour_codes(tag_image)
    found = np.take(_class_of_colour(classes), code)
    if not found.all():
        row, column = divmod(int(np.argmin(found)), tag_image.shape[1])
        colour = " ".join(map(str, tag_image[row, column]))
        raise BagError(f"tag image: pixel in row {row}, column {column} has the colour {colour}, which no class has")
    return found.reshape(tag_image.shape[:-1])


@lru_cache(maxsize=2)
def _class_of_colour(classes: ClassTable) -> NDArray[np.uint8]:
    """Return the class by a colour's code; 0, which no pixel has, without one."""
    table = np.zeros(2**24, np.uint8)
    labels = [row.label for row in classes.coloured]
    table[classes.palette[labels].astype(np.uint32) @ np.array([1, 256, 65536], np.uint32)] = labels
    return table


def _colour_codes(tag_image: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Return each pixel's three bytes as one number, red the lowest; read as four bytes with the last masked."""
    padded = np.zeros(tag_image.size + 1, np.uint8)
    padded[:-1] = tag_image.reshape(-1)
    return np.ndarray(tag_image.size // 3, "<u4", padded, strides=(3,)) & np.uint32(0xFFFFFF)


def stamp_ns(header: Any) -> int:
    """Return the stamp [ns] of a std_msgs/Header."""
    return int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec)


def _where(message: Any, what: str) -> str:
    """Name a message in an error: by topic and stamp if it was read from a bag, else by the stamp in its header."""
    if (origin := getattr(message, ORIGIN, "")) or not hasattr(message, "header"):
        return f"the {what} {origin}".strip()
    return f"the {what} with the stamp {stamp_ns(message.header)} ns"


def _encoded(message: Any, what: str, known: Mapping[str, str]) -> str:
    """Return the type of an image's values by its encoding."""
    encoding = getattr(message, "encoding", f"CompressedImage {getattr(message, 'format', '')}").strip()
    if encoding not in known:
        raise BagError(f"{_where(message, what)}: its encoding must be {' or '.join(known)}, got {encoding!r}")
    return known[encoding]


def _pixels(message: Any, kind: str, channels: int = 1) -> NDArray[Any]:
    """Return (h, w, channels) of an image, whose rows may be padded, in this machine's byte order."""
    dtype = np.dtype((">" if message.is_bigendian else "<") + kind)
    width, height = int(message.width), int(message.height)
    rows = _rows(message.data, height, width * channels * dtype.itemsize, int(message.step)) if width * height else None
    if rows is None:
        size = f"{width} x {height} {message.encoding} with a step of {message.step}"
        raise BagError(f"{_where(message, 'image')} of {size} holds {len(message.data)} bytes")
    return rows.view(dtype).astype(dtype.newbyteorder("="), copy=False).reshape(height, width, channels)


def _unpacked(message: Any) -> NDArray[Any]:
    """Return the values (h, w, channels), 8 or 16 bits, of a CompressedImage, whose bytes name their format."""
    data = bytes(message.data)
    if "compressedDepth" in message.format:
        data = data[_DEPTH_HEADER:]
    try:
        if data.startswith(b"\xff\xd8"):
            return np.asarray(simplejpeg.decode_jpeg(data, "RGB"))
        with Image.open(BytesIO(data), formats=("PNG", "TIFF")) as picture:
            wide = picture.mode.startswith("I;16") or (picture.mode == "I" and picture.format == "PNG")
            if not wide and picture.mode not in ("1", "L", "LA", "P", "RGB", "RGBA"):
                raise ValueError(f"its mode is {picture.mode}")
            values = np.asarray(picture if wide else picture.convert("RGB"))
    except Exception as error:  # decoders raise any exception on invalid bytes
        found = f"{_where(message, 'compressed image')} ({message.format!r}) cannot be read as JPEG, PNG or TIFF"
        reason = "" if isinstance(error, UnidentifiedImageError) else f": {' '.join(str(error).split())[:80]}"
        raise BagError(found + reason) from error
    return values.astype(np.uint16)[..., None] if wide else values


_RGB, _BGR = slice(0, 3), slice(2, None, -1)
_COLOURS: Final = {
    "rgb8": ("u1", 3, _RGB), "bgr8": ("u1", 3, _BGR), "8UC3": ("u1", 3, _BGR), "rgb16": ("u2", 3, _RGB),
    "rgba8": ("u1", 4, _RGB), "bgra8": ("u1", 4, _BGR), "8UC4": ("u1", 4, _BGR), "bgr16": ("u2", 3, _BGR),
    "rgba16": ("u2", 4, _RGB), "bgra16": ("u2", 4, _BGR), "16UC3": ("u2", 3, _BGR), "16UC4": ("u2", 4, _BGR),
    "mono8": ("u1", 1, slice(1)), "8UC1": ("u1", 1, slice(1)), "mono16": ("u2", 1, slice(1)),
}  # fmt: skip
"""Type of the values, channels, and those of red, green and blue, by the encoding of an image."""
_TAGS: Final = [encoding for encoding, (_, channels, _) in _COLOURS.items() if channels > 1]
_DEPTHS: Final = {"32FC1": "f4", "64FC1": "f8", "16UC1": "u2", "mono16": "u2"}
_IDS: Final = {"16UC1": "u2", "mono16": "u2", "8UC1": "u1", "mono8": "u1", "32SC1": "i4"}
_DEPTH_HEADER: Final = 12
"""Bytes before the PNG in an image of ``compressedDepth``: its format, and two numbers of its quantisation."""


def _matrix(xyz: Any, q: Any) -> Array:
    wxyz, position = np.array([q.w, q.x, q.y, q.z]), [xyz.x, xyz.y, xyz.z]
    if not (np.isfinite(position).all() and abs(np.linalg.norm(wxyz) - 1.0) <= UNIT):
        values = ", ".join(f"{value:g}" for value in (*position, *transforms.xyzw_from_wxyz(wxyz)))
        raise BagError(f"a pose must be finite, with a quaternion of length 1, got x, y, z, qx, qy, qz, qw {values}")
    return transforms.pose_from_quaternion_wxyz(position, wxyz)
