# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One pass through a bag: time series, the robot's trajectory, and counts of the classes in tag images and clouds.

Memory does not grow with the bag, except for the numbers of the small messages (below 1 MB per minute).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import points, tag_image
from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import Trajectory
from fieldtruth.bag.reader import open_bag
from fieldtruth.bag.readings import Readings
from fieldtruth.bag.run import Run
from fieldtruth.core import readings
from fieldtruth.core.arrays import Counts
from fieldtruth.core.classes import CLASSES, PALETTE
from fieldtruth.core.parallel import in_order
from fieldtruth.core.progress import Progress, counted
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.experiment.sensor_config import Topic
from fieldtruth.kernels.counting import count_runs
from fieldtruth.report.page.series import BUCKETS, CHANNELS, Collector, Fixes, Inertial, Lines, Motion, Row, Wheel

_CODES: Final = (PALETTE.astype(np.int64) @ [1, 256, 65536]).astype(np.int64)
UNEXPECTED: Final = (BagError, AttributeError, KeyError, TypeError, ValueError, IndexError)
"""Exceptions from a message that differs from what its topic promises."""
_OTHER_CHANNELS: Final = 9
"""Curves of motion and wheels."""
_CHANNELS: Final = {Inertial: 6, Fixes: 3}


def count_pixels(tag: Any) -> Counts:
    """Count the pixels of a tag image message by class id (18,); row 0 counts colours that no class has.

    Raises:
        BagError: the image is not one in colour.
    """
    counts = np.zeros(len(CLASSES), np.int64)
    count_runs(np.ascontiguousarray(tag_image(tag)).reshape(-1, 3), _CODES, counts)
    return counts


def count_points(cloud: Any) -> Counts:
    """Count the points of a cloud message by class id (18,); row 0 counts points without a class."""
    return np.bincount(class_ids(points(cloud)), minlength=len(CLASSES)).astype(np.int64)


def class_ids(cloud: NDArray[np.void]) -> NDArray[np.uint8]:
    """Class id of each point (n,) from ``label`` or, as in the paper, intensity; 0 if it is not a class id."""
    names = cloud.dtype.names or ()
    name = next((name for name in ("label", "intensity") if name in names), None)
    if name is None or cloud[name].ndim != 1:
        return np.zeros(len(cloud), np.uint8)
    value = cloud[name]
    known = (value >= 1) & (value < len(CLASSES)) & (value == np.floor(value))
    ids: NDArray[np.uint8] = np.where(known, value, 0).astype(np.uint8)
    return ids


@dataclass
class BagSummary:
    """Result of a pass through a bag."""

    lines: Lines = field(default_factory=dict)
    trajectory: Trajectory | None = None
    first_fixes: dict[str, tuple[float, ...]] = field(default_factory=dict)
    """Latitude, longitude [deg], height [m] by sensor; the name is empty if there is one receiver."""
    pixels: dict[str, Counts] = field(default_factory=dict)
    """Pixels by class id (18,) of each tag topic; row 0 counts colours that no class has."""
    points: dict[str, Counts] = field(default_factory=dict)
    """Points by class id (18,) of each topic of clouds."""
    unreadable: dict[str, str] = field(default_factory=dict)
    """By topic that exists and cannot be shown: the reason."""


def published(run: Run) -> tuple[Topic, ...]:
    """Topics that a run with its rig can have; of a bag from elsewhere the paper's."""
    return table.PAPER_TOPICS if run.experiment is None else table.topics_of(run.rig, latched=True)


def usable_topics(run: Run) -> tuple[set[str], dict[str, str]]:
    """Topics whose messages have the type that we publish under this name, and why the others are not usable."""
    promised = {topic.name: topic.msgtype for topic in published(run)}
    known = {topic: msgtype for topic, msgtype in run.msgtypes.items() if topic in promised and topic in run.counts}
    other = {t: f"contains {found}, not {promised[t]}" for t, found in known.items() if found != promised[t]}
    return set(known) - set(other), other


def reason(error: Exception) -> str:
    """Explain why a message cannot be read."""
    return str(error) if isinstance(error, BagError) else f"its messages have an unexpected form ({error})"


def summarize_bag(run: Run, workers: int, progress: Progress) -> BagSummary:
    """Read a bag once.

    Raises:
        BagError: the bag is damaged.
    """
    topics, unusable = usable_topics(run)
    summary = BagSummary(unreadable=unusable)
    collectors = _collectors(run, topics)
    clouds = [each.topic for each in run.of(Cloud)]
    tags = [view.topics["label"] for view in run.of(Image, "label")]
    counters: dict[str, Callable[[Any], Counts]] = dict.fromkeys(tags, count_pixels) | dict.fromkeys(
        clouds, count_points
    )
    wanted = [topic for topic in (*collectors, *counters) if topic in topics]
    opened: dict[str, Readings] = {}
    for topic in set(wanted) - {table.MODEL_STATES}:
        try:
            opened[topic] = run.messages(topic)
        except BagError as error:
            summary.unreadable[topic] = reason(error)
    counts: dict[str, Counts] = {}
    jobs = sorted((stamp, t, row) for t, each in opened.items() for row, stamp in enumerate(each.stamps_ns.tolist()))

    def work(job: tuple[int, str, int]) -> tuple[str, int, Row | Counts | str]:
        stamp, topic, row = job
        use = counters[topic] if topic in counters else collectors[topic].row
        try:
            return topic, stamp, use(opened[topic].message(row))
        except UNEXPECTED as error:
            return topic, stamp, reason(error)

    with progress.stage("read the bag", run.duration_s) as advance:
        for topic, stamp, found in counted(in_order(jobs, work, workers), advance, run.duration_s, len(jobs)):
            if isinstance(found, str):
                summary.unreadable.setdefault(topic, found)
            elif isinstance(found, tuple):
                collectors[topic].add(stamp, found)
            else:
                counts[topic] = counts.get(topic, np.zeros(len(CLASSES), np.int64)) + found
        if table.MODEL_STATES in wanted:
            _collect_states(run, collectors[table.MODEL_STATES], summary.unreadable)
    _finish(summary, collectors, run)
    good = {topic: found for topic, found in counts.items() if topic not in summary.unreadable}
    summary.points = {topic: found for topic, found in good.items() if topic in clouds}
    summary.pixels = {topic: found for topic, found in good.items() if topic in tags}
    return summary


def _collectors(run: Run, topics: set[str]) -> dict[str, Collector]:
    """Collectors of the small messages by topic; Odometry replaces ModelStates, whose rate is 20 times as high."""
    poses = table.ODOMETRY if table.ODOMETRY in topics else table.MODEL_STATES
    inertial, fixes, wheels = (
        run.of(kind, recorded=False) for kind in (readings.Inertial, readings.Fix, readings.WheelSpeeds)
    )
    made: Mapping[str, Collector] = {
        poses: Motion(from_model_states=poses == table.MODEL_STATES),
        **{each.topic: Inertial(each.name * (len(inertial) > 1)) for each in inertial},
        **{each.topic: Fixes(each.name * (len(fixes) > 1)) for each in fixes},
        **{t: Wheel(name.replace("_", " ")) for each in wheels for name, t in each.topics.items()},
    }
    return {topic: collector for topic, collector in made.items() if topic in topics}


def _collect_states(run: Run, collector: Collector, unreadable: dict[str, str]) -> None:
    """Collect the robot's states, which come at 1000 Hz with all objects, and so are not decoded."""
    with open_bag(run.bag) as bag:
        try:
            for raw in bag.messages([table.MODEL_STATES]):
                collector.add(raw.stamp_ns, collector.row(raw.data))
        except UNEXPECTED as error:
            unreadable[table.MODEL_STATES] = reason(error)


def _finish(summary: BagSummary, collectors: Mapping[str, Collector], run: Run) -> None:
    found = [each for topic, each in collectors.items() if topic not in summary.unreadable]
    channels = _OTHER_CHANNELS + sum(_CHANNELS.get(type(each), 0) for each in collectors.values())
    time = run.start_ns, run.end_ns, min(BUCKETS, BUCKETS * CHANNELS // channels)
    for collector in found:
        for curve, lines in collector.lines(time).items():
            summary.lines.setdefault(curve, {}).update(lines)
        if isinstance(collector, Motion):
            summary.trajectory = collector.trajectory()
        if isinstance(collector, Fixes) and collector.first is not None:
            summary.first_fixes[collector.sensor] = collector.first
