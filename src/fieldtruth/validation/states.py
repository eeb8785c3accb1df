# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The truth at 1 kHz: /clock, and /gazebo/model_states, where the robot moves by the laws of motion and nothing else.

The physics steps velocity first and then the pose with the new velocity (semi-implicit Euler), so from one message to
the next the robot moves by exactly ``v dt`` and turns by exactly ``w dt``. What is left is rounding: 1e-14 m. The bound
of 1e-9 leaves room for other mathematics libraries, and finds a pose that is off by a micrometre.
"""

import struct
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fieldtruth.bag import topics as table
from fieldtruth.bag.model_states import ROBOT, ModelStatesReader
from fieldtruth.bag.reader import RawMessage
from fieldtruth.validation.check import Check
from fieldtruth.validation.law import check_of
from fieldtruth.validation.subject import STEP_NS, Examiner, Subject, place_of

F8 = NDArray[np.float64]

MOTION_BOUND: Final = 1e-9
"""[m] and [rad] between two messages of 1 kHz."""
JUMP_BOUND: Final = 0.05
"""[m] off velocity times time, whatever the stamps' jitter: 10 ms at several metres a second."""
JUMP_NS: Final = 100_000_000
"""[ns] between messages beyond which nothing is said of jumps."""
UNIT_BOUND: Final = 1e-9
"""Of a quaternion's length from 1; rounding makes 1e-15."""
_BLOCK: Final = 500
_POSE, _TWIST = 56, 48  # [byte] of one object


class Clock(Examiner):
    """/clock tells the time at which it is published."""

    topics = (table.CLOCK,)

    def __init__(self, subject: Subject) -> None:
        self._law = subject.law("/clock tells its own stamp")

    def feed(self, raw: RawMessage, message: Any) -> None:
        """See a message."""
        if len(raw.data) != 8:
            self._law.see(False, f"{place_of(raw)} is {len(raw.data)} bytes long instead of 8")
            return
        seconds, nanoseconds = struct.unpack("<LL", raw.data)
        told = seconds * 10**9 + nanoseconds
        self._law.see(told == raw.stamp_ns, lambda: f"{place_of(raw)}: {told} ns")

    def results(self) -> list[Check]:
        """Clock."""
        return [check_of("clock", [self._law], f"{self._law.seen:,} messages tell their own stamp", "no /clock")]


class States(Examiner):
    """What /gazebo/model_states says of all objects but the robot, and of the robot's motion."""

    topics = (table.MODEL_STATES,)

    def __init__(self, subject: Subject) -> None:
        self._subject = subject
        self._reader = ModelStatesReader()
        self._first: tuple[bytes, bytes, bytes] | None = None
        self._still = subject.law("nothing but the robot moves, and names stay")
        self._unique = subject.law("names are unique")
        self._unit = subject.law("attitudes are unit quaternions", UNIT_BOUND, "from length 1", minor=True)
        self._jumps = subject.law("the robot does not jump", JUMP_BOUND, "m")
        self._moves = subject.law("the robot moves by its velocity times the step", MOTION_BOUND, "m")
        self._turns = subject.law("the robot turns by its turn rate times the step", MOTION_BOUND, "rad")
        self._stamps: list[int] = []
        self._rows: list[F8] = []
        self._way = 0.0
        self._judged = 0  # rows at the front that an earlier block has judged

    def feed(self, raw: RawMessage, message: Any) -> None:
        """See a message."""
        data = raw.data
        poses, twists = self._reader.poses(data), self._reader.twists(data)
        names = self._reader.names
        if not self._subject.names:
            self._subject.names = names
            twice = sorted({name for name in names if names.count(name) > 1})
            self._unique.see(not twice, f"{place_of(raw)}: {', '.join(twice)}")
        if ROBOT not in names:
            return
        row = names.index(ROBOT)
        pose_at = len(data) - 104 * len(names) - 4 + _POSE * row
        twist_at = len(data) - _TWIST * (len(names) - row)
        parts = data[:pose_at], data[pose_at + _POSE : twist_at], data[twist_at + _TWIST :]
        if self._first is None:
            self._first = parts
        self._still.see(parts == self._first, lambda: f"{place_of(raw)}: {self._moved(parts, pose_at)}")
        state = np.concatenate([poses[row, [0, 1, 2, 6, 3, 4, 5]], twists[row]])
        self._subject.motion.add(raw.stamp_ns, state)
        self._stamps.append(raw.stamp_ns)
        self._rows.append(state)
        if len(self._rows) > _BLOCK:
            self._judge()

    def finish(self) -> None:
        """See the end of the bag."""
        self._judge()

    def results(self) -> list[Check]:
        """Objects, motion."""
        nothing = f"no {table.MODEL_STATES} with a model {ROBOT!r}"
        objects = len(self._subject.names)
        return [
            check_of("still objects", [self._still, self._unique],
                     f"{objects - 1} objects stay what and where they are in {self._still.seen:,} messages", nothing),
            check_of("motion", [self._jumps, self._moves, self._turns, self._unit], self._figures, nothing),
        ]  # fmt: skip

    def _figures(self) -> str:
        if not self._moves.obeyed:
            return f"{self._way:.2f} m without a jump"
        margins = f"{self._moves.margin}, {self._turns.margin}"
        return f"{self._way:.2f} m; largest departure from velocity times time {margins}"

    def _judge(self) -> None:
        """Hold the rows that were gathered against the laws of motion; the last one begins the next block."""
        if len(self._rows) < 2:
            return
        stamps, rows = np.array(self._stamps), np.array(self._rows)
        following = np.flatnonzero(np.diff(stamps) == STEP_NS) + 1  # gaps are another check's
        fresh = self._judged
        self._unit.measure_all(np.linalg.norm(rows[fresh:, 3:7], axis=1) - 1.0, lambda k: _at(stamps[fresh + k]))
        spans = np.diff(stamps)[:, None] / 1e9
        away = np.linalg.norm(np.diff(rows[:, :3], axis=0) - spans * rows[1:, 7:10], axis=1)
        near = np.flatnonzero(np.diff(stamps) < JUMP_NS)
        self._jumps.measure_all(away[near], lambda k: f"after {_at(stamps[near[k]])}")
        moved, turned = _departures(rows, following)
        self._moves.measure_all(moved, lambda k: _at(stamps[following[k]]))
        self._turns.measure_all(turned, lambda k: _at(stamps[following[k]]))
        self._way += float(np.linalg.norm(rows[-1, :3] - rows[0, :3]))
        del self._stamps[:-1], self._rows[:-1]
        self._judged = 1

    def _moved(self, parts: tuple[bytes, bytes, bytes], pose_at: int) -> str:
        """Name what differs from the first message."""
        assert self._first is not None
        names = self._reader.names
        if len(parts[0]) != len(self._first[0]) or len(parts[1]) != len(self._first[1]):
            return "other names than in the first message"
        before, now = b"".join(self._first), b"".join(parts)
        at = next(k for k, (a, b) in enumerate(zip(before, now, strict=False)) if a != b)
        at += _POSE * (at >= pose_at) + _TWIST * (at >= pose_at + len(parts[1]))
        into = at - (len(now) + _POSE + _TWIST - 104 * len(names) - 4)
        if into < 0:
            return "other names than in the first message"
        row, what = (into // _POSE, "pose") if into < _POSE * len(names) else (
            (into - _POSE * len(names) - 4) // _TWIST, "twist")  # fmt: skip
        return f"the {what} of {names[row]!r} is another than in the first message"


def _departures(rows: F8, following: NDArray[np.intp]) -> tuple[F8, F8]:
    """Distance [m] and angle [rad] between each of some rows and where the one before leads with its velocity."""
    step = STEP_NS / 1e9
    before, after = rows[following - 1], rows[following]
    moved = np.linalg.norm(after[:, :3] - before[:, :3] - step * after[:, 7:10], axis=1)
    if not len(following):
        return moved, moved
    lengths = np.linalg.norm(rows[:, 3:7], axis=1)
    if not (np.isfinite(rows).all() and lengths.min() > 0.0):
        return moved, np.full(len(following), np.nan)
    turn = Rotation.from_quat(after[:, [4, 5, 6, 3]]) * Rotation.from_quat(before[:, [4, 5, 6, 3]]).inv()
    turned: F8 = np.linalg.norm(turn.as_rotvec() - step * after[:, 10:], axis=1)
    return moved, turned


def _at(stamp_ns: int) -> str:
    return f"{table.MODEL_STATES} at {stamp_ns} ns"
