# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Images of a camera with the same stamp, and the choice of stamps for costly checks."""

from collections import OrderedDict
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Any, Final

from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import RawMessage
from fieldtruth.validation.context import Checker, Context

TOPIC_OF: Final[dict[str, Callable[[str], str]]] = {
    "photograph": table.photograph,
    "tag": table.tag,
    "depth": table.depth,
    "instances": table.instances,
}
"""Topic of each part of a frame, by side."""
WAITING: Final = 6
"""Frames of which parts are awaited; each has some megabytes."""


@dataclass
class CameraFrame:
    """One camera at one stamp: messages by part (``tag``, ``depth``, ``instances``, ``photograph``)."""

    side: str
    stamp_ns: int
    parts: dict[str, Any] = field(default_factory=dict)

    def at(self, part: str) -> str:
        """Topic and stamp of a part, for messages."""
        return f"{TOPIC_OF[part](self.side)} at {self.stamp_ns} ns"


class CameraFrameChecker(Checker):
    """Collects parts and checks each frame when it is complete, or when its other parts are no longer awaited.

    ``infos`` holds the first CameraInfo of each camera.
    """

    def __init__(self, context: Context, parts: Collection[str]) -> None:
        self.context = context
        self.infos: dict[str, Any] = {}
        pairs = {TOPIC_OF[part](side): (part, side) for part in parts for side in table.SIDES}
        self._parts = {topic: pair for topic, pair in pairs.items() if topic in context.run.counts}
        self._sides = {table.camera_info(side): side for side in table.SIDES}
        self.topics = [*self._parts, *self._sides]
        self._open: OrderedDict[tuple[str, int], CameraFrame] = OrderedDict()

    def check_frame(self, frame: CameraFrame) -> None:
        """Check a frame."""
        raise NotImplementedError

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        if raw.topic in self._sides:
            self.infos.setdefault(self._sides[raw.topic], message)
        if raw.topic not in self._parts:
            return
        part, side = self._parts[raw.topic]
        key = (side, raw.stamp_ns)
        frame = self._open.setdefault(key, CameraFrame(side, raw.stamp_ns))
        frame.parts[part] = message
        if len(frame.parts) == sum(other == side for _, other in self._parts.values()):
            self.check_frame(self._open.pop(key))
        elif len(self._open) > WAITING:
            self.check_frame(self._open.popitem(last=False)[1])

    def finish(self) -> None:
        """Finish the checks after the last message."""
        while self._open:
            self.check_frame(self._open.popitem(last=False)[1])


class Sampler:
    """Chooses about ``count`` of the stamps, evenly over a run's time [ns]; calls must be in time order."""

    def __init__(self, start_ns: int, end_ns: int, count: int) -> None:
        self._period = max(1, (end_ns - start_ns) // max(1, count))
        self._due = start_ns
        self._chosen: set[int] = set()

    def takes(self, stamp_ns: int) -> bool:
        """Return whether a stamp is chosen; repeated calls with a stamp give the same result."""
        if stamp_ns not in self._chosen and stamp_ns >= self._due:
            self._chosen.add(stamp_ns)
            self._due += self._period * ((stamp_ns - self._due) // self._period + 1)
        return stamp_ns in self._chosen
