# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export a bag as one MCAP file of ROS 2 messages, for ``ros2 bag play`` and Foxglove: every topic, every message.

The log time of a message is its stamp in the bag. Headers lose their ``seq``, which ROS 2 does not have.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

import yaml
from mcap.writer import CompressionType, Writer
from rosbags.convert.converter import is_same_wireformat, migrate_bytes
from rosbags.interfaces import (
    ConnectionExtRosbag1,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2.metadata import dump_qos_v8
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

import fieldtruth
from fieldtruth.bag.file import BagError
from fieldtruth.bag.reader import BagReader, RawMessage, open_bag
from fieldtruth.bag.ros2 import MODEL_STATES, ROS1_GAP, ROS2_GAP, ModelStatesConverter
from fieldtruth.bag.run import Run
from fieldtruth.core.progress import timed
from fieldtruth.core.yaml_io import filled, package_data
from fieldtruth.exporters import Options

_CHUNK_SIZE: Final = 4 * 2**20
"""Bytes of messages per chunk, which is what a viewer decompresses to show one instant."""
_FOREVER: Final = QosTime(9223372036, 854775807)

Convert = Callable[[RawMessage], bytes | memoryview]
"""Converts a ROS 1 message to CDR."""


class _Channel(NamedTuple):
    """A topic as rosbag2 describes it."""

    topic: str
    msgtype: str
    digest: str
    """RIHS01 hash of the type (REP-2016)."""
    qos: str
    """YAML."""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the file.

    Raises:
        BagError: the bag is damaged, or has a message type that contradicts the one of ROS 2 with the same name.
    """
    (run,) = runs
    with (
        open_bag(run.bag) as bag,
        target.open("wb") as stream,
        options.progress.stage("messages", run.duration_s) as advance,
    ):
        types = Ros2Types(bag)
        writer = Writer(stream, _CHUNK_SIZE, CompressionType.ZSTD)
        writer.start("ros2", f"fieldtruth {fieldtruth.__version__}")
        channels = {(channel.topic, channel.msgtype): channel for channel in _channels(bag, types)}
        ids = _register(writer, channels.values(), types)
        counts = dict.fromkeys(channels, 0)
        convert = types.converter()
        for raw in timed(bag.messages(), advance, run.start_ns):
            key = raw.topic, raw.msgtype
            writer.add_message(ids[key], raw.stamp_ns, convert(raw), raw.stamp_ns)  # type: ignore[arg-type]
            counts[key] += 1
        rows = [(channel, counts[key]) for key, channel in channels.items()]
        writer.add_metadata("rosbag2", {"serialized_metadata": _rosbag2_metadata(run, rows)})
        writer.finish()  # type: ignore[no-untyped-call]


def _channels(bag: BagReader, types: "Ros2Types") -> list[_Channel]:
    """One channel per topic and type, however many nodes published it."""
    latched: dict[tuple[str, str], bool] = {}
    for connection in bag.connections:
        key, extra = (connection.topic, connection.msgtype), connection.ext
        is_latched = isinstance(extra, ConnectionExtRosbag1) and bool(extra.latching)
        latched[key] = latched.get(key, False) or is_latched
    return [
        _Channel(topic, msgtype, types.digest(msgtype), _qos(latched=is_latched))
        for (topic, msgtype), is_latched in latched.items()
    ]


def _register(writer: Writer, channels: Iterable[_Channel], types: "Ros2Types") -> dict[tuple[str, str], int]:
    """Add schemas and channels to the file; return the channels' ids by topic and type."""
    schemas: dict[str, int] = {}
    ids = {}
    for channel in channels:
        if channel.msgtype not in schemas:
            definition = types.definition(channel.msgtype).encode()
            schemas[channel.msgtype] = writer.register_schema(channel.msgtype, "ros2msg", definition)
        metadata = {"offered_qos_profiles": channel.qos, "topic_type_hash": channel.digest}
        schema = schemas[channel.msgtype]
        ids[channel.topic, channel.msgtype] = writer.register_channel(channel.topic, "cdr", schema, metadata)
    return ids


def _qos(*, latched: bool) -> str:
    """Quality of service: reliable; a latched topic is transient local, so that late subscribers get its message."""
    durability = QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE
    history, liveliness = (QosHistory.UNKNOWN, 0, QosReliability.RELIABLE, durability), QosLiveliness.AUTOMATIC
    return dump_qos_v8([Qos(*history, _FOREVER, _FOREVER, liveliness, _FOREVER, avoid_ros_namespace_conventions=False)])


def _rosbag2_metadata(run: Run, rows: Sequence[tuple[_Channel, int]]) -> str:
    """rosbag2's description of a bag, of channels with their message counts.

    Version 8 is the last whose QoS settings Humble reads, too.
    """
    template = package_data("fieldtruth.exporters", "mcap.yaml")
    totals = {"start": run.start_ns, "duration": run.end_ns - run.start_ns, "count": sum(count for _, count in rows)}
    topics = [filled(template["topic"], {"channel": channel, "count": count}) for channel, count in rows]
    metadata = filled(template["bag"], totals | {"name": f"{run.name}.mcap", "topics": topics})
    return yaml.safe_dump(metadata, sort_keys=False)


class Ros2Types:
    """The message types of a bag as ROS 2 Humble defines them; types that ROS 2 lacks are copied from the bag.

    For all types that fieldtruth writes, definitions and hashes are the same in every release from Dashing to Kilted.

    Raises:
        BagError: a message definition in the bag cannot be read, or contradicts the one of ROS 2 with the same name.
    """

    def __init__(self, bag: BagReader) -> None:
        self._path = bag.path
        self._ros1 = bag.types()
        self._ros2 = get_typestore(Stores.ROS2_HUMBLE)
        self._same: dict[str, bool] = {}
        for msgtype in sorted({connection.msgtype for connection in bag.connections}):
            try:
                self._copy_if_missing(msgtype)
                self._same[msgtype] = is_same_wireformat(self._ros1, self._ros2, msgtype, msgtype)
            except (TypesysError, KeyError) as error:
                raise BagError(f"{bag.path}: cannot convert {msgtype} to ROS 2: {error}") from error

    def definition(self, msgtype: str) -> str:
        """Return the text of a type's definition with those it contains (``ros2msg``)."""
        return self._ros2.generate_msgdef(msgtype, ros_version=2)[0]

    def digest(self, msgtype: str) -> str:
        """Return the RIHS01 hash of a type (REP-2016)."""
        return self._ros2.hash_rihs01(msgtype)

    def converter(self) -> Convert:
        """Return a function that converts messages to CDR; it raises BagError for a damaged message."""
        copy = partial(self._same_fields_to_cdr, MODEL_STATES)
        model_states = ModelStatesConverter(copy, (ROS1_GAP, ROS2_GAP))
        defaults: dict[str, object] = {}

        def convert(raw: RawMessage) -> bytes | memoryview:
            try:
                if raw.msgtype == MODEL_STATES and self._same[MODEL_STATES]:
                    return model_states(raw.data)
                if self._same[raw.msgtype]:
                    return self._same_fields_to_cdr(raw.msgtype, raw.data)
                types = self._ros1, self._ros2, raw.msgtype, raw.msgtype
                return migrate_bytes(*types, defaults, raw.data, src_is2=False, dst_is2=True)
            except Exception as error:  # rosbags' generated code raises arbitrary errors for damaged bytes
                message = f"the message of {raw.topic} at {raw.stamp_ns} ns is damaged"
                raise BagError(f"cannot read {self._path}: {message}") from error

        return convert

    def _copy_if_missing(self, msgtype: str) -> None:
        """Define a type as the bag does, unless ROS 2 has one with this name."""
        if msgtype in self._ros2.fielddefs:
            return
        text, _ = self._ros1.generate_msgdef(msgtype, ros_version=2)
        types = get_types_from_msg(text, msgtype)
        self._ros2.register({name: fields for name, fields in types.items() if name not in self._ros2.fielddefs})

    def _same_fields_to_cdr(self, msgtype: str, data: bytes) -> bytes:
        """Convert a message of a type with the same fields in the same order: only alignment and lengths differ."""
        return bytes(self._ros2.ros1_to_cdr(data, msgtype))
