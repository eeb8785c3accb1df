# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export runs as SemanticKITTI: clouds with class and instance id per point, poses, calibration, a sequence per run.

Conventions are those of semantic-kitti-api and KITTI's odometry devkit: clouds in the LiDAR's frame (x
forward, y left, z up), poses of the left camera's optical frame (cam0) relative to its first, ``Tr`` from the LiDAR's
frame to cam0. In a run without cameras, cam0 is an optical frame in the LiDAR's centre, and P is [1 | 0]. Of a rig with
several sensors, clouds are those of the first LiDAR, images those of the first stereo pair or else of the first camera.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from fieldtruth.bag.decode import image, reading_stamp, stamp_ns
from fieldtruth.bag.model_states import read_objects
from fieldtruth.bag.reader import BagError, decoder, open_bag
from fieldtruth.bag.run import Run
from fieldtruth.bag.trajectory import read_trajectory
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.classes import NO_RETURN, NOT_OF_WORLDS, Label
from fieldtruth.core.parallel import in_order
from fieldtruth.core.png import encode_png
from fieldtruth.core.progress import timed
from fieldtruth.exporters import Options
from fieldtruth.exporters.sequences import (
    CLOUDS,
    IMAGES,
    Geometry,
    calib_text,
    chosen_of_many,
    first_lidar,
    first_views,
    has_cameras,
    poses_text,
    read_geometry,
    returns,
    times_text,
    xyz_and_reflectance,
)
from fieldtruth.ontology.label_map import OWN, LabelMap

_MAX_INSTANCE: Final = 65535
"""Largest instance id; a label has 16 bits for it."""
_HEADER: Final = """\
# For semantic-kitti-api and networks built on it. sequences/NN/velodyne/*.bin is float32 x, y, z [m] and remission;
# sequences/NN/labels/*.label is uint32: class in the low, instance id in the high 16 bits.
# Remission is the reflectivity, 1 of a white surface; 0 of an ideal LiDAR: the class must not be a network's input.
# image_2 (left) and image_3 (right) are the photographs with the stamp of a cloud, under the cloud's number.
# content is the share of points of the training sequences. Colours are blue, green, red.
"""


class _Written(NamedTuple):
    """The files written of a run."""

    stamps_ns: list[int]
    """Stamps of the clouds, by number."""
    points: Counts
    """Number of points by class id (256,)."""
    images: int
    world_from_cam0: Array
    """(4, 4) at the first cloud, to which poses.txt is relative."""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder ``target``: a sequence per run, and fieldtruth.yaml.

    Raises:
        BagError: a bag has no clouds, true poses or /tf_static, too many objects, or is damaged.
    """
    for run in runs:
        first_lidar(run)
        if (most := len(read_objects(run)[0])) > _MAX_INSTANCE + 1:
            raise BagError(
                f"{run.bag} has {most} objects; instance ids of a label file have 16 bits, up to {_MAX_INSTANCE}"
            )
    geometries = [read_geometry(run) for run in runs]
    written = [
        _write_sequence(run, geometry, target / "sequences" / f"{number:02d}", options)
        for number, (run, geometry) in enumerate(zip(runs, geometries, strict=True))
    ]
    description = _description(runs, written, options.label_map or OWN)
    text = yaml.dump(description, Dumper=_Dumper, sort_keys=False, default_flow_style=False, width=1000)
    (target / "fieldtruth.yaml").write_text(_HEADER + text, encoding="utf-8")


def _write_sequence(run: Run, geometry: Geometry, folder: Path, options: Options) -> _Written:
    trajectory = read_trajectory(run)
    stamps_ns, counts = _write_clouds(run, folder, options)
    world_from_cam0 = np.array([trajectory.world_from_base(stamp) @ geometry.base_from_cam0 for stamp in stamps_ns])
    (folder / "poses.txt").write_text(poses_text(world_from_cam0), encoding="ascii")
    (folder / "times.txt").write_text(times_text(stamps_ns), encoding="ascii")
    (folder / "calib.txt").write_text(calib_text(geometry), encoding="ascii")
    images = _write_images(run, stamps_ns, folder, options) if has_cameras(run) else 0
    return _Written(stamps_ns, counts, images, world_from_cam0[0])


# ---------------------------------------------------------------------------------------------------------------------
# Clouds


def _write_clouds(run: Run, folder: Path, options: Options) -> tuple[list[int], Counts]:
    """Write all clouds with their labels; return their stamps [ns] and the points by class id (256,)."""
    ids = (options.label_map or OWN).ids
    (folder / CLOUDS).mkdir(parents=True)
    (folder / "labels").mkdir()
    stamps_ns: list[int] = []
    counts: Counts = np.zeros(256, np.int64)

    def save(numbered: tuple[int, Any]) -> Counts:
        number, cloud = numbered
        xyzr, label, instance = _cloud_arrays(cloud, run)
        mapped = ids[label].astype("<u4")
        xyzr.tofile(folder / CLOUDS / f"{number:06d}.bin")
        (mapped | instance << np.uint32(16)).astype("<u4").tofile(folder / "labels" / f"{number:06d}.label")
        return np.bincount(mapped, minlength=256)

    with (
        open_bag(run.bag, true_stamps=run.clocked) as bag,
        options.progress.stage(f"{run.name}: clouds", run.duration_s) as advance,
    ):
        decode = decoder(bag)

        def clouds() -> Iterator[tuple[int, Any]]:
            for number, raw in enumerate(timed(bag.messages([first_lidar(run).topic]), advance, run.start_ns)):
                cloud = decode(raw)
                stamps_ns.append(stamp_ns(cloud.header))
                yield number, cloud

        for count in in_order(clouds(), save, options.workers):
            counts += count
    return stamps_ns, counts


def _cloud_arrays(cloud: Any, run: Run) -> tuple[NDArray[np.float32], NDArray[np.uint8], NDArray[np.uint32]]:
    """Points (n, 4) with remission, class ids (n,) and instance ids (n,), 0 if the cloud has none."""
    found = returns(cloud, run)
    rows, names = found.rows, found.rows.dtype.names or ()
    instance = rows["instance"] if "instance" in names else np.zeros(len(rows), np.uint32)
    if (odd := instance[(instance < 0) | (instance > _MAX_INSTANCE)]).size:
        where = f"the cloud at {stamp_ns(cloud.header)} ns in {run.bag}"
        raise BagError(f"{where}: instance must be from 0 to {_MAX_INSTANCE} in a label file, got {odd[0]}")
    return xyz_and_reflectance(rows), found.label, instance.astype(np.uint32)


# ---------------------------------------------------------------------------------------------------------------------
# Images


def _write_images(run: Run, stamps_ns: Sequence[int], folder: Path, options: Options) -> int:
    """Write the photographs with the stamp of a cloud, under the cloud's number; return how many."""
    number_at = {stamp: number for number, stamp in enumerate(stamps_ns)}
    topics = (view.topic_of("photograph") for view in first_views(run))
    folders = {topic: folder / name for topic, name in zip(topics, IMAGES, strict=False)}
    present = [topic for topic in folders if topic in run.counts]

    def save(job: tuple[Path, Any]) -> int:
        path, message = job
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(encode_png(image(message)))
        return 1

    if not present:
        return 0
    with (
        open_bag(run.bag, true_stamps=run.clocked) as bag,
        options.progress.stage(f"{run.name}: images", run.duration_s) as advance,
    ):
        decode = decoder(bag)

        def jobs() -> Iterator[tuple[Path, Any]]:
            for raw in timed(bag.messages(present), advance, run.start_ns):
                message = decode(raw)
                number = number_at.get(reading_stamp(raw.stamp_ns, message.header))
                if number is not None:
                    yield folders[raw.topic] / f"{number:06d}.png", message

        return sum(in_order(jobs(), save, options.workers))


# ---------------------------------------------------------------------------------------------------------------------
# fieldtruth.yaml


class _Dumper(yaml.SafeDumper):
    """One line per entry, lists in one line."""

    def represent_sequence(self, tag: str, sequence: Any, flow_style: bool | None = None) -> yaml.SequenceNode:
        """Represent a list in one line."""
        return super().represent_sequence(tag, sequence, flow_style=True)


def _description(runs: Sequence[Run], written: Sequence[_Written], label_map: LabelMap) -> dict[str, Any]:
    """Content of fieldtruth.yaml, in the structure of semantic-kitti-api's configuration files."""
    classes = dict(sorted(label_map.classes.items()))
    ids = {label: int(label_map.ids[label]) for label in Label}
    split = _split(len(runs))
    counts = sum((written[number].points for number in split["train"]), np.zeros(256, np.int64))
    total = max(int(counts.sum()), 1)
    occurring = sum((done.points for done in written), np.zeros(256, np.int64))
    seen = {ids[label] for label in set(Label) - NO_RETURN - NOT_OF_WORLDS - {Label.VOID}}
    seen |= {ids[label] for label in NOT_OF_WORLDS if occurring[ids[label]]} - {ids[Label.VOID]}
    return {
        "name": "fieldtruth" if label_map is OWN else f"fieldtruth, labels of {label_map.name}",
        "labels": {number: other.name for number, other in classes.items()},
        "color_map": {number: list(other.rgb)[::-1] for number, other in classes.items()},
        "content": {number: int(counts[number]) / total for number in classes},
        # Outputs of a network are numbered without gaps; classes that no LiDAR point can have are ignored.
        "learning_map": {number: train for train, number in enumerate(classes)},
        "learning_map_inv": dict(enumerate(classes)),
        "learning_ignore": {train: number not in seen for train, number in enumerate(classes)},
        "split": split,
        "sequences": {
            number: {
                "run": run.name,
                **chosen_of_many(run),
                "clouds": len(done.stamps_ns),
                "points": int(done.points.sum()),
                "images": done.images,
                "first_stamp_ns": done.stamps_ns[0],
                "world_from_first_cam0": done.world_from_cam0[:3].ravel().tolist(),
            }
            for number, (run, done) in enumerate(zip(runs, written, strict=True))
        },
    }


def _split(sequences: int) -> dict[str, list[int]]:
    """Split by run: the last of three or more is for tests, the one before, or the last of two, for validation."""
    valid, test = (1 if sequences > 1 else 0), (1 if sequences > 2 else 0)
    numbers = list(range(sequences))
    train = sequences - valid - test
    return {"train": numbers[:train], "valid": numbers[train : train + valid], "test": numbers[train + valid :]}
