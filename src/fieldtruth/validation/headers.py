# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The topics with their types, and what headers say beside the stamp: numbers that count up, frames that exist."""

from typing import Any, Final

from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import RawMessage
from fieldtruth.bag.robot_messages import BASE, WORLD
from fieldtruth.bag.sensor_messages import optical_frame
from fieldtruth.validation.check import Check
from fieldtruth.validation.law import check_of
from fieldtruth.validation.subject import Examiner, Subject, place_of

_FRAMES: Final = {
    table.ODOMETRY: WORLD,
    table.TF: WORLD,
    table.IMU: "imu_link",
    table.NAVSAT: "GNSS_link",
    table.POINTS: "os1_lidar",
}


def topics_check(subject: Subject, digests: dict[str, tuple[str, str]]) -> Check:
    """Which topics there are, and their types.

    Args:
        subject: the run.
        digests: by topic, the MD5 sum of its type as the bag states it and as it follows from the definition there.
    """
    run, rig = subject.run, subject.rig
    types, exist, digest = (
        subject.law("every topic that the sensors publish is there"),
        subject.law("topics have the types of the topic table"),
        subject.law("the MD5 sum of a type is that of its definition"),
    )
    if subject.binding:  # a run that is shorter than a sensor's period has none of it
        due = [t for t in table.topics_of(rig) if t.rate_hz is None or t.rate_hz(rig) * run.end_ns >= 1e9 - 1.0]
    else:
        due = [t for t in table.TOPICS if t.name in run.counts]
    for topic in due:
        types.see(topic.name in run.counts, f"{topic.name} is missing")
        if topic.name in run.counts:
            theirs = run.msgtypes[topic.name]
            exist.see(theirs == topic.msgtype, f"{topic.name} is {theirs}, not {topic.msgtype}")
    for name, (told, real) in digests.items():
        digest.see(told == real, f"{name} says {told}, its definition makes {real}")
    others = sorted(set(run.counts) - {topic.name for topic in table.TOPICS})
    more = f"; {len(others)} more that are not looked at: {', '.join(others[:5])}" if others else ""
    return check_of(
        "topics",
        [types, exist, digest] if due else [],
        f"{len(due)} topics with their types{more}",
        f"none of the topic table's{more}",
    )


class Headers(Examiner):
    """Sequence numbers and frames."""

    def __init__(self, subject: Subject) -> None:
        self.topics = [topic.name for topic in table.TOPICS if topic.name in subject.run.counts]
        self._subject = subject
        self._count = subject.law("headers count the messages of their topic from 0 up")
        self._frame = subject.law("headers name the frame of their sensor")
        self._known = subject.law("frames in headers are known in /tf_static and /tf")
        self._numbers: dict[str, int] = {}
        self._named: dict[str, str] = {}
        self._frames: set[str] = set()

    def feed(self, raw: RawMessage, message: Any) -> None:
        """See a message."""
        transforms = getattr(message, "transforms", None)
        if transforms is not None:
            self._frames |= {frame for each in transforms for frame in (each.header.frame_id, each.child_frame_id)}
        if raw.topic == table.TF:
            for each in transforms or ():
                self._see_child(raw, each.child_frame_id)
                self._see(raw, each.header)
        elif hasattr(message, "header"):
            if raw.topic == table.ODOMETRY:
                self._see_child(raw, message.child_frame_id)
            self._see(raw, message.header)

    def results(self) -> list[Check]:
        """Headers, frames."""
        if self._frames:
            for frame, where in self._named.items():
                self._known.see(frame in self._frames, f"{where}: {frame!r}")
        return [
            check_of(
                "headers",
                [self._count, self._frame],
                f"{self._count.obeyed:,} headers count up and name {len(self._named)} frames",
                "no message has a header",
            ),
            check_of(
                "frames",
                [self._known],
                f"{len(self._named)} frames of headers are among the {len(self._frames)} of /tf_static and /tf",
                "there is neither /tf_static nor /tf",
            ),
        ]

    def _see(self, raw: RawMessage, header: Any) -> None:
        number = self._numbers.get(raw.topic, 0)
        self._count.see(header.seq == number, lambda: f"{place_of(raw)}: {header.seq} instead of {number}")
        self._numbers[raw.topic] = header.seq + 1
        frame, due = header.frame_id, _frame_of(raw.topic)
        self._frame.see(frame == due, lambda: f"{place_of(raw)}: {frame!r} instead of {due!r}")
        if frame not in self._named:
            self._named[frame] = place_of(raw)

    def _see_child(self, raw: RawMessage, child: str) -> None:
        self._frame.see(child == BASE, lambda: f"{place_of(raw)}: child {child!r} instead of {BASE!r}")


def _frame_of(topic: str) -> str:
    return _FRAMES.get(topic) or optical_frame("left" if "/left/" in topic else "right")
