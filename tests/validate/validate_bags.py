# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Copies of a run with something changed, and everything around made to fit again: the bag's index and checksums."""

import shutil
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.checksums import CHECKSUMS, checksum_lines
from fieldtruth.bag.reader import RawMessage, open_bag
from fieldtruth.bag.sensor_messages import POINT
from fieldtruth.bag.topics import topics_of
from fieldtruth.bag.writer import BagWriter
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment, load_experiment
from fieldtruth.validation import Check, validate

Change = Callable[[RawMessage, int], RawMessage | None]
"""Gets a message and its number in its topic, from 0; gives what stands in its place, None for nothing."""
Edit = Callable[[bytearray], object]

SMALL = (184, 320)
"""Rows and columns of the small run's images."""


def bag_in(folder: Path) -> Path:
    return next(folder.glob("*.bag"))


def sign(folder: Path) -> None:
    """Write the checksums of what is there now."""
    names = sorted(path.name for path in folder.iterdir() if path.name != CHECKSUMS)
    (folder / CHECKSUMS).write_text(checksum_lines(folder, names))


def rewritten(run: Path, target: Path, change: Change, experiment: Experiment | None = None) -> Path:
    """A copy of a run's folder in which ``change`` was made to every message; checksums are those of the new files.

    ``experiment`` takes the place of the run's own.
    """
    folder = target / run.name
    folder.mkdir(parents=True)
    for path in run.iterdir():
        if path.suffix != ".bag":
            shutil.copy(path, folder)
    if experiment is not None:
        (folder / "experiment.yaml").write_text(dump_experiment(experiment))
    rig = load_experiment(folder / "experiment.yaml").rig
    counts: dict[str, int] = {}
    changes = 0
    with open_bag(bag_in(run)) as source, BagWriter(folder / bag_in(run).name, topics_of(rig)) as bag:
        for raw in source.messages():
            k = counts[raw.topic] = counts.get(raw.topic, -1) + 1
            changed = change(raw, k)
            changes += changed != raw
            if changed is not None:
                bag.write(changed.topic, changed.stamp_ns, changed.data)
    assert changes, "nothing was changed"
    sign(folder)
    return folder


def only(topic: str, number: int, edit: Edit) -> Change:
    """Change the bytes of one message of a topic."""
    return each({(topic, number): edit})


def each(edits: dict[tuple[str, int], Edit]) -> Change:
    """Change the bytes of some messages, by topic and number."""

    def change(raw: RawMessage, k: int) -> RawMessage:
        if (raw.topic, k) not in edits:
            return raw
        data = bytearray(raw.data)
        edits[raw.topic, k](data)
        assert data != raw.data, "nothing was changed"
        return raw._replace(data=bytes(data))

    return change


def points_in(data: bytearray, kind: np.dtype[np.void] = POINT) -> NDArray[np.void]:
    """Points of a serialised cloud of this package, to be changed in place."""
    # The last field's name, offset, type and count; is_bigendian, point_step, row_step, and the length of the data.
    start = bytes(data).index(b"instance") + len(b"instance") + (4 + 1 + 4) + (1 + 4 + 4 + 4)
    count = struct.unpack_from("<L", data, start - 4)[0] // kind.itemsize
    return np.frombuffer(data, kind, count, start)


def pixels_in(data: bytearray, kind: str, channels: int = 1) -> NDArray[Any]:
    """Pixels (rows, columns, channels) of a serialised image of the small run, to be changed in place."""
    count = SMALL[0] * SMALL[1] * channels
    pixels = np.frombuffer(data, kind, count, len(data) - count * np.dtype(kind).itemsize)
    return pixels.reshape(*SMALL, channels)


def add(offset: int, amount: float) -> Edit:
    """Add to a number of double precision at an offset, from the end if below 0."""

    def edit(data: bytearray) -> None:
        at = offset % len(data)
        struct.pack_into("<d", data, at, struct.unpack_from("<d", data, at)[0] + amount)

    return edit


def first_message(run: Path, topic: str) -> RawMessage:
    with open_bag(bag_in(run)) as bag:
        return next(bag.messages([topic]))


def failures(checks: list[Check]) -> dict[str, str]:
    """What failed, by the check's name."""
    return {check.name: check.text for check in checks if check.passed is False}


def quick_failures(folder: Path) -> dict[str, str]:
    """What fails without a world."""
    return failures(validate(folder, quick=True))


CAMERA_TOPICS = [t.name for t in table.TOPICS if t.sensor in ("cameras", "depth", "instances")]
