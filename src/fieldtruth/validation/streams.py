# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Streams and stamps: topics, types, message counts, stamps, headers, and the clocks of sensors.

A sensor with rate r reads at k / r for k = 1, 2, ... One that measures the robot's own motion reads at the nearest step
of the physics. The stamps in the bag are the true time; those in headers are what the sensor's clock shows. What is
random about it is compared with its law, within five standard deviations of the statistic.
"""

import dataclasses
import math
import struct
from collections import OrderedDict
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import stamp_ns
from fieldtruth.bag.file import is_ros1
from fieldtruth.bag.messages import WHEEL_FRAMES, WORLD
from fieldtruth.bag.reader import RawMessage
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.sensor_config import BASE, KINDS, ODOM, TRUTH, ClockConfig, Output, SensorConfig, Topic
from fieldtruth.validation.check import SIGMAS, Check, Count, Rule, Spec, see_normal
from fieldtruth.validation.context import STEP_NS, Checker, Context, at

PRESENT: Final = Rule("every topic that the sensors publish exists")
TYPES: Final = Rule("topics have the types of the topic table")
DIGESTS: Final = Rule("the MD5 sum of a type is the one of its definition")
TOPICS: Final[Spec] = Spec("topics", (PRESENT, TYPES, DIGESTS), "topics")

COUNT: Final = Rule("each topic has duration times rate messages", 1, "message")
COUNTS: Final[Spec] = Spec("counts", (COUNT,), "topics", "no topic has its rate")

RISING: Final = Rule("the stamps of each topic rise")
HEADER_STAMP: Final = Rule("the stamp in a header is the stamp in the bag")
ON_RATE: Final = Rule("stamps are k / rate, rounded to nanoseconds or to steps of the physics")
NO_GAP: Final = Rule("no reading is missing")
_NO_TOPIC: Final = "no topic of the topic table"
STAMPS: Final[Spec] = Spec("stamps", (RISING, HEADER_STAMP, ON_RATE, NO_GAP), "stamps", _NO_TOPIC)

TOGETHER: Final = Rule("topics of a sensor's readings, odometry and /tf, /clock and model states have the same stamps")
SYNCHRONISATION: Final[Spec] = Spec("synchronisation", (TOGETHER,), "stamps", "no topics with the same stamps")

OWN_STAMP: Final = Rule("/clock publishes its own stamp")
CLOCK: Final[Spec] = Spec("clock", (OWN_STAMP,), "messages", f"no {table.CLOCK}")

SEQUENCE: Final = Rule("sequence numbers count the messages of a topic from 0")
FRAME: Final = Rule("headers name the frame of their sensor")
HEADERS: Final[Spec] = Spec("headers", (SEQUENCE, FRAME), "headers", "no message has a header")

KNOWN_FRAME: Final = Rule("frames of headers exist in /tf_static or /tf")
FRAMES: Final[Spec] = Spec("frames", (KNOWN_FRAME,), "frames", "neither /tf_static nor /tf")

CLOCK_RISES: Final = Rule("the clock of a sensor rises, and is the same in all messages of a reading")
SHOWN: Final = Rule("the clock shows the true time, its offset, its drift and its jitter", 8.0, "deviations")
MEAN: Final = Rule("the jitter has the mean zero from begin to end", SIGMAS, "deviations")
SPREAD: Final = Rule("the jitter has its deviation", SIGMAS, "deviations")
SHAPE: Final = Rule("the jitter is normal: 68 % are within one deviation", SIGMAS, "deviations")
LOST: Final = Rule("the share of lost readings is that of the experiment", SIGMAS, "deviations")
CLOCKS: Final[Spec] = Spec(
    "clocks", (CLOCK_RISES, SHOWN, MEAN, SPREAD, SHAPE, LOST), "messages", "all sensors have the simulated time"
)

_LEAST: Final = 30
"""Fewest readings whose distribution is compared."""

_OPEN: Final = 500
"""Stamps for which further messages are awaited; an intact bag has a few."""


def _outputs(context: Context) -> list[tuple[SensorConfig, Output]]:
    """Sensors of the run with their outputs; of a bag from elsewhere those of the paper."""
    rig = table.PAPER_RIG if context.experiment is None else context.rig
    return [(sensor, output) for sensor in rig.in_order() for output in sensor.outputs()]


def _frame_of(context: Context) -> dict[str, str]:
    """Frame in the headers of each topic."""
    own = {topic.name: output.frame for _, output in _outputs(context) for topic in output.topics if output.frame}
    return {table.ODOMETRY: WORLD, table.TF: WORLD} | own


def _groups(context: Context) -> list[tuple[str, ...]]:
    """Topics of the bag that have the same stamps: those of both views of a camera, for example."""
    groups: dict[tuple[object, ...], tuple[str, ...]] = {}
    for sensor, output in _outputs(context):
        key = sensor.name, output.rate_hz, output.clock, output.ideal
        groups[key] = groups.get(key, ()) + tuple(topic.name for topic in output.topics)
    shared = [*groups.values(), (table.ODOMETRY, table.TF), (table.CLOCK, table.MODEL_STATES)]
    return [tuple(name for name in group if name in context.run.counts) for group in shared]


def loses(context: Context) -> set[str]:
    """Return the topics of sensors that lose readings."""
    lossy = [each for each in context.rig.sensors if each.clock is not None and each.clock.may_lose]
    return {topic.name for each in lossy for topic in each.topics() if not topic.name.endswith(TRUTH)}


def check_topics(context: Context, digests: dict[str, tuple[str, str]]) -> Check:
    """Check which topics there are, and their types.

    Args:
        context: the run.
        digests: by topic, the MD5 sum that the bag states for its type, and the one of its definition there.
    """
    run, tally = context.run, context.tally(TOPICS)
    if context.experiment is not None:  # a run that is shorter than a sensor's period has none of its messages
        lossy = loses(context)
        due = [t for t in context.topics if t.rate_hz is None or t.rate_hz * run.end_ns >= 1e9 - 1.0]
        due = [t for t in due if t.name not in lossy or t.name in run.counts]
    else:
        due = [t for t in context.topics if t.name in run.counts]
    for topic in due:
        if tally[PRESENT].see(topic.name in run.counts, f"{topic.name} is missing"):
            found = run.msgtypes[topic.name]
            tally[TYPES].see(found == topic.msgtype, f"{topic.name} is {found}, not {topic.msgtype}")
    for name, (stated, real) in digests.items():
        tally[DIGESTS].see(stated == real, f"{name} states {stated}, its definition has {real}")
    others = sorted(set(run.counts) - {topic.name for topic in context.topics})
    tally.note = f"{len(others)} other topics are not checked: {', '.join(others[:5])}" if others else ""
    if due:
        return tally.result()
    return Check(TOPICS.name, None, "; ".join([_NO_TOPIC, *[tally.note] * bool(others)]))


class _Clock(NamedTuple):
    """The expected stamps of a topic."""

    rate_hz: float
    on_steps: bool

    def stamp(self, k: int) -> int:
        """Stamp [ns] of reading ``k``, counted from 1."""
        exact = round(k * (1e9 / self.rate_hz))
        return round(exact / STEP_NS) * STEP_NS if self.on_steps else exact

    def number(self, stamp: int) -> int:
        """Return the reading whose stamp is nearest."""
        return round(stamp * self.rate_hz / 1e9)

    def count(self, end: int) -> int:
        """Readings up to and including a stamp [ns]."""
        return int(end * self.rate_hz / 1e9 + 1e-9)


def _is_on_steps(topic: Topic) -> bool:
    """Return whether a topic is that of a sensor of the robot's motion, which reads at steps of the physics."""
    return topic.kind in KINDS and not KINDS[topic.kind].sees


class Stamps(Checker):
    """Message counts, stamps, synchronisation and /clock."""

    def __init__(self, context: Context) -> None:
        run = context.run
        present = [topic for topic in context.topics if topic.name in run.counts]
        self.topics = [topic.name for topic in present]
        self._clocks = {
            topic.name: _Clock(topic.rate_hz, _is_on_steps(topic)) for topic in present if topic.rate_hz is not None
        }
        self._clocked, self._lossy = run.clocked, loses(context)
        self._on_rate = {
            name: Count(
                dataclasses.replace(ON_RATE, text=f"stamps of {name} are k / {clock.rate_hz:g} s"),
                strict=context.experiment is not None,
            )
            for name, clock in self._clocks.items()
        }
        self._counts, self._stamps = context.tally(COUNTS), context.tally(STAMPS)
        self._together, self._clock = context.tally(SYNCHRONISATION), context.tally(CLOCK)
        self.tallies = [self._counts, self._stamps, self._together, self._clock]
        self._last: dict[str, int] = {}
        self._number: dict[str, int] = {}
        self._seen: dict[str, int] = {}
        self._groups = [(group, OrderedDict[int, set[str]]()) for group in _groups(context) if len(group) > 1]

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        name, stamp = raw.topic, raw.stamp_ns
        self._seen[name] = self._seen.get(name, 0) + 1
        if name in self._last:
            self._stamps[RISING].see(stamp > self._last[name], f"{at(raw)} after {self._last[name]} ns")
        self._last[name] = stamp
        for inside in _header_stamps(name, message) if name not in self._clocked else ():
            self._stamps[HEADER_STAMP].see(inside == stamp, f"{at(raw)}: header {inside} ns")
        if name in self._clocks:
            self._follow(raw, self._clocks[name])
        for group, waiting in self._groups:
            if name in group:
                self._meet(group, waiting, raw)
        if name == table.CLOCK:
            published = int.from_bytes(raw.data[:4], "little") * 10**9 + int.from_bytes(raw.data[4:], "little")
            right = raw.data == struct.pack("<LL", *divmod(stamp, 10**9))
            self._clock[OWN_STAMP].see(right, f"{at(raw)}: {published} ns in {len(raw.data)} bytes")

    def finish(self) -> None:
        """Finish the checks after the last message."""
        ends = [self._last[name] for name in (table.CLOCK, table.MODEL_STATES) if name in self._last]
        end = min(ends) if ends else max(self._last.values(), default=0)
        for name, clock in self._clocks.items():
            if self._on_rate[name].passed is None:
                continue  # it follows another clock: the number and the stamps of its messages are unknown
            count, expected, number = self._seen.get(name, 0), clock.count(end), self._number.get(name, 0)
            text = f"{name}: {count:,} messages, {end / 1e9:.3f} s at {clock.rate_hz:g} Hz make {expected:,}"
            if name not in self._lossy:
                self._counts[COUNT].measure(count - expected, text)
                self._stamps[NO_GAP].see(number == expected, f"{name} ends with reading {number:,} of {expected:,}")
        for group, waiting in self._groups:
            for stamp, met in waiting.items():
                self._together[TOGETHER].see(False, _missing(stamp, group, met))

        used = [count for count in self._on_rate.values() if count.passed is not None]
        self._stamps.more += used
        if len(used) < len(self._on_rate):
            self._stamps.note = f"{len(self._on_rate) - len(used)} topics follow another clock"

    def _follow(self, raw: RawMessage, clock: _Clock) -> None:
        number, before = clock.number(raw.stamp_ns), self._number.get(raw.topic, 0)
        due = clock.stamp(number)
        if self._on_rate[raw.topic].see(due == raw.stamp_ns, f"{at(raw)}, due at {due} ns"):
            if raw.topic not in self._lossy:
                self._stamps[NO_GAP].see(number == before + 1, f"{at(raw)}: reading {number} after reading {before}")
            self._number[raw.topic] = number

    def _meet(self, group: tuple[str, ...], waiting: OrderedDict[int, set[str]], raw: RawMessage) -> None:
        met = waiting.setdefault(raw.stamp_ns, set())
        met.add(raw.topic)
        if len(met) == len(group):
            del waiting[raw.stamp_ns]
            self._together[TOGETHER].see(True, "")
        elif len(waiting) > _OPEN:
            stamp, met = waiting.popitem(last=False)
            self._together[TOGETHER].see(False, _missing(stamp, group, met))


def _missing(stamp: int, group: tuple[str, ...], met: set[str]) -> str:
    return f"{stamp} ns: no {', no '.join(name for name in group if name not in met)}"


def _header_stamps(name: str, message: Any) -> list[int]:
    """Stamps [ns] inside a message."""
    if name in (table.TF, table.TF_STATIC):
        return [stamp_ns(each.header) for each in message.transforms]
    return [stamp_ns(message.header)] if hasattr(message, "header") else []


class Headers(Checker):
    """Sequence numbers and frames."""

    def __init__(self, context: Context) -> None:
        self.topics = [topic.name for topic in context.topics if topic.name in context.run.counts]
        self._frame_of, self._lossy = _frame_of(context), loses(context)
        self._headers, self._frames = context.tally(HEADERS), context.tally(FRAMES)
        self.tallies = [self._headers, self._frames]
        self._numbered = is_ros1(context.run.bag)  # ROS 2 has no sequence numbers
        self._numbers: dict[str, int] = {}
        self._named: dict[str, str] = {}
        self._known: set[str] = set()

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        transforms = getattr(message, "transforms", ())
        self._known |= {name for each in transforms for name in (each.header.frame_id, each.child_frame_id)}
        parts = transforms if raw.topic == table.TF else [message] * hasattr(message, "header")
        number = self._numbers.get(raw.topic, 0)
        for part in parts:
            header = part.header
            self._numbers[raw.topic] = header.seq + 1
            right = header.seq >= number if raw.topic in self._lossy else header.seq == number
            if self._numbered:
                self._headers[SEQUENCE].see(right, f"{at(raw)}: {header.seq} instead of {number}")
            self._named.setdefault(header.frame_id, at(raw))
            if raw.topic == table.TF and part.child_frame_id in WHEEL_FRAMES:
                self._see_frame(raw, header.frame_id, BASE)
                continue
            if raw.topic in self._frame_of:
                self._see_frame(raw, header.frame_id, self._frame_of[raw.topic])
            if hasattr(part, "child_frame_id"):
                self._see_frame(raw, part.child_frame_id, BASE)

    def finish(self) -> None:
        """Finish the checks after the last message."""
        if self._known:
            self._known.add(ODOM)
            for name, where in self._named.items():
                self._frames[KNOWN_FRAME].see(name in self._known, f"{where}: {name!r}")

    def _see_frame(self, raw: RawMessage, found: str, due: str) -> None:
        self._headers[FRAME].see(found == due, f"{at(raw)}: {found!r} instead of {due!r}")


class Clocks(Checker):
    """The clocks of all sensors that have one of their own."""

    def __init__(self, context: Context) -> None:
        self._run, self._tally = context.run, context.tally(CLOCKS)
        self.tallies = [self._tally]
        self._sensors = {each.name: each for each in context.rig.sensors if each.enabled and each.clock is not None}
        own = [topic for each in self._sensors.values() for topic in each.topics() if not topic.name.endswith(TRUTH)]
        self._topics = {topic.name: topic for topic in own if topic.name in self._run.counts}
        self._begin_s = {name: _begin_s(each.clock) for name, each in self._sensors.items()}
        self.topics = tuple(self._topics)
        self._shown: dict[str, dict[int, int]] = {name: {} for name in self._sensors}
        """By sensor: what its clock shows [ns] by true stamp."""
        self._seen: dict[str, int] = {}
        self._last: dict[str, int] = {}

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        late = raw.stamp_ns / 1e9 > self._begin_s[self._topics[raw.topic].sensor]
        self._seen[raw.topic] = self._seen.get(raw.topic, 0) + late
        if not hasattr(message, "header"):
            return
        stamp, shown = stamp_ns(message.header), self._shown[self._topics[raw.topic].sensor]
        met = shown.setdefault(raw.stamp_ns, stamp) == stamp and stamp > self._last.get(raw.topic, -1)
        self._tally[CLOCK_RISES].see(met, f"{at(raw)}: {stamp} ns after {self._last.get(raw.topic)} ns")
        self._last[raw.topic] = stamp

    def finish(self) -> None:
        """Compare the distributions after the last message."""
        for name, sensor in self._sensors.items():
            assert sensor.clock is not None
            rows = np.array(sorted(self._shown[name].items()), np.int64).reshape(-1, 2)
            if len(rows):
                self._see_jitter(rows[:, 0] / 1e9, (rows[:, 1] - rows[:, 0]) / 1e9, sensor.clock, name)
        for topic in self._topics.values():
            self._see_lost(self._sensors[topic.sensor], topic.name, topic.rate_hz or 0.0)

    def _see_jitter(self, seconds: Array, error_s: Array, clock: ClockConfig, name: str) -> None:
        jitter = error_s - clock.offset_s - clock.drift_ppm * 1e-6 * seconds
        unit = max(clock.jitter_s, 1e-9)  # stamps are whole nanoseconds
        self._tally[SHOWN].measure_all(jitter / unit, lambda k: f"{name} at {seconds[k]:.9f} s")
        if clock.jitter_s and len(jitter) >= _LEAST:
            see_normal(self._tally, (MEAN, SPREAD, SHAPE), jitter / clock.jitter_s, name)

    def _see_lost(self, sensor: SensorConfig, name: str, rate_hz: float) -> None:
        clock, begin = sensor.clock, int(self._begin_s[sensor.name] * rate_hz + 1e-9)
        assert clock is not None
        due = int(self._run.end_ns / 1e9 * rate_hz + 1e-9) - begin
        if due > 0:
            deviation = math.sqrt(clock.drop_share * (1.0 - clock.drop_share) * due)
            lost = due - self._seen[name]
            self._tally[LOST].measure((lost - clock.drop_share * due) / max(deviation, 0.1), f"{name}: {lost} of {due}")


def _begin_s(clock: ClockConfig | None) -> float:
    """Return the time [s] before which a clock may show 0 or less."""
    return 0.0 if clock is None else max(0.0, 6.0 * clock.jitter_s - clock.offset_s) * 1.02
