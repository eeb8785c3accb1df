# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One passage through a bag, from its first message to its last: curves, the robot's way, and counts of classes.

What is kept does not grow with the bag, but for a pose each 20 ms (64 bytes).
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import stamp_ns
from fieldtruth.bag.reader import BagError, RawMessage, decoder, open_bag
from fieldtruth.bag.run import Run
from fieldtruth.bag.trajectory import Trajectory
from fieldtruth.core.arrays import Counts
from fieldtruth.core.classes import CLASSES
from fieldtruth.core.parallel import in_order
from fieldtruth.core.progress import Progress
from fieldtruth.experiment.rig import WHEELS
from fieldtruth.report.page.class_counts import count_pixels, count_points
from fieldtruth.report.page.series import Collector, Fixes, Inertial, Lines, Motion, Wheel

TAGS: Final = tuple(map(table.tag, table.SIDES))
_MSGTYPE: Final = {topic.name: topic.msgtype for topic in table.TOPICS}
_TOLD: Final = 100_000_000  # [ns] of simulated time from one word of progress to the next
_ANOTHER_CLOCK: Final = 10_000_000_000  # [ns]
FOREIGN: Final = (BagError, AttributeError, KeyError, TypeError, ValueError, IndexError)
"""What a message raises that is not as its topic's messages are."""


@dataclass
class Passage:
    """What a passage through a bag leaves behind."""

    lines: Lines = field(default_factory=dict)
    trajectory: Trajectory | None = None
    first_fix: tuple[float, float, float] | None = None
    """Latitude, longitude [deg], height [m]."""
    pixels: dict[str, Counts] = field(default_factory=dict)
    """By topic of tag images: pixels by class id (16,); row 0 are those of no class."""
    points: Counts | None = None
    """Points by class id (16,); None without clouds."""
    unreadable: dict[str, str] = field(default_factory=dict)
    """Why, by topic that is there and yet is not shown."""


def usable(run: Run) -> tuple[set[str], dict[str, str]]:
    """Topics whose messages are of the type that their name promises, and why the others are not."""
    known = {topic: msgtype for topic, msgtype in run.msgtypes.items() if topic in _MSGTYPE and topic in run.counts}
    foreign = {t: f"holds {has}, not {_MSGTYPE[t]}" for t, has in known.items() if has != _MSGTYPE[t]}
    return set(known) - set(foreign), foreign


def stamp_of(message: Any, raw: RawMessage) -> int:
    """Stamp [ns] of a message: its header's, unless it has none, or one from another clock than the bag's."""
    header = getattr(message, "header", None)
    stamp = raw.stamp_ns if header is None else stamp_ns(header)
    return stamp if abs(stamp - raw.stamp_ns) < _ANOTHER_CLOCK else raw.stamp_ns


def read_through(run: Run, workers: int, progress: Progress) -> Passage:
    """Read a run once.

    Raises:
        BagError: the bag is damaged.
    """
    topics, foreign = usable(run)
    passage = Passage(unreadable=foreign)
    collectors = _collectors(run, topics)
    heavy: dict[str, Callable[[Any], Counts]] = dict.fromkeys(TAGS, count_pixels) | {table.POINTS: count_points}
    wanted = [topic for topic in (*collectors, *heavy) if topic in topics]
    if not wanted:  # an empty list would ask for all
        return passage
    counts: dict[str, Counts] = {}
    with progress.stage("read the bag", run.duration_s) as advance, open_bag(run.bag) as bag:
        decode = decoder(bag)

        def light_ones_aside() -> Iterator[RawMessage]:
            told = run.start_ns
            for raw in bag.messages(wanted):
                if raw.topic in heavy:
                    yield raw
                elif raw.topic not in passage.unreadable:
                    _collect(collectors[raw.topic], raw, decode, passage.unreadable)
                if raw.stamp_ns - told >= _TOLD:
                    advance((raw.stamp_ns - told) / 1e9)
                    told = raw.stamp_ns

        def count(raw: RawMessage) -> tuple[str, Counts | str]:
            try:
                return raw.topic, heavy[raw.topic](decode(raw))
            except FOREIGN as error:
                return raw.topic, reason(error)

        for topic, found in in_order(light_ones_aside(), count, workers):
            if isinstance(found, str):
                passage.unreadable.setdefault(topic, found)
            else:
                counts.setdefault(topic, np.zeros(len(CLASSES), np.int64))
                counts[topic] += found
    _sum_up(passage, collectors, counts)
    return passage


def _collectors(run: Run, topics: set[str]) -> dict[str, Collector]:
    """Who takes the small messages, by topic. Odometry tells all that ModelStates does, at a twentieth of the rate."""
    span = run.start_ns, run.end_ns
    poses = table.ODOMETRY if table.ODOMETRY in topics else table.MODEL_STATES
    made: Mapping[str, Collector] = {
        poses: Motion(*span, from_model_states=poses == table.MODEL_STATES),
        table.IMU: Inertial(*span),
        table.NAVSAT: Fixes(*span),
        **{t: Wheel(*span, name.replace("_", " ")) for t, name in zip(table.WHEEL_SPEEDS, WHEELS, strict=True)},
    }
    return {topic: collector for topic, collector in made.items() if topic in topics}


def _collect(
    collector: Collector, raw: RawMessage, decode: Callable[[RawMessage], Any], unreadable: dict[str, str]
) -> None:
    try:
        if isinstance(collector, Motion) and collector.from_model_states:
            collector.add(raw.stamp_ns, collector.row(raw.data))
            return
        message = decode(raw)
        collector.add(stamp_of(message, raw), collector.row(message))
    except FOREIGN as error:
        unreadable[raw.topic] = reason(error)


def _sum_up(passage: Passage, collectors: Mapping[str, Collector], counts: Mapping[str, Counts]) -> None:
    for topic, collector in collectors.items():
        if topic in passage.unreadable:
            continue
        for curve, lines in collector.lines().items():
            passage.lines.setdefault(curve, {}).update(lines)
        if isinstance(collector, Motion):
            passage.trajectory = collector.trajectory()
        if isinstance(collector, Fixes):
            passage.first_fix = collector.first
    good = {topic: found for topic, found in counts.items() if topic not in passage.unreadable}
    passage.points = good.pop(table.POINTS, None)
    passage.pixels = good


def reason(error: Exception) -> str:
    """Why a message cannot be read, in words."""
    return str(error) if isinstance(error, BagError) else f"its messages have another form ({error})"
