# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Commands and short programs that load a run."""

import shlex
from typing import Final, NamedTuple

from fieldtruth.bag import topics as table
from fieldtruth.bag.provenance import CHECKSUMS
from fieldtruth.bag.run import Run
from fieldtruth.core.readings import Cloud, Image

FORMATS: Final = {
    "files": "PNG, CSV and text files with class shares, as the paper publishes them",
    "zip": "the bag, compressed without loss, with its SHA-256",
    "semantickitti": "clouds with labels, poses and calibration",
    "kitti": "KITTI odometry: images, clouds, poses and calibration",
    "kitti-object": "KITTI object detection: boxes of all visible objects",
    "tum": "the true trajectory as a text file",
    "mcap": "ROS 2 messages (CDR), for ROS 2 and Foxglove",
    "coco": "COCO panoptic and detection JSON with images",
    "occupancy": "the world's surfaces as voxels with classes",
    "pcd": "a PCD file per cloud with labels and colours",
    "webdataset": "tar files of frames, for training from a stream",
    "huggingface": "Parquet tables with a card and Croissant metadata",
    "mmseg": "images and train ids in MMSegmentation's layout",
    "slam-configs": "configuration files of SLAM programs, and true poses of the sensors",
    "stereo-depth": "depth from matching the photographs of a pair, with its errors",
}
"""Export formats and their content. Exporters are a higher layer; a test compares the names."""


class Snippet(NamedTuple):
    """A few lines of code, with a title and their language."""

    title: str
    language: str
    code: str


def export_commands(run: Run) -> list[tuple[str, str]]:
    """Content of each export format and the command that writes it."""
    bag = shlex.quote(run.bag.name)
    return [(content, f"fieldtruth export {bag} --to {name}") for name, content in FORMATS.items()]


def snippets(run: Run) -> list[Snippet]:
    """Programs and commands to run in the folder of the bag."""
    bag, path = shlex.quote(run.bag.name), ascii(run.bag.name)
    found = [
        Snippet("fieldtruth", "Python", _fieldtruth(run, path)),
        Snippet("rosbags, without ROS", "Python", _ROSBAGS.format(path=path)),
    ]
    clouds, images = run.of(Cloud, recorded=False)[:1], run.of(Image, recorded=False)[:1]
    if clouds and images and all(each.has(run.counts) for each in (*clouds, *images)):
        found.append(Snippet("PyTorch", "Python", _PYTORCH.format(path=path)))
    if table.ODOMETRY in run.counts:
        found.append(Snippet("evo", "shell", f"evo_traj bag {bag} {table.ODOMETRY} --plot"))
    checksums = f"sha256sum -c {CHECKSUMS}\n" if (run.folder / CHECKSUMS).is_file() else ""
    found += [
        Snippet("ROS 1", "shell", f"rosbag info {bag}\nrosbag play --clock {bag}"),
        Snippet("Validate", "shell", f"{checksums}fieldtruth validate {bag}"),
        Snippet("View", "shell", f"fieldtruth view {bag}"),
    ]
    if run.experiment is not None:
        found.append(Snippet("Reproduce", "shell", "fieldtruth generate experiment.yaml --out again"))
    return found


def _fieldtruth(run: Run, path: str) -> str:
    """A program that reads the topic with the richest content."""
    decoders = dict.fromkeys([lidar.topic for lidar in run.of(Cloud)], "ft.bag.points(reading.message)")
    decoders |= dict.fromkeys(
        [view.topics["label"] for view in run.of(Image, "label")], "ft.bag.image(reading.message)"
    )
    topic = next((topic for topic in decoders if topic in run.counts), min(run.counts))
    return _FIELDTRUTH.format(path=path, topic=ascii(topic), value=decoders.get(topic, "reading.message"))


_FIELDTRUTH = """\
from pathlib import Path
import fieldtruth as ft

for reading in ft.read_bag(Path({path}), [{topic}]):
    print(reading.stamp_ns, {value})"""

_ROSBAGS = """\
from pathlib import Path
from rosbags.highlevel import AnyReader

with AnyReader([Path({path})]) as reader:
    for connection, stamp_ns, raw in reader.messages():
        message = reader.deserialize(raw, connection.msgtype)"""

_PYTORCH = """\
import fieldtruth as ft

frames = ft.RunDataset({path}, items=("image", "mask", "cloud", "labels"))
for frame in frames:
    print(frame["stamp_ns"], frame["image"].shape)"""
