# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Chooses the moments of a run at which costly checks are made: evenly over its time."""


class Sampler:
    """Chooses about ``count`` of the stamps that are offered, in time order, over a run's time [ns]."""

    def __init__(self, start_ns: int, end_ns: int, count: int) -> None:
        self._period = max(1, (end_ns - start_ns) // max(1, count))
        self._due = start_ns
        self._chosen: set[int] = set()

    def takes(self, stamp_ns: int) -> bool:
        """Tell whether a stamp is chosen; it stays so when it is offered again."""
        if stamp_ns in self._chosen:
            return True
        if stamp_ns < self._due:
            return False
        self._chosen.add(stamp_ns)
        self._due += self._period * ((stamp_ns - self._due) // self._period + 1)
        return True
