# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Photograph, classes and objects of one instant of a camera, gathered from a bag as it is read through."""

import struct
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import BagError, BagReader, RawMessage
from fieldtruth.bag.run import Run

_MOST_WAITING: Final = 100
"""Stamps of a camera at which something is still to come; cameras that publish in step need one."""


class Frame(NamedTuple):
    """Messages of one camera with the same stamp [ns] in their headers."""

    side: str
    stamp_ns: int
    photo: RawMessage
    tag: RawMessage
    instances: RawMessage


def sides_of(run: Run) -> list[str]:
    """Cameras that took photographs.

    Raises:
        BagError: there is none, or one of them has no classes or no objects; says how to make those.
    """
    sides = [side for side in table.SIDES if table.photograph(side) in run.counts]
    run.require(*map(table.photograph, sides or table.SIDES), *map(table.tag, sides or table.SIDES))
    missing = [topic for topic in map(table.instances, sides) if topic not in run.counts]
    if missing:
        name = "NAME" if run.experiment is None else run.experiment.name
        made = f"`fieldtruth generate {name} --extras instances` makes a bag that has them"
        raise BagError(f"{run.bag} has no {', '.join(missing)}, which hold the object of each pixel; {made}")
    return sides


def frames_of(bag: BagReader, sides: Sequence[str]) -> Iterator[Frame]:
    """Frames that are complete, in the order in which they become so; what lacks a part is left out.

    Raises:
        BagError: the bag is damaged, or a camera's stamps do not rise or never agree.
    """
    kinds = [table.photograph, table.tag, table.instances]
    place = {kind(side): (side, i) for side in sides for i, kind in enumerate(kinds)}
    waiting: dict[str, dict[int, dict[int, RawMessage]]] = {side: {} for side in sides}
    newest = dict.fromkeys(sides, -1)
    for raw in bag.messages([*place]):
        side, kind = place[raw.topic]
        stamp = _header_stamp_ns(bag, raw)
        if stamp <= newest[side]:
            raise BagError(f"{bag.path}: stamps of {raw.topic} do not rise: {stamp} ns comes after {newest[side]} ns")
        parts = waiting[side].setdefault(stamp, {})
        parts[kind] = raw
        if len(parts) == len(kinds):
            yield Frame(side, stamp, parts[0], parts[1], parts[2])
            newest[side] = stamp
            waiting[side] = {later: rest for later, rest in waiting[side].items() if later > stamp}
        elif len(waiting[side]) > _MOST_WAITING:
            topics = ", ".join(kind(side) for kind in kinds)
            raise BagError(f"{bag.path}: {topics} have no stamps in common, so no label belongs to a photograph")


def _header_stamp_ns(bag: BagReader, raw: RawMessage) -> int:
    """Stamp [ns] in the header, with which these messages begin, behind its ``seq``."""
    if len(raw.data) < 12:
        raise BagError(f"cannot read {bag.path}: the message of {raw.topic} at {raw.stamp_ns} ns is damaged")
    seconds, nanoseconds = struct.unpack_from("<LL", raw.data, 4)
    return int(seconds) * 10**9 + int(nanoseconds)
