# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs of a data set with their splits, the sensors that formats choose, and frames: readings of one stamp.

Each run of a published data set belongs to a split and has a name of its own; no world is in two splits. A frame is a
stamp at which all recorded images of the chosen cameras exist. It has the clouds with the same stamp. Without cameras
each cloud is a frame.
"""

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import decode as read
from fieldtruth.bag import topics as table
from fieldtruth.bag.file import BagError
from fieldtruth.bag.readings import Readings, matched, reflectivity, stored_photo
from fieldtruth.bag.run import Run, open_run
from fieldtruth.bag.topics import EXTRAS, PARTS, Source
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.errors import OutputError, UnknownNameError
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.datasets import bags_in
from fieldtruth.ontology import LabelMap

SPLITS: Final = ("train", "val", "test")
_UNSAFE: Final = re.compile(r"[^A-Za-z0-9_-]")


class Member(NamedTuple):
    """A run of a data set."""

    run: Run
    split: str
    name: str
    """Unique in the data set; letters, digits, _ and -."""


def find_members(paths: Sequence[Path], split: str) -> list[Member]:
    """Open runs, folders of runs such as a campaign's, or bags.

    A run in a folder ``train``, ``val`` or ``test``, as in ``OUT/val/lake_7``, belongs to that split.

    Args:
        paths: of runs, bags or folders of runs; of a folder all runs are taken, sorted by path.
        split: of runs in other folders.

    Raises:
        UnknownNameError: unknown split.
        BagError: a path without a run, or an unreadable run.
        OutputError: a run is given twice, or runs of one world are in two splits.
    """
    if split not in SPLITS:
        raise UnknownNameError("split", split, SPLITS)
    bags = [bag for path in paths for bag in _bags(path)]
    if twice := next((bag for bag, n in Counter(bag.resolve() for bag in bags).items() if n > 1), None):
        raise OutputError(f"{twice} is given twice; each run can be in a data set once")
    bags.sort(key=lambda bag: SPLITS.index(_split_of(bag, split)))
    splits = [_split_of(bag, split) for bag in bags]
    runs = [open_run(bag) for bag in bags]
    _check_worlds(runs, splits)
    return [Member(*row) for row in zip(runs, splits, _names(runs), strict=True)]


def _bags(path: Path) -> list[Path]:
    """Return the bag of a run, or the bags in a folder of runs."""
    if not path.exists():
        raise BagError(f"{path} does not exist; it must be the folder of a run, a folder of runs, or a bag")
    return [bag for _, bag in bags_in(path)] if path.is_dir() else [path]


def _split_of(bag: Path, default: str) -> str:
    """Return the split whose folder holds the bag or the folder of its run."""
    above = [folder.name for folder in bag.absolute().parents[:2]]
    return next((name for name in above if name in SPLITS), default)


def _check_worlds(runs: Sequence[Run], splits: Sequence[str]) -> None:
    """Check that each world is in one split; the world of a bag from elsewhere is unknown."""
    first: dict[str, tuple[Run, str]] = {}
    for run, split in zip(runs, splits, strict=True):
        if run.world is not None and run.experiment is not None:
            other, taken = first.setdefault(run.world, (run, split))
            if taken != split:
                world = f"{run.experiment.environment} with seed {run.experiment.seed}"
                raise OutputError(
                    f"{other.bag} in split {taken!r} and {run.bag} in split {split!r} are of the same world ({world}); "
                    "a world must be in one split"
                )


def _names(runs: Sequence[Run]) -> list[str]:
    """Return the runs' names, made unique by a number."""
    names: list[str] = []
    for run in runs:
        base = _UNSAFE.sub("_", run.name)[:64]
        tried = (base if k == 1 else f"{base}-{k}" for k in range(1, len(runs) + 1))
        names.append(next(name for name in tried if name not in names))
    return names


# ---------------------------------------------------------------------------------------------------------------------
# Sensors of a run that formats choose


def first_lidar(run: Run) -> Source:
    """Return the first LiDAR of the rig.

    Raises:
        BagError: the rig has none, or it has no clouds.
    """
    lidars = run.of(Cloud, recorded=False)
    if not lidars:
        raise BagError(f"the rig of {run.bag} has no LiDAR, and this format is made of clouds")
    run.require(lidars[0].topic)
    return lidars[0]


def first_views(run: Run) -> list[Source]:
    """Return the views of the first stereo pair of the rig, without a pair that of its first camera, if any."""
    views = run.of(Image, recorded=False)
    device = next((view.device for view in [view for view in views if view.side] or views), None)
    return [view for view in views if view.device == device]


def chosen_of_many(run: Run) -> dict[str, Any]:
    """Names of LiDAR and cameras of a sequence; empty for a rig with one LiDAR, and one pair or no camera."""
    views, lidars = [view.label for view in first_views(run)], run.of(Cloud, recorded=False)
    devices = {view.device for view in run.of(Image, recorded=False)}
    if len(lidars) <= 1 and len(devices) <= 1 and len(views) != 1:
        return {}
    return {"lidar": first_lidar(run).name, "cameras": views}


def require_pinholes(run: Run, form: str) -> None:
    """Check that the photographs are rectified, as ``form`` has them.

    Raises:
        BagError: the cameras have another lens.
    """
    for view in first_views(run):
        lens = run.calibration.lens(view.name)
        if not lens.is_pinhole:
            raise BagError(
                f"{form} has rectified photographs, and those of {run.bag} have the lens {lens.model!r}; "
                f"rectify them with {view.info}, or export as coco, webdataset or files, which keep the lens"
            )


def cameras_of(run: Run) -> dict[str, list[Source]]:
    """Views with photographs and labels, by name of the camera or pair."""
    views: dict[str, list[Source]] = {}
    for view in run.of(Image, "photo", "label"):
        views.setdefault(view.device, []).append(view)
    return views


def require_frames(run: Run, *, clouds: bool) -> None:
    """Check that a run has photographs with labels, or with ``clouds`` at least clouds.

    Raises:
        BagError: it names the topics of the first camera and LiDAR.
    """
    if cameras_of(run) or (clouds and run.of(Cloud)):
        return
    views, lidars = run.of(Image, recorded=False)[:1], run.of(Cloud, recorded=False)[:1]
    needed = [f"{view.topics['photo']} with {view.topics['label']}" for view in views]
    needed += [lidar.topic for lidar in lidars if clouds]
    what = ", or ".join(needed) or f"camera{' or LiDAR' * clouds}"
    raise BagError(f"{run.bag} has no {what}; available: {', '.join(sorted(run.counts))}")


def intensity_is_class(lidar: Source) -> bool:
    """Return True if the intensity of a LiDAR's points is their class, as in the paper, not their reflectivity."""
    return getattr(lidar.config, "intensity", "class") == "class"


# ---------------------------------------------------------------------------------------------------------------------
# Frames


LIDAR: Final = "lidar"
"""Name of the LiDAR whose entries are not named after it: the paper's."""


class View(NamedTuple):
    """Images of a camera."""

    photo: bytes
    """Byte for byte as in the bag."""
    suffix: str
    """Ending of a file of the photograph: .jpg or .png."""
    mask: NDArray[np.uint8]
    """(h, w) class ids."""
    extras: dict[str, NDArray[Any]]
    """``depth`` (h, w) float32 [m] along the optical axis, infinite in the sky, ``instances`` (h, w) ids,
    ``normals`` (h, w, 3) float32 and ``flow`` (h, w, 2) float32 [pixel]."""


class Frame(NamedTuple):
    """The readings of a stamp."""

    stamp_ns: int
    views: dict[str, View]
    """By name of the camera's view: left, right."""
    clouds: dict[str, dict[str, NDArray[Any]]]
    """By LiDAR: ``xyz`` (n, 3) float32 [m] in its frame, ``label`` (n,) class ids, and other fields (n,)."""
    about: dict[str, Any]
    """Poses (4, 4) and calibration, as JSON."""


class Frames:
    """The frames of some views and LiDARs of a run, by index; may be read from several threads.

    Without views each cloud of the LiDAR is a frame. ``extras`` are read if they are recorded.

    Raises:
        BagError: no stamp is common to all images, or the bag is damaged.
    """

    def __init__(
        self,
        run: Run,
        label_map: LabelMap,
        views: Sequence[Source],
        lidars: Sequence[Source] = (),
        extras: Collection[str] = EXTRAS,
    ) -> None:
        self._ids = label_map.ids
        run.streams([*_topics(run, views, extras), *(lidar.topic for lidar in lidars)])
        self._views = {view.label: run.readings(view.name, _parts(run, view, extras)) for view in views}
        self._clouds = {lidar.name: run.readings(lidar.name) for lidar in lidars}
        chosen = list((self._views or self._clouds).values())
        self.stamps_ns: Counts = reduce(np.intersect1d, [each.stamps_ns for each in chosen])
        """(len,) stamp [ns] of each frame."""
        if not len(self.stamps_ns):
            topics = ", ".join(_topics(run, views, extras))
            raise BagError(f"{run.bag} has no frame: no stamp is common to {topics}")
        self._geometry = _Geometry(run, views, lidars)

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def __getitem__(self, i: int) -> Frame:
        """Read a frame.

        Raises:
            BagError: the bag is damaged, has changed, or has a colour that no class has.
        """
        stamp = int(self.stamps_ns[i])
        views = {name: self._view(readings, stamp) for name, readings in self._views.items()}
        rows = {name: readings.row_at(stamp) for name, readings in self._clouds.items()}
        clouds = {name: self._cloud(self._clouds[name].read(row)) for name, row in rows.items() if row is not None}
        about = {"stamp_ns": stamp} | self._geometry.at(stamp, clouds)
        return Frame(stamp, views, clouds, about)

    def _view(self, readings: Readings, stamp: int) -> View:
        image, photo, suffix = with_photo(readings, stamp)
        extras = {PARTS[part]: getattr(image, part) for part in EXTRAS if part in readings.parts}
        return View(photo, suffix, np.take(self._ids, image.label), extras)

    def _cloud(self, cloud: Cloud) -> dict[str, NDArray[Any]]:
        fields = cloud.fields()
        measured = read.MEASURED if "true_range" in fields else ()
        named = {name: fields[name] for name in ("instance", "ring", "column", "t", *measured) if name in fields}
        found = {"xyz": cloud.xyz.astype("<f4"), "label": np.take(self._ids, cloud.label)} | named
        return found | ({"reflectivity": reflectivity(cloud)} if measured else {})

    def empty_clouds(self) -> dict[str, dict[str, NDArray[Any]]]:
        """Return the arrays of a cloud without points of each LiDAR."""
        first = {name: self._cloud(readings.read(0)) for name, readings in self._clouds.items()}
        return {name: {field: values[:0] for field, values in cloud.items()} for name, cloud in first.items()}


def with_photo(readings: Readings, stamp: int) -> tuple[Any, bytes, str]:
    """Return the images of a view at a stamp [ns] without the photograph, and this as it is stored, with its ending.

    Raises:
        BagError: the images cannot be read, or the photograph is neither JPEG nor PNG, or has another size.
    """
    row = readings.row_at(stamp)
    assert row is not None
    image = readings.read(row, [part for part in readings.parts if part != "photo"])
    try:
        return image, *stored_photo(readings.message(row, "photo"), image.label.shape)
    except BagError as error:
        raise BagError(f"{readings.source.topic} at {stamp} ns: {error}") from error


def count_common(run: Run, views: Sequence[Source]) -> int:
    """Return the number of stamps at which all images of these views exist.

    Raises:
        BagError: the bag is damaged.
    """
    return len(matched([*run.streams(_topics(run, views, EXTRAS)).values()])[0].stamps_ns)


def _parts(run: Run, view: Source, extras: Collection[str]) -> list[str]:
    """Recorded parts of a view: photograph, label, and as far as recorded ``extras``."""
    return [part for part in view.recorded(run.counts) if part in ("photo", "label", *extras)]


def _topics(run: Run, views: Sequence[Source], extras: Collection[str]) -> list[str]:
    return [view.topics[part] for view in views for part in _parts(run, view, extras)]


class _Geometry:
    """Poses and calibration, as far as the bag has them."""

    def __init__(self, run: Run, views: Sequence[Source], lidars: Sequence[Source]) -> None:
        self._trajectory = run.trajectory if run.has_poses else None
        mounted = table.TF_STATIC in run.counts
        self.cameras = {v.label: _camera(run, v, mounted) for v in views if run.calibration.has_lens(v.name)}
        self.lidars = {lidar.name: _lidar(run, lidar) if mounted else {} for lidar in lidars}

    def at(self, stamp_ns: int, clouds: Collection[str]) -> dict[str, Any]:
        """Poses and calibration of the cameras, and of the LiDARs with clouds, at a stamp, as JSON."""
        world_from_base = None if self._trajectory is None else self._trajectory.world_from_base(stamp_ns)
        about: dict[str, Any] = {} if world_from_base is None else {"world_from_base": world_from_base.tolist()}
        cameras = {name: _placed(camera, "camera", world_from_base) for name, camera in self.cameras.items()}
        lidars = {name: _placed(self.lidars[name], "lidar", world_from_base) for name in clouds}
        paper = {LIDAR: lidars.pop(LIDAR)} if LIDAR in lidars else {}
        return about | {"cameras": cameras} | paper | ({"lidars": lidars} if lidars else {})


def _placed(sensor: Mapping[str, Any], kind: str, world_from_base: Array | None) -> dict[str, Any]:
    """Calibration of a sensor, with its pose in the world if both are known."""
    mount = sensor.get(f"base_from_{kind}")
    if world_from_base is None or mount is None:
        return dict(sensor)
    return {**sensor, f"world_from_{kind}": (world_from_base @ np.array(mount)).tolist()}


def _camera(run: Run, view: Source, mounted: bool) -> dict[str, Any]:
    lens = run.calibration.lens(view.name)
    camera = {
        "frame_id": lens.frame,
        "K": lens.K.tolist(),
        "P": lens.P.tolist(),
        "distortion_model": lens.model,
        "D": lens.D.tolist(),
    }
    return camera | {"base_from_camera": run.calibration.base_from(view.name).tolist()} if mounted else camera


def _lidar(run: Run, lidar: Source) -> dict[str, Any]:
    mount = run.calibration.base_from(lidar.name)
    return {"frame_id": run.calibration.frame(lidar.name), "base_from_lidar": mount.tolist()}
