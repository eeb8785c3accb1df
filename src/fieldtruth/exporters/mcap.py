# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export a bag as one MCAP file of ROS 2 messages, for ``ros2 bag play`` and Foxglove: every topic, every message.

The log time of a message is its stamp in the bag. Headers lose their ``seq``, which ROS 2 does not have.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import yaml
from mcap.writer import CompressionType, Writer
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

import fieldtruth
from fieldtruth.bag.file import BagError
from fieldtruth.bag.reader import BagReader, RawMessage, open_bag
from fieldtruth.bag.ros2 import Ros2Types
from fieldtruth.bag.run import Run
from fieldtruth.core.progress import timed
from fieldtruth.core.yaml_io import filled, package_data
from fieldtruth.exporters import Options

_CHUNK_SIZE: Final = 4 * 2**20
"""Bytes of messages per chunk, which is what a viewer decompresses to show one instant."""
_FOREVER: Final = QosTime(9223372036, 854775807)


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
    in_namespace = run.experiment is not None and run.experiment.namespace is not None
    with (
        open_bag(run.bag, own_names=in_namespace) as bag,
        target.open("wb") as stream,
        options.progress.stage("messages", run.duration_s) as advance,
    ):
        types = types_of(bag)
        writer = Writer(stream, _CHUNK_SIZE, CompressionType.ZSTD)
        writer.start("ros2", f"fieldtruth {fieldtruth.__version__}")
        channels = {(channel.topic, channel.msgtype): channel for channel in _channels(bag, types)}
        ids = _register(writer, channels.values(), types)
        counts = dict.fromkeys(channels, 0)
        for raw in timed(bag.messages(), advance, run.start_ns):
            key = raw.topic, raw.msgtype
            data = converted(types, raw, bag.path)
            writer.add_message(ids[key], raw.stamp_ns, data, raw.stamp_ns)  # type: ignore[arg-type]
            counts[key] += 1
        rows = [(channel, counts[key]) for key, channel in channels.items()]
        writer.add_metadata("rosbag2", {"serialized_metadata": _rosbag2_metadata(run, rows)})
        writer.finish()  # type: ignore[no-untyped-call]


def _channels(bag: BagReader, types: Ros2Types) -> list[_Channel]:
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


def _register(writer: Writer, channels: Iterable[_Channel], types: Ros2Types) -> dict[tuple[str, str], int]:
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


def types_of(bag: BagReader) -> Ros2Types:
    """Return the message types of a bag.

    Raises:
        BagError: a message definition in the bag cannot be read, or contradicts the one of ROS 2 with the same name.
    """
    return Ros2Types(bag.types(), {connection.msgtype for connection in bag.connections}, str(bag.path))


def converted(types: Ros2Types, raw: RawMessage, path: Path) -> bytes | memoryview:
    """Return a message as CDR.

    Raises:
        BagError: it is damaged.
    """
    try:
        return types.cdr(raw.msgtype, raw.data)
    except Exception as error:  # rosbags' generated code raises arbitrary errors for damaged bytes
        message = f"the message of {raw.topic} at {raw.stamp_ns} ns is damaged"
        raise BagError(f"cannot read {path}: {message}") from error
