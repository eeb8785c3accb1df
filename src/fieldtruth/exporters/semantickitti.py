# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export runs as SemanticKITTI: clouds with class and instance id per point, poses, calibration, a sequence per run.

Conventions are those of semantic-kitti-api and KITTI's odometry devkit: clouds in the frame of their
sensor (x forward, y left, z up), poses of the left camera's optical frame (cam0) relative to its first, ``Tr`` from the
former to cam0. In a run without cameras, cam0 is an optical frame in the centre of that sensor, and P is [1 | 0]. Of a
rig with several sensors, clouds are those of the first that gives them, images those of the first stereo pair or
else of the first camera.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import read_objects
from fieldtruth.bag.movers import Movers
from fieldtruth.bag.readings import Readings
from fieldtruth.bag.run import Run
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.classes import NO_RETURN, NOT_OF_WORLDS, ClassTable, Label
from fieldtruth.core.png import encode_png
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.core.yaml_io import package_data
from fieldtruth.datasets.items import ROLES
from fieldtruth.exporters import Options
from fieldtruth.exporters.frames import Chosen, chosen_of_many, first_of_clouds, first_views, noun_of
from fieldtruth.exporters.kitti import CLOUDS, IMAGES, Geometry, has_lens, read_geometry, write_cloud, write_motion
from fieldtruth.ontology import LabelMap, OntologyClass

_MAX_INSTANCE: Final = 65535
"""Largest instance id; a label has 16 bits for it."""
_TEXTS: Final = package_data("fieldtruth.exporters", "semantickitti.yaml")
_KINDS: Final[dict[str, int]] = _TEXTS["kinds"]
_MOVING: Final[dict[int, int]] = _TEXTS["moving"]
_MOVING_OTHER: Final = 251
_NAME: Final = "semantickitti"
"""Label map whose classes are those of SemanticKITTI."""
_IDS: Final = 260
"""Class ids, those of what moves included."""


class _Written(NamedTuple):
    """The files written of a run."""

    stamps_ns: list[int]
    """Stamps of the clouds, by number."""
    points: Counts
    """Number of points by class id (260,)."""
    images: int
    world_from_cam0: Array
    """(4, 4) at the first cloud, to which poses.txt is relative."""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder ``target``: a sequence per run, and fieldtruth.yaml.

    Raises:
        BagError: a bag has no clouds, true poses or /tf_static, too many objects, or is damaged.
    """
    for run in runs:
        first_of_clouds(run)
        if (most := len(read_objects(run)[0])) > _MAX_INSTANCE + 1:
            raise BagError(
                f"{run.bag} has {most} objects; instance ids of a label file have 16 bits, up to {_MAX_INSTANCE}"
            )
    geometries = [read_geometry(run) for run in runs]
    written = [
        _write_sequence(run, geometry, target / "sequences" / f"{number:02d}", options)
        for number, (run, geometry) in enumerate(zip(runs, geometries, strict=True))
    ]
    description = _description(runs, written, options.labels, options.classes)
    text = yaml.dump(description, Dumper=_Dumper, sort_keys=False, default_flow_style=False, width=1000)
    photographs = _TEXTS["photographs"][max(len(first_views(run)) * has_lens(run) for run in runs)]
    if photographs:
        photographs = f"# {photographs} the photographs with the stamp of a cloud, under the cloud's number.\n"
    noun = noun_of(first_of_clouds(run) for run in runs)
    header = _TEXTS["header"].format(photographs=photographs, noun=noun)
    (target / "fieldtruth.yaml").write_text(header + text, encoding="utf-8")


def _write_sequence(run: Run, geometry: Geometry, folder: Path, options: Options) -> _Written:
    stamps_ns, counts = _write_clouds(run, folder, options)
    world_from_cam0 = write_motion(run, geometry, stamps_ns, folder, folder / "poses.txt")
    images = _write_images(run, stamps_ns, folder, options) if has_lens(run) else 0
    return _Written(stamps_ns, counts, images, world_from_cam0)


# ---------------------------------------------------------------------------------------------------------------------
# Clouds


def _write_clouds(run: Run, folder: Path, options: Options) -> tuple[list[int], Counts]:
    """Write all clouds with their labels; return their stamps [ns] and the points by class id (260,)."""
    labels, movers = options.labels, run.movers if options.labels.name == _NAME else Movers()
    (folder / CLOUDS).mkdir(parents=True)
    (folder / "labels").mkdir()
    clouds = run[first_of_clouds(run).name]
    counts: Counts = np.zeros(_IDS, np.int64)

    def save(number: int) -> Counts:
        cloud: Cloud = clouds.read(number)
        mapped = _with_moving(labels.ids[cloud.label].astype("<u4"), cloud, movers)
        write_cloud(folder / CLOUDS / f"{number:06d}.bin", cloud)
        word = mapped | _instances(cloud, run) << np.uint32(16)
        word.astype("<u4").tofile(folder / "labels" / f"{number:06d}.label")
        return np.bincount(mapped, minlength=_IDS)

    for count in options.each(f"{run.name}: clouds", run, range(len(clouds)), save):
        counts += count
    return clouds.stamps_ns.tolist(), counts


def _with_moving(classes: NDArray[np.uint32], cloud: Cloud, movers: Movers) -> NDArray[np.uint32]:
    """Return classes (n,) of SemanticKITTI with those of objects that can move, by their kinds and their motion."""
    if cloud.instance is None:
        return classes
    for object_id, state in movers.at(cloud.stamp_ns).items():
        mover, own = movers.by_id[object_id], cloud.instance == object_id
        classes[own] = _KINDS.get(mover.kind, classes[own])
        if mover.is_moving(state):
            classes[own] = [_MOVING.get(number, _MOVING_OTHER) for number in classes[own].tolist()]
    return classes


def _instances(cloud: Cloud, run: Run) -> NDArray[np.uint32]:
    """Instance ids (n,), 0 if the cloud has none."""
    instance = np.zeros(len(cloud.xyz), np.uint32) if cloud.instance is None else cloud.instance
    if (odd := instance[(instance < 0) | (instance > _MAX_INSTANCE)]).size:
        where = f"the cloud at {cloud.stamp_ns} ns in {run.bag}"
        raise BagError(f"{where}: instance must be from 0 to {_MAX_INSTANCE} in a label file, got {odd[0]}")
    return instance.astype(np.uint32)


# ---------------------------------------------------------------------------------------------------------------------
# Images


def _write_images(run: Run, stamps_ns: Sequence[int], folder: Path, options: Options) -> int:
    """Write the photographs with the stamp of a cloud, under the cloud's number; return how many."""
    jobs: list[tuple[int, Path, Readings, int]] = []
    for view, name in zip(first_views(run), IMAGES, strict=False):
        if view.has(run.counts, "photo"):
            photos = run.readings(view.name, ["photo"])
            found = ((number, photos.row_at(stamp)) for number, stamp in enumerate(stamps_ns))
            jobs += [(number, folder / name, photos, row) for number, row in found if row is not None]

    def save(job: tuple[int, Path, Readings, int]) -> int:
        number, images, photos, row = job
        images.mkdir(exist_ok=True)
        (images / f"{number:06d}.png").write_bytes(encode_png(photos.read(row).photo))
        return 1

    return sum(options.each(f"{run.name}: images", run, sorted(jobs, key=lambda job: job[0]), save))


# ---------------------------------------------------------------------------------------------------------------------
# fieldtruth.yaml


class _Dumper(yaml.SafeDumper):
    """One line per entry, lists in one line."""

    def represent_sequence(self, tag: str, sequence: Any, flow_style: bool | None = None) -> yaml.SequenceNode:
        """Represent a list in one line."""
        return super().represent_sequence(tag, sequence, flow_style=True)


def _description(
    runs: Sequence[Run], written: Sequence[_Written], label_map: LabelMap, own: ClassTable
) -> dict[str, Any]:
    """Content of fieldtruth.yaml, in the structure of semantic-kitti-api's configuration files."""
    ids = label_map.ids.tolist()
    split = _split(len(runs))
    counts = sum((written[number].points for number in split["train"]), np.zeros(_IDS, np.int64))
    total = max(int(counts.sum()), 1)
    occurring = sum((done.points for done in written), np.zeros(_IDS, np.int64))
    classes = dict(sorted({**label_map.classes, **_moving_classes(label_map)}.items()))
    seen = {ids[label] for label in {row.label for row in own.coloured} - NO_RETURN - NOT_OF_WORLDS}
    seen |= {ids[label] for label in NOT_OF_WORLDS if occurring[ids[label]]} - {ids[Label.VOID]}
    seen |= {number for number in _moving_classes(label_map) if occurring[number]}
    return {
        "name": "fieldtruth" if label_map.is_own else f"fieldtruth, labels of {label_map.name}",
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
                **_named(chosen_of_many(run)),
                "clouds": len(done.stamps_ns),
                "points": int(done.points.sum()),
                "images": done.images,
                "first_stamp_ns": done.stamps_ns[0],
                "world_from_first_cam0": done.world_from_cam0[:3].ravel().tolist(),
            }
            for number, (run, done) in enumerate(zip(runs, written, strict=True))
        },
    }


def _moving_classes(label_map: LabelMap) -> dict[int, OntologyClass]:
    """Classes of what moves, if the labels are those of SemanticKITTI; each has the colour of what stands."""
    if label_map.name != _NAME:
        return {}
    still = {moving: label_map.classes[number] for number, moving in _MOVING.items()}
    found = {moving: OntologyClass(f"moving-{other.name}", other.rgb) for moving, other in still.items()}
    return {_MOVING_OTHER: OntologyClass("moving", (255, 0, 0))} | found


def _named(chosen: Chosen | None) -> dict[str, Any]:
    """Sensors of a sequence, if they were chosen of many."""
    return {} if chosen is None else {ROLES[Cloud].key: chosen.cloud, f"{ROLES[Image].key}s": chosen.views}


def _split(sequences: int) -> dict[str, list[int]]:
    """Split by run: the last of three or more is for tests, the one before, or the last of two, for validation."""
    valid, test = (1 if sequences > 1 else 0), (1 if sequences > 2 else 0)
    numbers = list(range(sequences))
    train = sequences - valid - test
    return {"train": numbers[:train], "valid": numbers[train : train + valid], "test": numbers[train + valid :]}
