# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Contents of a bag, read by rosbags and looked up colour by colour: the reference for data sets of many runs."""

import shutil
from collections import defaultdict
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosbags.highlevel import AnyReader

from fieldtruth.core.classes import CLASSES
from fieldtruth.experiment.files import dump_experiment, load_experiment
from fieldtruth.exporters import export

CLASS_OF = {row.rgb: int(row.label) for row in CLASSES if row.rgb is not None}


class Picture(NamedTuple):
    jpeg: bytes
    label: NDArray[np.uint8]
    depth: NDArray[np.float32]
    instances: NDArray[np.uint16]


class Truth(NamedTuple):
    pictures: dict[tuple[int, str], Picture]
    """By stamp and camera."""
    clouds: dict[int, NDArray[np.void]]
    positions: dict[int, tuple[float, float, float]]

    def pixels(self) -> NDArray[np.int64]:
        """Pixels of all images by class id."""
        return sum((np.bincount(p.label.ravel(), minlength=18) for p in self.pictures.values()), np.zeros(18, np.int64))


@cache
def read_truth(bag: Path) -> Truth:
    parts: dict[tuple[int, str], dict[str, Any]] = defaultdict(dict)
    clouds, positions = {}, {}
    with AnyReader([bag]) as reader:
        wanted = [c for c in reader.connections if c.topic.startswith(("/stereo", "/os1", "/ground_truth"))]
        for connection, stamp, data in reader.messages(wanted):
            message: Any = reader.deserialize(data, connection.msgtype)
            if connection.topic.startswith("/os1"):
                clouds[stamp] = _points(message)
            elif connection.topic.startswith("/ground_truth"):
                at = message.pose.pose.position
                positions[stamp] = at.x, at.y, at.z
            else:
                _, _, _, side, *kind = connection.topic.split("/")
                parts[stamp, side][kind[0]] = message
    return Truth({key: _picture(found) for key, found in parts.items()}, clouds, positions)


def _picture(parts: dict[str, Any]) -> Picture:
    tag = parts["tag"]
    shape = tag.height, tag.width
    colours, inverse = np.unique(tag.data.reshape(-1, 3), axis=0, return_inverse=True)
    label = np.array([CLASS_OF[tuple(colour)] for colour in colours.tolist()], np.uint8)[inverse.reshape(-1)]
    depth = np.frombuffer(parts["depth"].data, "<f4").reshape(shape)
    instances = np.frombuffer(parts["instances"].data, "<u2").reshape(shape)
    return Picture(bytes(parts["real"].data), label.reshape(shape), depth, instances)


def _points(cloud: Any) -> NDArray[np.void]:
    kinds = {2: "u1", 4: "<u2", 5: "<i4", 6: "<u4", 7: "<f4"}
    fields = cloud.fields
    dtype = np.dtype(
        {
            "names": [f.name for f in fields],
            "formats": [kinds[f.datatype] for f in fields],
            "offsets": [f.offset for f in fields],
            "itemsize": cloud.point_step,
        }
    )
    return np.frombuffer(cloud.data, dtype)


def as_world(run: Path, target: Path, seed: int) -> Path:
    """Copy a run to a folder, as if it were of another seed."""
    target.mkdir(parents=True)
    (bag,) = run.glob("*.bag")
    shutil.copy(bag, target)
    experiment = load_experiment(run / "experiment.yaml").model_copy(update={"seed": seed})
    (target / "experiment.yaml").write_text(dump_experiment(experiment))
    return target


def publish(run: Path, base: Path, to: str, shard_mb: int | None = None) -> Path:
    """Export a run for training and one, as if of another world, for validation; in several files below their size."""
    return export([run, as_world(run, base / "val" / "other", 9)], to, out=base / "set", shard_mb=shard_mb)
