# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Time: as many messages as the rate and the duration make, every stamp on its clock's beat, and sensors in step.

A sensor of rate r reads at k / r for k = 1, 2, ... IMU, receiver and tachometers read at the physics step next to it.
"""

from collections import OrderedDict
from typing import Any, Final

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import stamp_ns
from fieldtruth.bag.reader import RawMessage
from fieldtruth.validation.check import Check
from fieldtruth.validation.law import check_of
from fieldtruth.validation.subject import STEP_NS, Examiner, Subject, place_of

_FELT: Final = (table.IMU, table.NAVSAT, *table.WHEEL_SPEEDS)
_CAMERAS: Final = tuple(topic.name for topic in table.TOPICS if topic.sensor in ("cameras", "depth", "instances"))
_IN_STEP: Final = (_CAMERAS, table.WHEEL_SPEEDS, (table.ODOMETRY, table.TF), (table.CLOCK, table.MODEL_STATES))
_OPEN: Final = 500
"""Stamps for which messages are waited for; a healthy bag has a few."""


class Beat:
    """The stamps of a topic: k / rate, rounded to nanoseconds, or to physics steps."""

    def __init__(self, rate_hz: float, on_steps: bool) -> None:
        self.rate_hz = rate_hz
        self._on_steps = on_steps

    def stamp(self, k: int) -> int:
        """Stamp [ns] of reading ``k``, counted from 1."""
        exact = round(k * (1e9 / self.rate_hz))
        return round(exact / STEP_NS) * STEP_NS if self._on_steps else exact

    def number(self, stamp: int) -> int:
        """Return the reading whose stamp is nearest."""
        return round(stamp * self.rate_hz / 1e9)

    def count(self, end: int) -> int:
        """Readings up to and including a stamp [ns]."""
        return int(end * self.rate_hz / 1e9 + 1e-9)


class Stamps(Examiner):
    """Counts, stamps and their steps."""

    def __init__(self, subject: Subject) -> None:
        run = subject.run
        self._subject = subject
        known = {topic.name: topic for topic in table.TOPICS}
        self.topics = [name for name in known if name in run.counts]
        self._beats = {
            name: Beat(rate(subject.rig), name in _FELT)
            for name in self.topics
            if (rate := known[name].rate_hz) is not None
        }
        self._last: dict[str, int] = {}
        self._number: dict[str, int] = {}
        self._seen: dict[str, int] = {}
        self._rising = subject.law("the stamps of each topic rise")
        self._header = subject.law("the stamp in a header is the bag's")
        self._on_beat = {n: subject.law(f"stamps of {n} are k / {b.rate_hz:g} s") for n, b in self._beats.items()}
        self._no_gap = subject.law("no reading is left out")
        self._counts = subject.law("each topic has duration times rate messages, within one")
        self._step = subject.law("what belongs together has the same stamps")
        self._groups = [
            (present, OrderedDict[int, int]())
            for group in _IN_STEP
            if len(present := tuple(name for name in group if name in run.counts)) > 1
        ]

    def feed(self, raw: RawMessage, message: Any) -> None:
        """See a message."""
        name, stamp = raw.topic, raw.stamp_ns
        self._seen[name] = self._seen.get(name, 0) + 1
        last = self._last.get(name)
        if last is not None:
            self._rising.see(stamp > last, lambda: f"{place_of(raw)} after {last} ns")
        self._last[name] = stamp
        for inside in _header_stamps(name, message):
            self._header.see(inside == stamp, f"{place_of(raw)}: header {inside} ns")
        if name in self._beats:
            self._follow(raw, self._beats[name])
        for group, waiting in self._groups:
            if name in group:
                self._meet(group, waiting, raw)

    def finish(self) -> None:
        """See the end of the bag."""
        ends = [self._last[name] for name in (table.CLOCK, table.MODEL_STATES) if name in self._last]
        end = min(ends) if ends else max(self._last.values(), default=0)
        for name, beat in self._beats.items():
            if self._on_beat[name].passed is None:
                continue
            count, expected = self._seen.get(name, 0), beat.count(end)
            self._counts.see(
                abs(count - expected) <= 1,
                f"{name}: {count:,} messages; {end / 1e9:.3f} s at {beat.rate_hz:g} Hz make {expected:,}",
            )
            number = self._number.get(name, 0)
            self._no_gap.see(number == expected, f"{name} ends with reading {number:,} of {expected:,}")
        for group, waiting in self._groups:
            for stamp, met in waiting.items():
                self._step.see(False, f"{stamp} ns: {_missing(group, met)}")

    def results(self) -> list[Check]:
        """Counts, stamps, in step."""
        # Where a topic follows another clock it cannot be said how many messages there should be, and when.
        judged = [name for name, law in self._on_beat.items() if law.passed is not None]
        rates = sorted({f"{self._beats[name].rate_hz:g}" for name in judged}, key=float)
        on_beat = sum(self._on_beat[name].seen for name in judged)
        parts = [f"{self._rising.obeyed:,} stamps rise"]
        parts += [f"{self._header.obeyed:,} headers agree"] * bool(self._header.obeyed)
        parts += [f"{on_beat:,} are on the beat of {', '.join(rates)} Hz"] * bool(rates)
        others = len(self._on_beat) - len(judged)
        parts += [f"{others} topics follow another clock"] * bool(others)
        laws = [self._rising, self._header, *(self._on_beat[name] for name in judged), self._no_gap]
        return [
            check_of(
                "counts",
                [self._counts] if judged else [],
                f"{len(self._seen)} topics, {sum(self._seen.values()):,} messages",
                "no topic keeps its rate",
            ),
            check_of("stamps", laws, ", ".join(parts), "no topic of the topic table is there"),
            check_of(
                "in step",
                [self._step],
                f"{self._step.obeyed:,} moments of {len(self._groups)} groups of topics",
                "no topics that belong together",
            ),
        ]

    def _follow(self, raw: RawMessage, beat: Beat) -> None:
        number, before = beat.number(raw.stamp_ns), self._number.get(raw.topic, 0)
        due = beat.stamp(number)
        if not self._on_beat[raw.topic].see(due == raw.stamp_ns, lambda: f"{place_of(raw)}, due at {due} ns"):
            return
        self._no_gap.see(number == before + 1, lambda: f"{place_of(raw)}: reading {number} after reading {before}")
        self._number[raw.topic] = number

    def _meet(self, group: tuple[str, ...], waiting: OrderedDict[int, int], raw: RawMessage) -> None:
        met = waiting.get(raw.stamp_ns, 0) | 1 << group.index(raw.topic)
        if met == (1 << len(group)) - 1:
            waiting.pop(raw.stamp_ns, None)
            self._step.see(True, "")
            return
        waiting[raw.stamp_ns] = met
        if len(waiting) > _OPEN:
            stamp, met = waiting.popitem(last=False)
            self._step.see(False, f"{stamp} ns: {_missing(group, met)}")


def _missing(group: tuple[str, ...], met: int) -> str:
    return f"no {', no '.join(name for k, name in enumerate(group) if not met >> k & 1)}"


def _header_stamps(name: str, message: Any) -> list[int]:
    """Stamps [ns] that a message itself bears."""
    if name in (table.TF, table.TF_STATIC):
        return [stamp_ns(each.header) for each in message.transforms]
    return [stamp_ns(message.header)] if hasattr(message, "header") else []
