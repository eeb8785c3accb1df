# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of one sensor in a bag: by index, by stamp, sliced. Messages become the types of ``core.readings``."""

import operator
import struct
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final, SupportsIndex

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from fieldtruth.bag import decode as read
from fieldtruth.bag.file import BagError, read_errors
from fieldtruth.bag.reader import Storage
from fieldtruth.bag.stamps import Stream, checked_stamp, matched
from fieldtruth.bag.topics import Source
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.classes import CLASSES, ClassTable
from fieldtruth.core.errors import FieldtruthWarning
from fieldtruth.core.readings import (
    Cloud,
    Fix,
    Image,
    Inertial,
    Joints,
    Message,
    Odometry,
    Reading,
    WheelSpeeds,
)

_NAMED: Final = {"instance": "instance", "ring": "ring", "column": "column", "t": "t_ns"}
"""Attribute of ``Cloud`` by the field of a cloud's message that it holds."""
_DECODED: Final[Mapping[str, Callable[[Any], Any]]] = {
    "depth": read.depth,
    "instance": read.instances,
    "normal": read.normals,
    "flow": read.flow,
    "part": read.parts,
    "passability": read.passability,
}
_PNG: Final = b"\x89PNG\r\n\x1a\n"
SERIES: Final = (Inertial, Fix, WheelSpeeds, Joints, Odometry)
"""Types of readings that are small, so that a slice of them is one reading with arrays of n rows."""


class Readings:
    """The readings of a sensor, by rising stamp; may be used by several threads, pickled and forked.

    ``readings[3]`` is one, ``readings[:]`` a list or, of small sensors, one reading with arrays of n rows,
    ``readings.at(stamp_ns)`` that of a stamp. Of a camera, a reading is a stamp at which all ``parts`` exist.
    """

    def __init__(
        self,
        source: Source,
        parts: Sequence[str],
        streams: Sequence[Stream],
        storage: Storage,
        *,
        labelled: bool = True,
        classes: ClassTable = CLASSES,
    ) -> None:
        self.source, self.parts, self.labelled, self.classes = source, tuple(parts), labelled, classes
        self._streams = dict(zip(parts, streams if len(streams) == 1 else matched(streams), strict=True))
        self._storage = storage
        self.stamps_ns: Counts = next(iter(self._streams.values())).stamps_ns
        """(n,) [ns]."""

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def __getitem__(self, index: SupportsIndex | slice) -> Any:
        """Return a reading; of a slice a list, or for a small sensor one with arrays of n rows.

        Raises:
            IndexError: the index is out of range.
            BagError: the bag is missing, has changed, or is damaged, or a reading cannot be understood.
        """
        if isinstance(index, slice):
            found = [self.read(row) for row in range(len(self))[index]]
            return series(found) if issubclass(self.source.type, SERIES) and found else found
        row = operator.index(index)
        if not -len(self) <= row < len(self):
            raise IndexError(f"{self.source.name} has {len(self)} readings, got index {row}")
        return self.read(row % len(self))

    def __iter__(self) -> Iterator[Any]:
        return map(self.read, range(len(self)))

    def row_at(self, stamp_ns: int) -> int | None:
        """Return the index of the reading with a stamp [ns]."""
        row = int(np.searchsorted(self.stamps_ns, stamp_ns))
        return row if row < len(self) and self.stamps_ns[row] == stamp_ns else None

    def at(self, stamp_ns: int, tolerance_ns: int = 0) -> Any:
        """Return the reading at a stamp [ns], or the nearest within a tolerance [ns].

        Raises:
            BagError: no reading has it.
        """
        row = int(np.abs(self.stamps_ns - stamp_ns).argmin()) if len(self) else 0
        if not len(self) or abs(int(self.stamps_ns[row]) - stamp_ns) > tolerance_ns:
            near = f"; the nearest is at {int(self.stamps_ns[row])} ns" if len(self) else ""
            raise BagError(f"{self.source.name} of {self._storage.path} has no reading at {stamp_ns} ns{near}")
        return self.read(row)

    def message(self, row: int, part: str = "") -> Any:
        """Return the message of a part, by default the first, with ROS's field names."""
        return self._message(row, part or self.parts[0])[0]

    def frame(self) -> str:
        """Return the name of the frame of the readings, as the first message has it."""
        header = getattr(self.message(0), "header", None)
        return self.source.frame if header is None else str(header.frame_id)

    def read(self, row: int, parts: Sequence[str] | None = None) -> Any:
        """Return a reading with some of the parts, by default all.

        Raises:
            BagError: the bag is missing, has changed, or is damaged, or the reading cannot be understood.
        """
        found = {part: self._message(row, part) for part in (self.parts if parts is None else parts)}
        messages = {part: message for part, (message, _) in found.items()}
        first, header_ns = next(iter(found.values()))
        frame = str(first.header.frame_id) if hasattr(first, "header") else self.source.frame
        common = {"stamp_ns": int(self.stamps_ns[row]), "header_ns": header_ns, "frame": frame}
        try:
            with read_errors(self._storage.path):
                if self.source.type is Cloud:
                    return cloud_of(first, common, labelled=self.labelled, classes=self.classes)
                if self.source.type is Image:
                    return image_of(messages, common, self.classes)
                return _MADE[self.source.type](messages, common)
        except BagError as error:
            topics = [self.source.topics[part] for part in found]
            said = any(f" of {topic} at " in str(error) for topic in topics)  # by the message itself
            where = "" if said else f"{' and '.join(topics)} at {common['stamp_ns']} ns: "
            raise BagError(f"{self._storage.path}: {where}{error}") from error

    def _message(self, row: int, part: str) -> tuple[Any, int]:
        stream = self._streams[part]
        message = self._storage.message(stream.topic, int(stream.chunk[row]), int(stream.offset[row]))
        clocked = stream.topic in self._storage.clocked
        return message, checked_stamp(stream, row, message, self._storage.path, clocked=clocked)


def series(readings: Sequence[Any]) -> Any:
    """Join readings of a small sensor to one, whose arrays have a row for each."""
    first = vars(readings[0])
    joined = {
        name: value if isinstance(value, str | tuple) else np.array([getattr(each, name) for each in readings])
        for name, value in first.items()
    }
    return type(readings[0])(**joined)


# ---------------------------------------------------------------------------------------------------------------------
# Readings from messages


def cloud_of(
    message: Any, common: Mapping[str, Any] | None = None, *, labelled: bool = True, classes: ClassTable = CLASSES
) -> Cloud:
    """Return the points with finite coordinates of a sensor_msgs/PointCloud2.

    Without a field ``label`` the intensity is the class, as in the paper. If not ``labelled``, all are void.

    Raises:
        BagError: x, y, z or both label and intensity are missing, or a label is not a class id.
    """
    rows = finite_rows(message)
    names = rows.dtype.names or ()
    kind = np.result_type(np.float32, *(rows.dtype[axis] for axis in "xyz"))
    others = {n: np.ascontiguousarray(rows[n]) for n in names if n not in {*"xyz", "label", *_NAMED}}
    named: dict[str, Any] = {place: np.ascontiguousarray(rows[n]) for n, place in _NAMED.items() if n in names}
    xyz = np.stack([rows[axis] for axis in "xyz"], axis=1, dtype=kind)
    label = labels_of(rows, classes) if labelled else np.zeros(len(rows), np.uint8)
    return Cloud(xyz=xyz, label=label, **named, others=others, names=names, **(common or _NOWHERE))


def finite_rows(message: Any) -> NDArray[np.void]:
    """Return a structured array (n) of the points with finite coordinates, with the cloud's own fields.

    Raises:
        BagError: x, y or z is missing.
    """
    rows = read.points(message)
    if not {*"xyz"} <= {*(names := rows.dtype.names or ())}:
        raise BagError(f"a cloud must have x, y and z, got {', '.join(names)}")
    finite = np.logical_and.reduce([np.isfinite(rows[axis]) for axis in "xyz"])
    return rows if finite.all() else rows[finite]


def labels_of(rows: NDArray[np.void], classes: ClassTable = CLASSES) -> NDArray[np.uint8]:
    """Class ids (n,) of points: their label, or without this field their intensity.

    Raises:
        BagError: both are missing, or one is not a class id.
    """
    names = rows.dtype.names or ()
    field = next((name for name in ("label", "intensity") if name in names), None)
    if field is None:
        raise BagError(f"a cloud must have label or intensity, got {', '.join(names)}")
    values = rows[field]
    known = [0, *(row.label for row in classes.coloured)]
    if (odd := values[~np.isin(values, known)]).size:
        raise BagError(f"{field} of a point must be a class, one of {', '.join(map(str, known))}, got {odd[0]:g}")
    return values.astype(np.uint8)


def warn_of_intensity(message: Any, topic: str, path: Any) -> None:
    """Warn that the classes of a cloud without a field for them are read from its intensity."""
    names = [field.name for field in message.fields]
    if "label" not in names and "intensity" in names:
        text = f"{path}: clouds of {topic} have no field label; their intensity is read as the class"
        warnings.warn(text, FieldtruthWarning, stacklevel=4)


def image_of(
    messages: Mapping[str, Any], common: Mapping[str, Any] | None = None, classes: ClassTable = CLASSES
) -> Image:
    """Return the images of a view, from its messages by field of ``Image``; ``jpeg`` has the photograph as stored.

    Raises:
        BagError: an encoding or a colour of the tag image is not known, or the bytes are no image.
    """
    parts: dict[str, Any] = {}
    for part, message in messages.items():
        if part == "photo":
            parts["jpeg"] = bytes(message.data) if hasattr(message, "format") else None
            parts["photo"] = read.image(message)
        elif part == "label":
            parts["label"] = read.labels(read.tag_image(message), classes)
        else:
            parts[part] = _DECODED[part](message)
    return Image(**parts, **(common or _NOWHERE))


def reflectivity(cloud: Cloud) -> NDArray[np.float32]:
    """Return the reflectivity (n,) of points, 1 for a matt white surface that faces the LiDAR; 0 without a signal.

    A cloud with an Ouster's fields has it in percent.
    """
    values = cloud.others.get("reflectivity")
    if values is None or "true_range" not in cloud.others:
        return np.zeros(len(cloud.xyz), np.float32)
    found = values.astype(np.float32)
    return found / np.float32(100.0) if values.dtype.kind == "u" else found


def stored_photo(message: Any, shape: tuple[int, ...]) -> tuple[bytes, str]:
    """Return a photograph as it is stored, and the ending of such files: ``.jpg`` or ``.png``.

    Args:
        message: sensor_msgs/CompressedImage.
        shape: (h, w) of its tag image.

    Raises:
        BagError: it is neither JPEG nor PNG, or has another size.
    """
    data = bytes(message.data)
    try:
        if data.startswith(_PNG):
            (width, height), suffix = struct.unpack_from(">2L", data, 16), ".png"
        else:
            (height, width, *_), suffix = simplejpeg.decode_jpeg_header(data), ".jpg"
    except (ValueError, struct.error):
        raise BagError("the photograph is neither JPEG nor PNG") from None
    if (height, width) != shape:
        tag = f"its tag image has {shape[1]} x {shape[0]} pixels"
        raise BagError(f"the photograph has {width} x {height} pixels; {tag}")
    return data, suffix


_NOWHERE: Final = {"stamp_ns": 0, "header_ns": 0}


def _vector(v: Any) -> Array:
    return np.array([v.x, v.y, v.z])


def _wxyz(q: Any) -> Array:
    return np.array([q.w, q.x, q.y, q.z])


def _inertial(messages: Mapping[str, Any], common: Mapping[str, Any]) -> Inertial:
    (m,) = messages.values()
    rate, force = _vector(m.angular_velocity), _vector(m.linear_acceleration)
    return Inertial(angular_velocity=rate, linear_acceleration=force, orientation_wxyz=_wxyz(m.orientation), **common)


def _fix(messages: Mapping[str, Any], common: Mapping[str, Any]) -> Fix:
    (m,) = messages.values()
    covariance = np.array(m.position_covariance, np.float64).reshape(3, 3)
    geodetic = np.array([m.latitude, m.longitude, m.altitude])
    return Fix(geodetic=geodetic, covariance=covariance, status=int(m.status.status), **common)


def _speeds(messages: Mapping[str, Any], common: Mapping[str, Any]) -> WheelSpeeds:
    return WheelSpeeds(speed=np.array([m.data for m in messages.values()]), names=tuple(messages), **common)


def _joints(messages: Mapping[str, Any], common: Mapping[str, Any]) -> Joints:
    (m,) = messages.values()
    angle, speed = (np.array(each, np.float64) for each in (m.position, m.velocity))
    return Joints(names=tuple(m.name), angle=angle, speed=speed, **common)


def _odometry(messages: Mapping[str, Any], common: Mapping[str, Any]) -> Odometry:
    (m,) = messages.values()
    return Odometry(
        position=_vector(m.pose.pose.position),
        quaternion_wxyz=_wxyz(m.pose.pose.orientation),
        linear_velocity=_vector(m.twist.twist.linear),
        angular_velocity=_vector(m.twist.twist.angular),
        child=str(m.child_frame_id),
        **common,
    )


def _other(messages: Mapping[str, Any], common: Mapping[str, Any]) -> Message:
    return Message(value=next(iter(messages.values())), **common)


_MADE: Final[Mapping[type[Reading], Callable[[Mapping[str, Any], Mapping[str, Any]], Reading]]] = {
    Inertial: _inertial,
    Fix: _fix,
    WheelSpeeds: _speeds,
    Joints: _joints,
    Odometry: _odometry,
    Message: _other,
}
