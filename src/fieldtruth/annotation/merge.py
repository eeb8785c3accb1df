# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Merge the messages of another bag, unchanged, with those that were made for it."""

from collections.abc import Callable, Iterator, Mapping
from heapq import merge
from pathlib import Path
from typing import Final, NamedTuple

from rosbags.interfaces import Connection

from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import open_bag
from fieldtruth.bag.run import Run
from fieldtruth.bag.writer import BagWriter
from fieldtruth.core.files import output_errors
from fieldtruth.core.progress import Advance, timed
from fieldtruth.record.slices import Slices

RECORDED: Final = "/recorded"
"""Prefix of the bag's own topics where new ones have their names."""


class _Entry(NamedTuple):
    """A message for the new bag: its stamp there [ns], its topic or the connection that recorded it, and its bytes."""

    stamp_ns: int
    topic: str | Connection
    data: bytes


def merge_bags(
    run: Run,
    slices: Slices,
    target: Path,
    latched: Mapping[str, tuple[int, bytes]],
    recorded_at: Callable[[int], int],
    advance: Advance,
) -> None:
    """Write all messages in time order; of those with the same stamp the other bag's come first.

    One chunk of each is in memory at a time.

    Args:
        run: the other bag, all of whose messages are copied; topics that are new, too, get the prefix ``RECORDED``.
        slices: the new messages; all slices are finished.
        target: the new bag; it appears when it is complete.
        latched: stamp in the bag [ns] and bytes, by topic, of messages that are published once.
        recorded_at: stamp in the bag [ns] of a reading taken at a stamp [ns].
        advance: called with the time [s] just written.
    """
    once = [topic for topic in table.PAPER_TOPICS if topic.name in latched]
    with (
        output_errors(target, resumes=True),
        open_bag(run.bag, own_names=True) as source,
        BagWriter(target, [*once, *slices.topics]) as bag,
    ):
        new = {topic.name for topic in slices.topics}
        kept = [c._replace(topic=RECORDED + c.topic) if c.topic in new else c for c in source.connections]
        connections = {connection.id: bag.carry(connection) for connection in kept}

        def original() -> Iterator[_Entry]:
            for raw in source.messages():
                yield _Entry(raw.stamp_ns, connections[raw.connection], raw.data)

        def added() -> Iterator[_Entry]:
            yield from (_Entry(stamp, topic, data) for topic, (stamp, data) in latched.items())
            for k in range(slices.count):
                with open_bag(slices.path(k)) as part:
                    for raw in part.messages():
                        yield _Entry(recorded_at(raw.stamp_ns), raw.topic, raw.data)

        entries = merge(original(), added(), key=lambda entry: entry.stamp_ns)
        for entry in timed(entries, advance, run.start_ns):
            bag.write(entry.topic, entry.stamp_ns, entry.data)
