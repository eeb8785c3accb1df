# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""How long each stage of a run takes."""

from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic
from typing import Final

from fieldtruth.core.progress import Advance, Progress, Silent

WORLD: Final = "build the world"
DRIVE: Final = "drive"
CACHED: Final = (WORLD, "prepare the scene", "wait for workers", "world and drive")
"""Stages of the world and its light, which later runs find in the cache; the last two are those on a cluster."""


class Stages:
    """Progress that keeps the time [s] of each stage, and which of them, other than the drive, count simulated time."""

    def __init__(self, shown: Progress | None = None) -> None:
        self.took_s: dict[str, float] = {}
        self.timed: set[str] = set()
        self._shown = Silent() if shown is None else shown

    @contextmanager
    def stage(self, name: str, total: float | None = None, done: float = 0.0) -> Iterator[Advance]:
        """Enter a stage, and show it."""
        start = monotonic()
        if total is not None and name != DRIVE:
            self.timed.add(name)
        with self._shown.stage(name, total, done) as advance:
            yield advance
        self.took_s[name] = self.took_s.get(name, 0.0) + monotonic() - start
