# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Copies of a run with changed messages, whose index and checksums fit again."""

import shutil
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import ros_types as ros
from numpy.typing import NDArray

from fieldtruth.bag import decode as read
from fieldtruth.bag import topics as table
from fieldtruth.bag.provenance import CHECKSUMS, checksum_lines
from fieldtruth.bag.reader import RawMessage, open_bag
from fieldtruth.bag.topics import topics_of
from fieldtruth.bag.writer import BagWriter
from fieldtruth.core.readings import Cloud
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment, load_experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.sensors.camera.sensor import instances
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensor import point_cloud
from fieldtruth.validation import Check
from fieldtruth.validation.runner import validate

Change = Callable[[RawMessage, int], RawMessage | list[RawMessage] | None]
"""Takes a message and its number in its topic, from 0; returns its replacement, several, or None to leave it out."""
Edit = Callable[[bytearray], object]
Edits = dict[tuple[str, int], Edit]
"""Edits by topic and number of the message."""

SMALL = (184, 320)
"""Rows and columns of the small run's images."""
IMU, GNSS, POINTS, WHEEL_ODOMETRY = "/imu/data", "/navsat/fix", "/os1_cloud_node/points", "/odometry/wheel"
"""Topics of the paper's rig."""
LEFT, RIGHT = Rig().imagers
CAMERA_TOPICS = [topic.name for topic in table.PAPER_TOPICS if topic.kind == "stereo"]


def bag_in(folder: Path) -> Path:
    return next(folder.glob("*.bag"))


def rewritten(run: Path, target: Path, change: Change, experiment: Experiment | None = None) -> Path:
    """Copy a run's folder with changed messages, or another experiment, and with new checksums."""
    folder = target / run.name
    folder.mkdir(parents=True)
    for path in run.iterdir():
        if path.suffix != ".bag":
            shutil.copy(path, folder)
    if experiment is not None:
        (folder / "experiment.yaml").write_text(dump_experiment(experiment))
    written = load_experiment(folder / "experiment.yaml")
    topics = topics_of(written.rig, latched=written.static_objects == "latched", actors=bool(written.actors))
    counts: dict[str, int] = {}
    changes = 0
    with open_bag(bag_in(run)) as source, BagWriter(folder / bag_in(run).name, topics) as bag:
        for raw in source.messages():
            k = counts[raw.topic] = counts.get(raw.topic, -1) + 1
            changed = change(raw, k)
            changes += changed != raw
            for each in changed if isinstance(changed, list) else [changed]:
                if each is not None:
                    bag.write(each.topic, each.stamp_ns, each.data)
    assert changes, "nothing was changed"
    names = sorted(path.name for path in folder.iterdir() if path.name != CHECKSUMS)
    (folder / CHECKSUMS).write_text(checksum_lines(folder, names))
    return folder


def in_latched_form(run: Path, target: Path, until_ns: int | None = None) -> Path:
    """Copy a run, or its beginning, as if its static objects had been published once."""

    def change(raw: RawMessage, k: int) -> RawMessage | list[RawMessage] | None:
        if until_ns is not None and raw.stamp_ns > until_ns:
            return None
        if raw.topic != table.MODEL_STATES:
            return raw
        states: Any = ros.STORE.deserialize_ros1(raw.data, raw.msgtype)
        first_two = ros.ModelStates(states.name[:2], states.pose[:2], states.twist[:2])
        moving = raw._replace(data=ros.serialize(first_two, raw.msgtype))
        return [raw._replace(topic=table.STATIC_MODEL_STATES), moving] if k == 0 else moving

    latched = load_experiment(run / "experiment.yaml").model_copy(update={"static_objects": "latched"})
    return rewritten(run, target, change, latched)


FILLERS = 70_000
"""Objects that ``with_wide_ids`` adds before those of the run."""


def wide(ids: NDArray[Any]) -> NDArray[np.uint32]:
    """Ids in ``with_wide_ids``: those of robot and ground stay, others are above 70,000."""
    return np.where(ids >= 2, ids.astype(np.uint32) + FILLERS, ids).astype(np.uint32)


def with_wide_ids(run: Path, target: Path, until_ns: int) -> Path:
    """Copy the beginning of a run as if 70,000 other objects, which no sensor sees, were in its world."""

    def change(raw: RawMessage, k: int) -> RawMessage | list[RawMessage] | None:
        if raw.stamp_ns > until_ns:
            return None
        message: Any = ros.STORE.deserialize_ros1(raw.data, raw.msgtype) if raw.topic in changed else None
        if raw.topic == table.MODEL_STATES:
            names = [*message.name[:2], *(f"filler_{n}" for n in range(FILLERS)), *message.name[2:]]
            pose, twist = ([part[0], *[part[1]] * (FILLERS + 1), *part[2:]] for part in (message.pose, message.twist))
            first_two = ros.ModelStates(names[:2], pose[:2], twist[:2])
            moving = raw._replace(data=ros.serialize(first_two, raw.msgtype))
            if k:
                return moving
            whole = ros.serialize(ros.ModelStates(names, pose, twist), raw.msgtype)
            return [raw._replace(topic=table.STATIC_MODEL_STATES, data=whole), moving]
        if raw.topic == POINTS:
            points = read.points(message)
            stamp = read.stamp_ns(message.header)
            scan = Cloud(
                stamp_ns=stamp,
                header_ns=stamp,
                xyz=np.stack([points[axis] for axis in "xyz"], axis=-1),
                instance=wide(points["instance"]),
                label=points["label"],
                ring=points["ring"],
                column=points["column"],
            )
            data = point_cloud(message.header.seq, stamp, scan, LidarConfig(), wide_ids=True)
            return raw._replace(data=data)
        if raw.topic in changed:
            head, ids = message.header, wide(read.instances(message))
            data = instances(head.seq, read.stamp_ns(head), head.frame_id, ids, wide_ids=True)
            return raw._replace(data=data)
        return raw

    changed = {table.MODEL_STATES, POINTS, LEFT.topic_of("instances"), RIGHT.topic_of("instances")}
    whole = load_experiment(run / "experiment.yaml")
    seconds = {"static_objects": "latched", "seconds": until_ns / 1e9}
    return rewritten(run, target, change, whole.model_copy(update=seconds))


def messages_in(run: Path) -> dict[str, list[tuple[int, bytes]]]:
    """Stamp in the bag [ns] and bytes of each message, by topic."""
    found: dict[str, list[tuple[int, bytes]]] = {}
    with open_bag(bag_in(run)) as bag:
        for raw in bag.messages():
            found.setdefault(raw.topic, []).append((raw.stamp_ns, raw.data))
    return found


def clouds_in(run: Path) -> list[NDArray[np.void]]:
    return [read.points(each.message) for each in read.read_bag(bag_in(run), [POINTS])]


def checks_of(run: Path, target: Path, topic: str, change: Callable[[Any], bytes]) -> dict[str, Check]:
    """Checks, by name, of a run of which the first message of a topic is changed."""

    def of_message(raw: RawMessage, k: int) -> RawMessage:
        if raw.topic != topic or k:
            return raw
        return raw._replace(data=change(ros.STORE.deserialize_ros1(raw.data, raw.msgtype)))

    return {check.name: check for check in validate(rewritten(run, target, of_message), samples=3)}


def edited(edits: Edits) -> Callable[[RawMessage, int], RawMessage]:
    """Edit the bytes of some messages."""

    def change(raw: RawMessage, k: int) -> RawMessage:
        if (raw.topic, k) not in edits:
            return raw
        data = bytearray(raw.data)
        edits[raw.topic, k](data)
        assert data != raw.data, "nothing was changed"
        return raw._replace(data=bytes(data))

    return change


def failures_of(run: Path, target: Path, change: Change | Edits) -> dict[str, str]:
    """Text of the failed checks of a changed run, by name, without the world."""
    change = edited(change) if isinstance(change, dict) else change
    return failures(validate(rewritten(run, target, change), quick=True))


def failures(checks: list[Check]) -> dict[str, str]:
    """Text of the failed checks, by name."""
    return {check.name: check.text for check in checks if check.passed is False}


def first_message(run: Path, topic: str) -> RawMessage:
    with open_bag(bag_in(run)) as bag:
        return next(bag.messages([topic]))


def points_in(data: bytearray) -> NDArray[np.void]:
    """Points of a serialised cloud, to be changed in place."""
    cloud = ros.STORE.deserialize_ros1(bytes(data), "sensor_msgs/msg/PointCloud2")
    points = read.points(cloud)
    return np.frombuffer(data, points.dtype, len(points), len(data) - 1 - points.nbytes)


def pixels_in(data: bytearray, kind: str, channels: int = 1, size: tuple[int, int] = SMALL) -> NDArray[Any]:
    """Pixels (rows, columns, channels) of a serialised image, by default of the small run, to be changed in place."""
    count = size[0] * size[1] * channels
    pixels = np.frombuffer(data, kind, count, len(data) - count * np.dtype(kind).itemsize)
    return pixels.reshape(*size, channels)


def add(offset: int, amount: float) -> Edit:
    """Add to a double at an offset, from the end if below 0."""

    def edit(data: bytearray) -> None:
        at = offset % len(data)
        struct.pack_into("<d", data, at, struct.unpack_from("<d", data, at)[0] + amount)

    return edit
