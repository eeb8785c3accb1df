# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of ROS 2 (CDR) as ROS 1 serialises them, so that all who read bags see one set of types and field names.

ROS 1 has ``seq`` in headers, which becomes 0, and capital letters in CameraInfo. A type that both have is read as ROS 1
defines it, any other as the file does.
"""

import struct
from collections.abc import Callable
from functools import lru_cache
from typing import Final, NamedTuple

from rosbags.convert.converter import is_same_wireformat, migrate_bytes
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from fieldtruth.bag import messages as ros

MODEL_STATES: Final = "gazebo_msgs/msg/ModelStates"
ROS1_GAP, ROS2_GAP = 4, 8
"""Bytes between poses and twists of that type."""
_LITTLE_ENDIAN: Final = b"\x00\x01"

_BUILTIN: Final = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
"""Types that some definitions use without repeating them."""

Convert = Callable[[bytes], bytes]


class Ros2Type(NamedTuple):
    """A message type of ROS 2: its name, like ``sensor_msgs/msg/Imu``, and its definition, maybe empty."""

    name: str
    definition: str
    is_idl: bool = False


@lru_cache(maxsize=256)
def definition_of(kind: Ros2Type) -> tuple[str, str]:
    """Return the definition in ROS 1 of a type, with those it contains, and its MD5 sum.

    Raises:
        TypesysError, KeyError: the type is unknown, or its definition cannot be read.
    """
    return _stores(kind)[1].generate_msgdef(kind.name)


@lru_cache(maxsize=256)
def converter_of(kind: Ros2Type) -> Convert:
    """Return the function that makes a message of ROS 1 from one of ROS 2; it raises any error for damaged bytes."""
    ros2, ros1 = _stores(kind)
    same, defaults = is_same_wireformat(ros2, ros1, kind.name, kind.name), dict[str, object]()

    def convert(data: bytes) -> bytes:
        if same and data.startswith(_LITTLE_ENDIAN):
            return bytes(ros2.cdr_to_ros1(data, kind.name))
        types = ros2, ros1, kind.name, kind.name
        return bytes(migrate_bytes(*types, defaults, data, src_is2=True, dst_is2=False))

    return ModelStatesConverter(convert, (ROS2_GAP, ROS1_GAP)) if same and kind.name == MODEL_STATES else convert


@lru_cache(maxsize=256)
def _stores(kind: Ros2Type) -> tuple[Typestore, Typestore]:
    """Return the types of ROS 2 and of ROS 1 that a type consists of."""
    ros2 = get_typestore(Stores.ROS2_HUMBLE)
    if kind.definition:
        own = get_types_from_idl(kind.definition) if kind.is_idl else get_types_from_msg(kind.definition, kind.name)
        own = {name: ros2.fielddefs[name] for name in _BUILTIN} | own
        ros2 = get_typestore(Stores.EMPTY)
        ros2.register(own)
    if kind.name in ros.STORE.fielddefs:
        return ros2, ros.STORE
    if kind.name not in ros2.fielddefs:
        raise TypesysError(f"Type {kind.name!r} is unknown.")
    ros1 = get_typestore(Stores.ROS1_NOETIC)
    types = get_types_from_msg(ros2.generate_msgdef(kind.name)[0], kind.name)
    ros1.register({name: fields for name, fields in types.items() if name not in ros1.fielddefs})
    return ros2, ros1


class ModelStatesConverter:
    """Converts gazebo_msgs/ModelStates, which comes at 1000 Hz: poses and twists are copied as two arrays.

    Field by field it takes 1 ms for a message of hundreds of objects. The names are kept from one message to the next.

    Args:
        convert: converts any message of the type.
        gaps: bytes between poses and twists, in the messages that are given and in those that are returned: their
            number and, in ROS 2, padding, because doubles start at multiples of 8.
    """

    def __init__(self, convert: Convert, gaps: tuple[int, int]) -> None:
        self._convert, self._gaps = convert, gaps
        self._known = b"", b"", 0
        """The bytes before the poses, as given and as returned, and the number of poses; threads share it."""

    def __call__(self, data: bytes) -> bytes:
        """Return a converted message."""
        (head, names, count), (gap, new_gap) = self._known, self._gaps
        at, middle, number = len(head), len(head) + 56 * count, struct.pack("<L", count)
        fits = len(data) == at + 104 * count + gap and data[middle : middle + 4] == number
        if not (count and fits and data.startswith(head)):
            whole = bytes(self._convert(data))
            (count,) = struct.unpack_from("<L", whole if gap > new_gap else data)
            self._known = data[: len(data) - 104 * count - gap], whole[: len(whole) - 104 * count - new_gap], count
            return whole
        return b"".join((names, data[at:middle], number.ljust(new_gap, b"\0"), data[middle + gap :]))
