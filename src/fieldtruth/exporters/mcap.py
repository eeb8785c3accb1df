# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A bag as one MCAP file of ROS 2 messages, for ``ros2 bag play`` and Foxglove: every topic, every message.

A message keeps its stamp in the bag, as log time, and that in its header, but not its ``seq``, which ROS 2 has not.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from rosbags.interfaces import ConnectionExtRosbag1

import fieldtruth
from fieldtruth.bag.reader import RawMessage, StoredBag, open_stored
from fieldtruth.bag.run import Run
from fieldtruth.core.parallel import in_order
from fieldtruth.exporters import Options
from fieldtruth.exporters.mcap_file import Chunk, McapWriter, Message, pack
from fieldtruth.exporters.ros2 import Ros2Types

_CHUNK_SIZE: Final = 4 * 2**20
"""Size [byte] of messages from which on a chunk is full: what a viewer must unpack to show one instant."""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the file.

    Raises:
        BagError: the bag is damaged, or holds a type that contradicts ROS 2's of the same name.
    """
    (run,) = runs
    with (
        open_stored(run.bag) as bag,
        target.open("wb") as stream,
        options.progress.stage("messages", run.duration_s) as advance,
    ):
        types = Ros2Types(bag)
        writer = McapWriter(stream, f"fieldtruth {fieldtruth.__version__}")
        channels = _add_channels(writer, bag, types)

        def work(messages: Sequence[RawMessage]) -> Chunk:
            convert = types.converter()
            return pack(Message(channels[raw.topic, raw.msgtype], raw.stamp_ns, convert(raw)) for raw in messages)

        done_ns = run.start_ns
        for chunk in in_order(_batches(bag.messages()), work, options.workers):
            writer.append(chunk)
            advance((chunk.end_ns - done_ns) / 1e9)
            done_ns = chunk.end_ns
        writer.finish(f"{run.name}.mcap")


def _add_channels(writer: McapWriter, bag: StoredBag, types: Ros2Types) -> Mapping[tuple[str, str], int]:
    """Ids by topic and type; a topic that several nodes published is one channel."""
    latched: dict[tuple[str, str], bool] = {}
    for connection in bag.connections:
        key = connection.topic, connection.msgtype
        extra = connection.ext
        stays = isinstance(extra, ConnectionExtRosbag1) and bool(extra.latching)
        latched[key] = latched.get(key, False) or stays
    return {
        (topic, msgtype): writer.add_channel(
            topic, msgtype, types.definition(msgtype), types.digest(msgtype), latched=stays
        )
        for (topic, msgtype), stays in latched.items()
    }


def _batches(messages: Iterable[RawMessage]) -> Iterator[list[RawMessage]]:
    batch: list[RawMessage] = []
    size = 0
    for raw in messages:
        batch.append(raw)
        size += len(raw.data)
        if size >= _CHUNK_SIZE:
            yield batch
            batch, size = [], 0
    if batch:
        yield batch
