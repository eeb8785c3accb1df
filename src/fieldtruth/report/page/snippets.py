# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""How to load a run: commands and short programs that can be copied as they stand."""

import shlex
from typing import Final, NamedTuple

from fieldtruth.bag import topics as table
from fieldtruth.bag.checksums import CHECKSUMS
from fieldtruth.bag.run import Run

FORMATS: Final = {
    "files": "PNG, CSV, text files and class shares, as the paper publishes them",
    "zip": "the bag, compressed without loss, with its SHA-256",
    "semantickitti": "clouds with labels, poses, calibration",
    "kitti": "KITTI odometry: images, clouds, poses, calibration",
    "tum": "the true trajectory as a text file",
    "mcap": "ROS 2 messages (CDR), for ROS 2 and Foxglove",
    "coco": "COCO panoptic and detection JSON with images",
    "pcd": "a PCD file per cloud with labels and colours",
}
"""Export formats and what they contain. Exporters are a higher layer; a test compares the names with theirs."""


class Snippet(NamedTuple):
    """A few lines of code, for whom they are, and in which language."""

    title: str
    language: str
    code: str


def export_commands(run: Run) -> list[tuple[str, str, str]]:
    """Format, what it is, and the command that makes it."""
    bag = shlex.quote(run.bag.name)
    return [(name, content, f"fieldtruth export {bag} --to {name}") for name, content in FORMATS.items()]


def snippets(run: Run) -> list[Snippet]:
    """Programs and commands, all to be run in the bag's folder."""
    bag, path = shlex.quote(run.bag.name), ascii(run.bag.name)
    found = [
        Snippet("This package", "Python", _package(run, path)),
        Snippet("rosbags, without ROS", "Python", _ROSBAGS.format(path=path)),
    ]
    if table.POINTS in run.counts and table.photograph("left") in run.counts:
        found.append(Snippet("PyTorch", "Python", _PYTORCH.format(path=path)))
    if table.ODOMETRY in run.counts:
        found.append(Snippet("evo", "shell", f"evo_traj bag {bag} {table.ODOMETRY} --plot"))
    found += [
        Snippet("ROS 1", "shell", f"rosbag info {bag}\nrosbag play --clock {bag}"),
        Snippet("Check it", "shell", _SUMS * (run.folder / CHECKSUMS).is_file() + f"fieldtruth validate {bag}"),
        Snippet("See it", "shell", f"fieldtruth view {bag}"),
    ]
    if run.experiment is not None:
        found.append(Snippet("Make it again", "shell", "fieldtruth generate experiment.yaml --out again"))
    return found


_SUMS = f"sha256sum -c {CHECKSUMS}\n"


def _package(run: Run, path: str) -> str:
    """Read the sensor with most to tell."""
    readers = {table.POINTS: "points", table.tag("left"): "image"}
    topic = next((topic for topic in readers if topic in run.counts), min(run.counts))
    reader = readers.get(topic)
    return _PACKAGE.format(
        names=f"{reader}, read_bag" if reader else "read_bag",
        path=path,
        topic=ascii(topic),
        use=f"{reader}(reading.message)" if reader else "reading.message",
    )


_PACKAGE = """\
from pathlib import Path
from fieldtruth.bag import {names}

bag = Path({path})
for reading in read_bag(bag, [{topic}]):
    print(reading.stamp_ns, {use})"""

_ROSBAGS = """\
from pathlib import Path
from rosbags.highlevel import AnyReader

with AnyReader([Path({path})]) as reader:
    for connection, stamp_ns, raw in reader.messages():
        message = reader.deserialize(raw, connection.msgtype)"""

_PYTORCH = """\
from fieldtruth.datasets import RunDataset

frames = RunDataset({path}, items=("image", "mask", "cloud", "labels"))
for frame in frames:
    print(frame["stamp_ns"], frame["image"].shape)"""
