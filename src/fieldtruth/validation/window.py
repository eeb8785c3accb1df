# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The last seconds of the robot's true motion, with which readings are compared."""

import heapq
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.drive.track import Motion, State, state_at

KEPT: Final = 4096
"""Rows that are kept at least: four seconds at 1 kHz."""


def is_attitude(quaternion: Array) -> bool:
    """Whether four numbers can be normalised to a unit quaternion."""
    return bool(0.5 < np.linalg.norm(quaternion) < 2.0)


class MotionWindow:
    """True motion, to which rows are added in time order."""

    def __init__(self) -> None:
        self._stamps: NDArray[np.int64] = np.zeros(2 * KEPT, np.int64)
        self._rows = np.zeros((2 * KEPT, 13))
        self._count = 0
        self._waiting: list[tuple[int, int, Callable[[], None]]] = []
        self._asked = 0
        self._over = False

    @property
    def started(self) -> bool:
        """Whether there is any motion."""
        return self._count > 0

    def add(self, stamp_ns: int, row: Array) -> None:
        """Add a row: position (3) [m], quaternion wxyz (4), linear (3) [m/s] and angular velocity (3) [rad/s].

        All of base_link in the world frame. A row that is not later than the one before, or without an attitude, is
        left out; the check of its own stream reports it.
        """
        if (self._count and stamp_ns <= self._stamps[self._count - 1]) or not is_attitude(row[3:7]):
            return
        if self._count == len(self._stamps):
            self._stamps[:KEPT], self._rows[:KEPT] = self._stamps[KEPT:].copy(), self._rows[KEPT:].copy()
            self._count = KEPT
        self._stamps[self._count], self._rows[self._count] = stamp_ns, row
        self._count += 1
        self._run_waiting(stamp_ns)

    def finish(self) -> None:
        """Declare that no more rows will come."""
        self._over = True
        if self.started:
            self._run_waiting(None)

    def when_known(self, stamp_ns: int, action: Callable[[], None]) -> None:
        """Call ``action`` once the motion is known up to a stamp [ns], or is over; never if there is no motion."""
        if self.started and (self._over or stamp_ns <= self._stamps[self._count - 1]):
            action()
        elif not self._over:
            self._asked += 1
            heapq.heappush(self._waiting, (stamp_ns, self._asked, action))

    def state(self, stamp_ns: int) -> State:
        """State at a stamp [ns], interpolated between rows. It is only valid until the next row is added."""
        return state_at(self.motion, stamp_ns)

    def row(self, stamp_ns: int) -> int | None:
        """Index of the row with exactly this stamp, counted from the oldest that is kept."""
        k = int(np.searchsorted(self._stamps[: self._count], stamp_ns))
        return k if k < self._count and self._stamps[k] == stamp_ns else None

    @property
    def motion(self) -> Motion:
        """The rows that are kept; only valid until the next row is added."""
        rows = self._rows[: self._count]
        return Motion(
            stamps_ns=self._stamps[: self._count],
            position=rows[:, :3],
            quaternion_wxyz=rows[:, 3:7],
            linear_velocity=rows[:, 7:10],
            angular_velocity=rows[:, 10:],
        )

    def _run_waiting(self, stamp_ns: int | None) -> None:
        while self._waiting and (stamp_ns is None or self._waiting[0][0] <= stamp_ns):
            heapq.heappop(self._waiting)[2]()
