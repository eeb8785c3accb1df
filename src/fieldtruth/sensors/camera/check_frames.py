# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Images of a camera with the same stamp."""

from collections import Counter, OrderedDict
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any, Final

from fieldtruth.bag.reader import RawMessage
from fieldtruth.experiment.sensor_families import Imager
from fieldtruth.validation.context import Checker, Context

PARTS: Final = ("photograph", "tag", "depth", "instances")
"""Streams of which a frame consists."""
WAITING: Final = 3
"""Frames of each view of which parts are awaited; each has some megabytes."""


@dataclass
class CameraFrame:
    """One view of a camera at one stamp: messages by part (``PARTS``)."""

    imager: Imager
    stamp_ns: int
    parts: dict[str, Any] = field(default_factory=dict)

    def at(self, part: str) -> str:
        """Topic and stamp of a part, for messages."""
        return f"{self.imager.topic_of(part)} at {self.stamp_ns} ns"


class CameraFrameChecker(Checker):
    """Collects parts and checks each frame when it is complete, or when its other parts are no longer awaited.

    ``infos`` holds the first CameraInfo of each view by its name.
    """

    def __init__(self, context: Context, parts: Collection[str]) -> None:
        self.context = context
        self.infos: dict[str, Any] = {}
        imagers = context.rig.imagers
        pairs = {imager.topic_of(part): (part, imager) for part in parts for imager in imagers}
        self._parts = {topic: pair for topic, pair in pairs.items() if topic in context.run.counts}
        self._due = Counter(imager.name for _, imager in self._parts.values())
        self._names = {imager.topic_of("camera_info"): imager.name for imager in imagers}
        self.topics = [*self._parts, *self._names]
        self._open: OrderedDict[tuple[str, int], CameraFrame] = OrderedDict()

    def check_frame(self, frame: CameraFrame) -> None:
        """Check a frame."""
        raise NotImplementedError

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        if raw.topic in self._names:
            self.infos.setdefault(self._names[raw.topic], message)
        if raw.topic not in self._parts:
            return
        part, imager = self._parts[raw.topic]
        key = (imager.name, raw.stamp_ns)
        frame = self._open.setdefault(key, CameraFrame(imager, raw.stamp_ns))
        frame.parts[part] = message
        if len(frame.parts) == self._due[imager.name]:
            self.check_frame(self._open.pop(key))
        elif len(self._open) > WAITING * len(self._due):
            self.check_frame(self._open.popitem(last=False)[1])

    def finish(self) -> None:
        """Finish the checks after the last message."""
        while self._open:
            self.check_frame(self._open.popitem(last=False)[1])
