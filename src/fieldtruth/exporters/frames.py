# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs of a data set with their splits, the sensors that formats choose, and frames: readings of one stamp.

Each run of a published data set belongs to a split and has a name of its own; no world is in two splits. A frame is a
stamp at which all recorded images of the chosen views exist. It has the clouds with the same stamp. Without views
each cloud is a frame.
"""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import decode as read
from fieldtruth.bag import topics as table
from fieldtruth.bag.file import BagError
from fieldtruth.bag.readings import Readings, reflectivity, stored_photo
from fieldtruth.bag.run import Run, open_run
from fieldtruth.bag.stamps import matched
from fieldtruth.bag.topics import EXTRAS, PAPER_RIG, Source
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.errors import OutputError, UnknownNameError
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.datasets import bags_in
from fieldtruth.datasets.items import ROLES
from fieldtruth.experiment.image_topics import IMAGES
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
    return [Member(*row) for row in zip(runs, splits, unique_names(runs), strict=True)]


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
                world = f"{run.experiment.world_name} with seed {run.experiment.seed}"
                raise OutputError(
                    f"{other.bag} in split {taken!r} and {run.bag} in split {split!r} are of the same world ({world}); "
                    "a world must be in one split"
                )


def unique_names(runs: Sequence[Run]) -> list[str]:
    """Return the runs' names in letters, digits, _ and -, made unique by a number."""
    names: list[str] = []
    for run in runs:
        base = _UNSAFE.sub("_", run.name)[:64]
        tried = (base if k == 1 else f"{base}-{k}" for k in range(1, len(runs) + 1))
        names.append(next(name for name in tried if name not in names))
    return names


# ---------------------------------------------------------------------------------------------------------------------
# Sensors of a run that formats choose, by the type of their readings


def first_of_clouds(run: Run) -> Source:
    """Return the first sensor of the rig that gives clouds.

    Raises:
        BagError: the rig has none, or it has no clouds.
    """
    sensors = run.of(Cloud, recorded=False)
    if not sensors:
        noun = ROLES[Cloud].noun
        raise BagError(f"the rig of {run.bag} has no {noun}, and this format is made of clouds")
    run.require(sensors[0].topic)
    return sensors[0]


def first_views(run: Run) -> list[Source]:
    """Return the views of the first pair of the rig, without a pair that of its first sensor of images, if any."""
    views = run.of(Image, recorded=False)
    device = next((view.device for view in [view for view in views if view.side] or views), None)
    return [view for view in views if view.device == device]


def noun_of(sources: Iterable[Source]) -> str:
    """Name of the kind of some sensors, or their kinds, in a sentence about one of them: ``LiDAR``."""
    return " or ".join(dict.fromkeys(each.config.noun for each in sources))


class Chosen(NamedTuple):
    """Names of the sensors that a sequence has of a rig with many."""

    cloud: str
    views: list[str]


def chosen_of_many(run: Run) -> Chosen | None:
    """Return the choice for a sequence; None for a rig with one sensor of clouds, and one pair or nothing of images."""
    views = [view.label for view in first_views(run)]
    devices = {view.device for view in run.of(Image, recorded=False)}
    if len(run.of(Cloud, recorded=False)) <= 1 and len(devices) <= 1 and len(views) != 1:
        return None
    return Chosen(first_of_clouds(run).name, views)


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


def views_of(run: Run) -> dict[str, list[Source]]:
    """Views with photographs and labels, by name of their sensor."""
    views: dict[str, list[Source]] = {}
    for view in run.of(Image, "photo", "label"):
        views.setdefault(view.device, []).append(view)
    return views


def format_of(run: Run, view: Source) -> str:
    """Return the format of a view's photographs, JPEG or PNG, as the first one has it."""
    start = bytes(run.readings(view.name, ["photo"]).message(0).data[:4])
    return "PNG" if start == b"\x89PNG" else "JPEG"


def require_frames(run: Run, *, clouds: bool) -> None:
    """Check that a run has photographs with labels, or with ``clouds`` at least clouds.

    Raises:
        BagError: it names the topics of the first sensors of images and clouds.
    """
    if views_of(run) or (clouds and run.of(Cloud)):
        return
    views, sensors = run.of(Image, recorded=False)[:1], run.of(Cloud, recorded=False)[:1]
    needed = [f"{view.topics['photo']} with {view.topics['label']}" for view in views]
    needed += [sensor.topic for sensor in sensors if clouds]
    nouns = [role.noun for kind, role in ROLES.items() if clouds or kind is Image]
    what = ", or ".join(needed) or " or ".join(nouns)
    raise BagError(f"{run.bag} has no {what}; available: {', '.join(sorted(run.counts))}")


def intensity_is_class(source: Source) -> bool:
    """Return True if the intensity of a sensor's points is their class, as in the paper, not their reflectivity."""
    return getattr(source.config, "intensity", "class") == "class"


# ---------------------------------------------------------------------------------------------------------------------
# Frames


PAPER: Final = PAPER_RIG.first(Cloud).name
"""Name of the sensor of clouds whose entries are not named after it: the paper's."""
_KEYS: Final = {kind: role.key for kind, role in ROLES.items()}


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
    ``normals`` (h, w, 3) float32, ``flow`` (h, w, 2) float32 [pixel] and ``parts`` (h, w)."""


class Frame(NamedTuple):
    """The readings of a stamp."""

    stamp_ns: int
    views: dict[str, View]
    """By name: left, right."""
    clouds: dict[str, dict[str, NDArray[Any]]]
    """By sensor: ``xyz`` (n, 3) float32 [m] in its frame, ``label`` (n,) class ids, and other fields (n,)."""
    about: dict[str, Any]
    """Poses (4, 4) and calibration, as JSON."""


class Frames:
    """The frames of some views and sensors of clouds of a run, by index; may be read from several threads.

    Without views each cloud is a frame. ``extras`` are read if they are recorded.

    Raises:
        BagError: no stamp is common to all images, or the bag is damaged.
    """

    def __init__(
        self,
        run: Run,
        label_map: LabelMap,
        views: Sequence[Source],
        clouds: Sequence[Source] = (),
        extras: Collection[str] = EXTRAS,
    ) -> None:
        self._ids = label_map.ids
        run.streams([*_topics(run, views, extras), *(each.topic for each in clouds)])
        self._views = {view.label: run.readings(view.name, _parts(run, view, extras)) for view in views}
        self._clouds = {each.name: run.readings(each.name) for each in clouds}
        chosen = list((self._views or self._clouds).values())
        self.stamps_ns: Counts = reduce(np.intersect1d, [each.stamps_ns for each in chosen])
        """(len,) stamp [ns] of each frame."""
        if not len(self.stamps_ns):
            topics = ", ".join(_topics(run, views, extras))
            raise BagError(f"{run.bag} has no frame: no stamp is common to {topics}")
        self._geometry = _Geometry(run, views, clouds)

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
        row = readings.row_at(stamp)
        assert row is not None
        image = readings.read(row, [part for part in readings.parts if part != "photo"])
        try:
            photo, suffix = stored_photo(readings.message(row, "photo"), image.label.shape)
        except BagError as error:
            raise BagError(f"{readings.source.topic} at {stamp} ns: {error}") from error
        extras = {IMAGES[part]: getattr(image, part) for part in EXTRAS if part in readings.parts}
        return View(photo, suffix, np.take(self._ids, image.label), extras)

    def _cloud(self, cloud: Cloud) -> dict[str, NDArray[Any]]:
        fields = cloud.fields()
        measured = read.MEASURED if "true_range" in fields else ()
        others = ("instance", "ring", "column", "t", "part", "passability", "force", *measured)
        named = {name: fields[name] for name in others if name in fields}
        found = {"xyz": cloud.xyz.astype("<f4"), "label": np.take(self._ids, cloud.label)} | named
        return found | ({"reflectivity": reflectivity(cloud)} if measured else {})

    def empty_clouds(self) -> dict[str, dict[str, NDArray[Any]]]:
        """Return the arrays of a cloud without points of each sensor."""
        first = {name: self._cloud(readings.read(0)) for name, readings in self._clouds.items()}
        return {name: {field: values[:0] for field, values in cloud.items()} for name, cloud in first.items()}


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

    def __init__(self, run: Run, views: Sequence[Source], clouds: Sequence[Source]) -> None:
        self._trajectory = run.trajectory if run.has_poses else None
        known = [view for view in views if run.calibration.has_lens(view.name)]
        self._views = {view.label: _calibration(run, view) for view in known}
        self._clouds = {each.name: _calibration(run, each) for each in clouds}

    def at(self, stamp_ns: int, clouds: Collection[str]) -> dict[str, Any]:
        """Poses and calibration of the views, and of the sensors with clouds, at a stamp, as JSON."""
        world_from_base = None if self._trajectory is None else self._trajectory.world_from_base(stamp_ns)
        about: dict[str, Any] = {} if world_from_base is None else {"world_from_base": world_from_base.tolist()}
        view, cloud = _KEYS[Image], _KEYS[Cloud]
        about[f"{view}s"] = {name: _placed(own, view, world_from_base) for name, own in self._views.items()}
        placed = {name: _placed(self._clouds[name], cloud, world_from_base) for name in clouds}
        paper = {cloud: placed.pop(PAPER)} if PAPER in placed else {}
        return about | paper | ({f"{cloud}s": placed} if placed else {})


def cloud_about(frame: Frame, name: str) -> dict[str, Any]:
    """Return pose and calibration of a sensor that has a cloud in a frame."""
    key = _KEYS[Cloud]
    about: dict[str, Any] = frame.about[key] if name == PAPER else frame.about[f"{key}s"][name]
    return about


def _placed(sensor: Mapping[str, Any], key: str, world_from_base: Array | None) -> dict[str, Any]:
    """Calibration of a sensor, with its pose in the world if both are known."""
    mount = sensor.get(f"base_from_{key}")
    if world_from_base is None or mount is None:
        return dict(sensor)
    return {**sensor, f"world_from_{key}": (world_from_base @ np.array(mount)).tolist()}


def _calibration(run: Run, source: Source) -> dict[str, Any]:
    """Frame, lens and mount of a sensor."""
    found, mounted = dict[str, Any](), table.TF_STATIC in run.counts
    if source.type is Image:
        lens = run.calibration.lens(source.name)
        found = {"frame_id": lens.frame, "K": lens.K.tolist(), "P": lens.P.tolist()}
        found |= {"distortion_model": lens.model, "D": lens.D.tolist()}
    elif mounted:
        found = {"frame_id": run.calibration.frame(source.name)}
    mount = {f"base_from_{_KEYS[source.type]}": run.calibration.base_from(source.name).tolist()} if mounted else {}
    return found | mount
