# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""ROS 1 messages in the form of ROS 2: its message types, and its serialisation (CDR, little endian)."""

import struct
from collections.abc import Callable
from typing import Final

from rosbags.convert.converter import is_same_wireformat, migrate_bytes
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

from fieldtruth.bag.model_states import ModelStatesReader
from fieldtruth.bag.reader import BagError, RawMessage, StoredBag

Convert = Callable[[RawMessage], bytes | memoryview]
"""From a message as ROS 1 stores it to its bytes in CDR."""

_MODEL_STATES: Final = "gazebo_msgs/msg/ModelStates"


class Ros2Types:
    """The message types of a bag as ROS 2 defines them; types that ROS 2 lacks are taken over from the bag.

    The definitions are those of ROS 2 Humble. For all types that this package writes they are, down to the hash,
    the same in every release from Dashing to Kilted.

    Raises:
        BagError: a message definition in the bag cannot be read, or contradicts ROS 2's of the same name.
    """

    def __init__(self, bag: StoredBag) -> None:
        self._path = bag.path
        self._ros1 = bag.types()
        self._ros2 = get_typestore(Stores.ROS2_HUMBLE)
        self._same: dict[str, bool] = {}
        for msgtype in sorted({connection.msgtype for connection in bag.connections}):
            try:
                self._take_over(msgtype)
                self._same[msgtype] = is_same_wireformat(self._ros1, self._ros2, msgtype, msgtype)
            except (TypesysError, KeyError) as error:
                raise BagError(f"{bag.path}: messages of {msgtype} have no form in ROS 2: {error}") from error

    def definition(self, msgtype: str) -> str:
        """Return the text of a type's definition and of those within (``ros2msg``)."""
        return self._ros2.generate_msgdef(msgtype, ros_version=2)[0]

    def digest(self, msgtype: str) -> str:
        """Return ROS 2's hash of a type (REP-2016)."""
        return self._ros2.hash_rihs01(msgtype)

    def converter(self) -> Convert:
        """Return a function for one thread that turns messages to CDR.

        What it raises: BagError for a message that is damaged.
        """
        model_states = _ModelStates(self._from_same)
        defaults: dict[str, object] = {}

        def convert(raw: RawMessage) -> bytes | memoryview:
            try:
                if raw.msgtype == _MODEL_STATES and self._same[_MODEL_STATES]:
                    return model_states(raw)
                if self._same[raw.msgtype]:
                    return self._from_same(raw)
                types = self._ros1, self._ros2, raw.msgtype, raw.msgtype
                return migrate_bytes(*types, defaults, raw.data, src_is2=False, dst_is2=True)
            except Exception as error:  # the generated code raises whatever the bytes lead it to
                where = f"the message of {raw.topic} at {raw.stamp_ns} ns is damaged"
                raise BagError(f"cannot read {self._path}: {where}") from error

        return convert

    def _take_over(self, msgtype: str) -> None:
        """Define a type as the bag does, unless ROS 2 has one of that name."""
        if msgtype in self._ros2.fielddefs:
            return
        text, _ = self._ros1.generate_msgdef(msgtype, ros_version=2)
        types = get_types_from_msg(text, msgtype)
        self._ros2.register({name: fields for name, fields in types.items() if name not in self._ros2.fielddefs})

    def _from_same(self, raw: RawMessage) -> memoryview:
        """CDR of a type with the same fields in the same order: only alignment and lengths differ."""
        return self._ros2.ros1_to_cdr(raw.data, raw.msgtype)


class _ModelStates:
    """gazebo_msgs/ModelStates to CDR, 100 times as fast as field by field: poses and twists are copied in one piece.

    What stands before them, the names, is kept from one message to the next.
    """

    def __init__(self, convert: Convert) -> None:
        self._convert = convert
        self._reader = ModelStatesReader()
        self._names: tuple[str, ...] | None = None
        self._head = b""

    def __call__(self, raw: RawMessage) -> bytes | memoryview:
        poses, twists = self._reader.poses(raw.data), self._reader.twists(raw.data)
        count = len(poses)
        if self._reader.names is not self._names:
            whole = self._convert(raw)
            self._head = bytes(whole[: len(whole) - 104 * count - 8])
            self._names = self._reader.names
        # Doubles start at multiples of 8; a count of 4 bytes and as much padding stands before the twists.
        return b"".join((self._head, poses.data, struct.pack("<I4x", count), twists.data))
