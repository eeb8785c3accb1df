# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Puts together what a camera published of one moment: photograph, tags, depth, object ids."""

from collections import OrderedDict
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Any, Final

from fieldtruth.bag import topics as table

WAITING: Final = 6
"""Moments of which parts are waited for; each is some megabytes."""


@dataclass
class Moment:
    """One camera at one stamp: messages by part (``tag``, ``depth``, ``instances``, ``photograph``)."""

    side: str
    stamp_ns: int
    parts: dict[str, Any] = field(default_factory=dict)

    def place(self, part: str) -> str:
        """Where a part is, in words."""
        return f"{_NAMES[part](self.side)} at {self.stamp_ns} ns"


_NAMES: Final[dict[str, Callable[[str], str]]] = {
    "photograph": table.photograph,
    "tag": table.tag,
    "depth": table.depth,
    "instances": table.instances,
}


class Bundler:
    """Collects parts and hands over each moment when it is whole, or when it is not waited for any longer."""

    def __init__(self, parts: Collection[str], present: Collection[str], done: Callable[[Moment], None]) -> None:
        self._done = done
        self._part = {
            _NAMES[part](side): (part, side) for part in parts for side in table.SIDES if _NAMES[part](side) in present
        }
        self._due = {side: sum(s == side for _, s in self._part.values()) for side in table.SIDES}
        self._open: OrderedDict[tuple[str, int], Moment] = OrderedDict()

    @property
    def topics(self) -> list[str]:
        """Topics of the parts that there are."""
        return list(self._part)

    def add(self, topic: str, stamp_ns: int, message: Any) -> None:
        """Add a part."""
        part, side = self._part[topic]
        key = (side, stamp_ns)
        moment = self._open.setdefault(key, Moment(side, stamp_ns))
        moment.parts[part] = message
        if len(moment.parts) == self._due[side]:
            self._done(self._open.pop(key))
        elif len(self._open) > WAITING:
            self._done(self._open.popitem(last=False)[1])

    def finish(self) -> None:
        """Hand over what is left."""
        while self._open:
            self._done(self._open.popitem(last=False)[1])
