# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The choice of stamps for costly checks."""


class Sampler:
    """Chooses about ``count`` stamps of each sensor, evenly over a run's time [ns]; calls must be in time order."""

    def __init__(self, start_ns: int, end_ns: int, count: int) -> None:
        self._start, self._period = start_ns, max(1, (end_ns - start_ns) // max(1, count))
        self._due: dict[tuple[str, ...], int] = {}
        self._chosen: dict[tuple[str, ...], set[int]] = {}

    def takes(self, stamp_ns: int, *sensors: str) -> bool:
        """Return whether a stamp of these sensors is chosen; repeated calls with a stamp give the same result."""
        chosen, due = self._chosen.setdefault(sensors, set()), self._due.get(sensors, self._start)
        if stamp_ns not in chosen and stamp_ns >= due:
            chosen.add(stamp_ns)
            self._due[sensors] = due + self._period * ((stamp_ns - due) // self._period + 1)
        return stamp_ns in chosen
