# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Two streams of messages become one bag: those of another bag as they are, and those that were made for it."""

from collections.abc import Callable, Iterator, Mapping
from heapq import merge
from pathlib import Path
from typing import NamedTuple

from rosbags.interfaces import Connection

from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import open_bag
from fieldtruth.bag.run import Run
from fieldtruth.bag.writer import BagWriter
from fieldtruth.core.files import output_errors
from fieldtruth.core.progress import Advance
from fieldtruth.record.slices import PROGRESS_NS, Slices


class _Entry(NamedTuple):
    """A message for the new bag: its stamp there [ns], its topic or the connection that it was recorded by, bytes."""

    stamp_ns: int
    topic: str | Connection
    data: bytes


def weave(
    run: Run,
    slices: Slices,
    target: Path,
    fixed: Mapping[str, tuple[int, bytes]],
    recorded_at: Callable[[int], int],
    advance: Advance,
) -> None:
    """Write all messages in time order; where stamps are equal, first those of the other bag.

    One chunk of either side is in memory at a time.

    Args:
        run: the other bag, all of whose messages and topics are carried over.
        slices: what was made, all of it finished.
        target: the new bag, which is there when it is whole.
        fixed: stamp in the bag [ns] and bytes, by topic, of what is said once.
        recorded_at: stamp in the bag [ns] of what was sensed at a stamp [ns].
        advance: is called with the time [s] just written.
    """
    once = [topic for topic in table.TOPICS if topic.name in fixed]
    with output_errors(target), open_bag(run.bag) as source, BagWriter(target, [*once, *slices.topics]) as bag:
        carried = {connection.id: bag.carry(connection) for connection in source.connections}

        def theirs() -> Iterator[_Entry]:
            for raw in source.messages():
                yield _Entry(raw.stamp_ns, carried[raw.connection], raw.data)

        def ours() -> Iterator[_Entry]:
            yield from (_Entry(stamp, topic, data) for topic, (stamp, data) in fixed.items())
            for k in range(slices.count):
                with open_bag(slices.path(k)) as part:
                    for raw in part.messages():
                        yield _Entry(recorded_at(raw.stamp_ns), raw.topic, raw.data)

        reported_ns = run.start_ns
        for entry in merge(theirs(), ours(), key=lambda entry: entry.stamp_ns):
            bag.write(entry.topic, entry.stamp_ns, entry.data)
            if entry.stamp_ns - reported_ns >= PROGRESS_NS:
                advance((entry.stamp_ns - reported_ns) / 1e9)
                reported_ns = entry.stamp_ns
