# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs as data sets for training: frames by index, in any order, from any process. Only ``collate`` needs PyTorch.

parts = ft.split(ft.open_runs("data", items=("image", "mask")), train=["park_1", "lake_1"], val=["forest_1"])
loader = DataLoader(parts["train"], batch_size=8, shuffle=True, num_workers=4, collate_fn=ft.collate)
"""

import copy
import operator
import os
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, SupportsIndex, TypedDict, Unpack, cast

import numpy as np

from fieldtruth.bag.file import BAG_ENDINGS, BagError, find_bag, is_database
from fieldtruth.bag.geometry import Lens, Poses
from fieldtruth.bag.movers import Movers
from fieldtruth.bag.readings import Readings
from fieldtruth.bag.run import open_run
from fieldtruth.bag.stamps import nearest
from fieldtruth.bag.topics import EXTRAS, Source
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.classes import ClassTable
from fieldtruth.core.errors import ConfigurationError, UnknownNameError
from fieldtruth.core.readings import Cloud, Image, Reading
from fieldtruth.datasets.items import DEFAULT_ITEMS, RAGGED, ROLES, Anchor, Meaning
from fieldtruth.datasets.items import GEOMETRY as GEOMETRY
from fieldtruth.datasets.items import ITEMS as ITEMS
from fieldtruth.datasets.items import Sample as Sample
from fieldtruth.experiment.image_topics import IMAGES
from fieldtruth.ontology import LabelMap, label_map_of, own_labels

Transform = Callable[[Sample], Any]


class RunDataset:
    """The frames of one run, for ``torch.utils.data.DataLoader`` or without PyTorch: ``len(ds)``, ``ds[i]``.

    A sample is a dict of NumPy arrays, see ``Sample``; ``ft.collate`` makes tensors of a batch. A frame is a stamp of
    the anchor sensor at which all requested items exist. Items of one sensor have the same stamp, and so have images
    and clouds, unless ``tolerance_s`` allows the nearest reading of the other. Poses are those at the stamp of each
    sensor.

    Args:
        path: folder of a run, or a bag.
        items: contents of a sample: names from ``ITEMS`` (image, mask, depth, cloud, ...), and "pose" and "calibration"
            of the sensors of the other items.
        camera: name of a sensor that gives images, such as "left" or "right" of the paper's pair; None: the first.
        lidar: name of a sensor that gives clouds, whatever its kind; None: the first.
        anchor: whose stamps define the frames, "camera" or "lidar"; by default the camera if an item needs it.
        tolerance_s: largest difference [s] between the stamps of image and cloud in a frame.
        label_map: ontology of mask and labels, as for ``fieldtruth export``; None keeps our own classes.
        transform: applied to each sample; ``ds[i]`` returns its result.

    Raises:
        BagError: no bag, a damaged one, one that lacks a requested item, or one without a frame.
        UnknownNameError: unknown item, camera, LiDAR or ontology.
        ConfigurationError: an argument that is not allowed.
    """

    def __init__(
        self,
        path: Path | str,
        items: Sequence[str] = DEFAULT_ITEMS,
        *,
        camera: str | None = None,
        lidar: str | None = None,
        anchor: Anchor | None = None,
        tolerance_s: float = 0.0,
        label_map: str | LabelMap | None = None,
        transform: Transform | None = None,
    ) -> None:
        self.items = _checked_items(items)
        self.transform = transform
        needed = {ITEMS[item].reading for item in self.items if item in ITEMS}
        self._anchor = _anchor(anchor, needed)
        _check_tolerance(tolerance_s)
        self.run = open_run(Path(path))
        self.classes, ids = _ontology(label_map, self.run.classes)
        self._meaning = Meaning(ids, self._movers())
        self.name = self.run.name
        """Name of the run in samples; ``open_runs`` sets it to the run's path in the folder."""
        chosen = {Image: self._chosen(Image, camera), Cloud: self._chosen(Cloud, lidar)}
        used = [kind for kind in ROLES if kind in needed or kind is self._anchor]
        self._readings = {kind: self._open(kind, chosen[kind]) for kind in used}
        self._poses = self.run.poses if "pose" in self.items else None
        self._fixed = self._geometry()
        tolerance_ns, anchored = round(tolerance_s * 1e9), self._readings[self._anchor].stamps_ns
        self._rows = _associated(self._readings, anchored, tolerance_ns, self._poses)
        if not len(self):
            why = _explain_no_frame(self._readings, anchored)
            raise BagError(f"{self.run.bag} has no frame with {', '.join(self.items)}: {why}")

    @property
    def anchor(self) -> Anchor:
        """Whose stamps define the frames."""
        return ROLES[self._anchor].key

    @property
    def stamps_ns(self) -> Counts:
        """(len,) stamp [ns] of each frame."""
        return self._stamps(self._anchor)

    def __len__(self) -> int:
        return len(self._rows[self._anchor])

    def __getitem__(self, index: SupportsIndex) -> Any:
        """Return a sample; negative indices count from the end.

        Raises:
            IndexError: the index is out of range.
            BagError: the bag is missing, has changed, or is damaged.
        """
        sample = self._sample(checked_index(index, len(self)))
        return sample if self.transform is None else self.transform(sample)

    def __iter__(self) -> Iterator[Any]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        return f"RunDataset({self.name}: {len(self)} frames of {', '.join(self.items)})"

    def _stamps(self, kind: type[Reading]) -> Counts:
        return self._readings[kind].stamps_ns[self._rows[kind]]

    def _items(self, kind: type[Reading]) -> list[str]:
        """Items that are of readings of a type."""
        return [item for item in self.items if item in ITEMS and ITEMS[item].reading is kind]

    def _sample(self, i: int) -> Sample:
        sample: dict[str, Any] = {"run": self.name, "stamp_ns": int(self.stamps_ns[i])}
        for kind, readings in self._readings.items():
            sample[f"{ROLES[kind].key}_stamp_ns"] = int(self._stamps(kind)[i])
            if items := self._items(kind):
                reading = readings.read(int(self._rows[kind][i]))
                sample |= {item: ITEMS[item].value(reading, self._meaning) for item in items}
        if self._poses is not None:
            sample |= self._true_poses(i, self._poses)
        if "calibration" in self.items:
            sample |= copy.deepcopy(self._fixed)
        return cast(Sample, sample)

    def _movers(self) -> Movers:
        """What moves in the run, if items ask for it."""
        asked = next((item for item in self.items if item.startswith("moving")), None)
        if asked and self.run.experiment is None:
            raise BagError(f"{asked}: {self.run.bag} has no experiment.yaml beside it, which says what moves")
        return self.run.movers if asked else Movers()

    def _true_poses(self, i: int, poses: Poses) -> dict[str, Array]:
        result = {"world_from_base": poses.world_from_base(int(self.stamps_ns[i]))}
        for kind in self._readings:
            stamp, key = int(self._stamps(kind)[i]), ROLES[kind].key
            same = stamp == self.stamps_ns[i]
            world_from_base = result["world_from_base"] if same else poses.world_from_base(stamp)
            result[f"world_from_{key}"] = world_from_base @ self._fixed[f"base_from_{key}"]
        return result

    def _chosen(self, kind: type[Reading], name: str | None) -> Source | None:
        """Return the sensor of a name, or the first of the rig, if it has any."""
        known = {source.label: source for source in self.run.of(kind, recorded=False)}
        if name is None:
            return next(iter(known.values()), None)
        if name not in {*known, *(source.name for source in known.values())}:
            raise UnknownNameError(ROLES[kind].noun, name, known)
        return self.run.source(name)

    def _open(self, kind: type[Reading], source: Source | None) -> Readings:
        """Open a sensor with what the items need; an anchor without items has its main part."""
        run, role, items = self.run, ROLES[kind], self._items(kind)
        if source is None:
            raise BagError(f"{(items or [role.item])[0]}: the rig of {run.bag} has no {role.noun}")
        parts = list(dict.fromkeys(ITEMS[item].part for item in items)) or [role.part]
        for part in parts:
            topic = source.topics[part]
            if topic not in run.counts and part in EXTRAS:
                raise BagError(
                    f"{run.bag} has no {topic}; `fieldtruth generate NAME --extras {IMAGES[part]}` records it"
                )
        return run.readings(source.name, parts, labelled="labels" in items)

    def _geometry(self) -> dict[str, Any]:
        """Calibration by key of the sample, as far as items need it."""
        if not any(item in GEOMETRY for item in self.items):
            return {}
        static = self.run.calibration.static
        fixed: dict[str, Any] = {
            f"base_from_{ROLES[kind].key}": static.base_from(each.frame()) for kind, each in self._readings.items()
        }
        if "calibration" in self.items and Image in self._readings:
            source = self._readings[Image].source
            fixed |= _lens(self.run.calibration.lens(source.name), f"{source.info} of {self.run.bag}")
        return fixed


def _associated(
    readings: Mapping[type[Reading], Readings], anchored: Counts, tolerance_ns: int, poses: Poses | None
) -> dict[type[Reading], Counts]:
    """Select rows of each sensor, so that row i of each belongs to frame i: the nearest to a stamp of the anchor.

    Stamps of frames are within the tolerance [ns], and have a true pose, if there are poses.
    """
    if not all(map(len, readings.values())):
        return {kind: np.empty(0, np.int64) for kind in readings}
    rows = {kind: nearest(anchored, each.stamps_ns) for kind, each in readings.items()}
    keep = np.full(len(anchored), True)
    for kind, each in readings.items():
        found = each.stamps_ns[rows[kind]]
        keep &= np.abs(found - anchored) <= tolerance_ns
        keep &= True if poses is None else poses.cover(found)
    return {kind: own[keep] for kind, own in rows.items()}


def _explain_no_frame(readings: Mapping[type[Reading], Readings], anchored: Counts) -> str:
    for each in readings.values():
        if not len(each):
            return f"no stamp is common to {', '.join(each.source.topics[part] for part in each.parts)}"
    for each in readings.values():
        least = int(np.abs(each.stamps_ns[nearest(anchored, each.stamps_ns)] - anchored).min())
        if least:
            return f"stamps of camera and LiDAR differ by at least {least / 1e9:.6f} s; see tolerance_s"
    return "there is no true pose at their stamps"


def checked_index(index: SupportsIndex, length: int) -> int:
    """Return an index from 0 to ``length`` - 1; negative ones count from the end."""
    if isinstance(index, slice):
        raise TypeError("a data set cannot be sliced; use torch.utils.data.Subset(ds, range(...))")
    frame = operator.index(index)
    if not -length <= frame < length:
        raise IndexError(f"frame must be between {-length} and {length - 1}, got {frame}")
    return frame % length


def _lens(lens: Lens, where: str) -> dict[str, Array | str]:
    """Return ``K``, ``D`` and ``distortion_model`` of a camera.

    Raises:
        BagError: not a calibration; of a panorama, K is zeros.
    """
    pinhole = np.isfinite(lens.K).all() and lens.K[0, 0] > 0.0 < lens.K[1, 1]
    if not (pinhole or (lens.model == "equirectangular" and not lens.K.any())):
        raise BagError(f"{where} has an invalid calibration: K is {lens.K.ravel().tolist()}")
    return {"K": lens.K, "D": lens.D, "distortion_model": lens.model}


def _checked_items(items: Sequence[str]) -> tuple[str, ...]:
    if isinstance(items, str):
        raise ConfigurationError(f"items must be a list or tuple of names, such as ({items!r},), got a string")
    for item in items:
        if item not in ITEMS and item not in GEOMETRY:
            raise UnknownNameError("item", item, [*ITEMS, *GEOMETRY])
    if not items:
        raise ConfigurationError(f"items must not be empty; available: {', '.join([*ITEMS, *GEOMETRY])}")
    return tuple(dict.fromkeys(items))


def _anchor(name: str | None, needed: Set[type[Reading]]) -> type[Reading]:
    """Return the type of readings of an anchor; without a name the first that items need."""
    types: dict[str, type[Reading]] = {role.key: kind for kind, role in ROLES.items()}
    if name is None:
        return next((kind for kind in ROLES if kind in needed), next(iter(ROLES)))
    if name not in types:
        raise UnknownNameError("anchor", name, types)
    return types[name]


def _check_tolerance(tolerance_s: float) -> None:
    if not 0.0 <= tolerance_s < np.inf:
        raise ConfigurationError(f"tolerance_s must be a time [s] of at least 0, got {tolerance_s!r}")


def _ontology(label_map: str | LabelMap | None, classes: ClassTable) -> tuple[dict[int, str], Counts]:
    """Return names of classes by output id, and output ids by our class id."""
    found = label_map_of(label_map) if isinstance(label_map, str) else label_map
    chosen = own_labels(classes) if found is None else found.over(classes)
    return {number: other.name for number, other in chosen.classes.items()}, chosen.ids.astype(np.int64)


class Options(TypedDict, total=False):
    """Keyword arguments of ``RunDataset`` that apply to all runs."""

    camera: str | None
    lidar: str | None
    anchor: Anchor | None
    tolerance_s: float
    label_map: str | LabelMap | None
    transform: Transform | None


class Runs:
    """Several runs as one data set: their frames one run after the other.

    Raises:
        ConfigurationError: no runs, or runs in whose masks an id is of different classes.
    """

    def __init__(self, runs: Sequence[RunDataset]) -> None:
        rows = {row for run in runs for row in run.classes.items()}
        if not runs or len({number for number, _ in rows}) < len(rows):
            raise ConfigurationError("runs must be at least one, and an id must be of the same class in all")
        self.runs = tuple(runs)
        self._ends = np.cumsum([len(run) for run in self.runs], dtype=np.int64)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the runs."""
        return tuple(run.name for run in self.runs)

    @property
    def classes(self) -> dict[int, str]:
        """Names of the classes by id."""
        return dict(sorted({row for run in self.runs for row in run.classes.items()}))

    def locate(self, index: SupportsIndex) -> tuple[RunDataset, int]:
        """Return the run of a frame, and its index there.

        Raises:
            IndexError: the index is out of range.
        """
        frame = checked_index(index, len(self))
        k = int(np.searchsorted(self._ends, frame, side="right"))
        return self.runs[k], frame - int(self._ends[k]) + len(self.runs[k])

    def __len__(self) -> int:
        return int(self._ends[-1])

    def __getitem__(self, index: SupportsIndex) -> Any:
        """Return a sample, as ``RunDataset`` does."""
        run, frame = self.locate(index)
        return run[frame]

    def __iter__(self) -> Iterator[Any]:
        return (frame for run in self.runs for frame in run)

    def __repr__(self) -> str:
        return f"Runs({len(self)} frames of {', '.join(self.names)})"


def open_runs(folder: Path | str, items: Sequence[str] = DEFAULT_ITEMS, **options: Unpack[Options]) -> Runs:
    """Open every run in a folder and its subfolders, sorted by name.

    Bags are files of ROS 1, MCAP files, and those of ROS 2: .db3, or folders with metadata.yaml. A run's name is its
    path in the folder: ``park_1``, or ``seed_3/park_1``. If a folder has a bag with the folder's name, its other bags
    are copies (annotated, say) and are skipped. So are names that begin with a dot.

    Args:
        folder: the folder of runs.
        items: as for ``RunDataset``, like ``options``.

    Raises:
        BagError: no runs, an unreadable run, one that lacks a requested item, or two with the same name.
    """
    root = Path(folder)
    if not root.is_dir():
        raise BagError(f"{root} is not a folder; runs are opened from the folder that contains them")
    bags = bags_in(root)
    for (name, bag), (following, other) in pairwise(bags):
        if name == following:
            raise BagError(f"{bag} and {other} have the same name {name!r}; rename one")
    runs = [RunDataset(bag, items, **options) for _, bag in bags]
    for run, (name, _) in zip(runs, bags, strict=True):
        run.name = name
    return Runs(runs)


def bags_in(root: Path) -> list[tuple[str, Path]]:
    """Return name and bag of each run in a folder and its subfolders, as ``open_runs`` finds them, sorted.

    Raises:
        BagError: the folder has no bag.
    """
    bags = sorted(_bags(root))
    if not bags:
        raise BagError(f"{root} has no runs: no bag in it or its subfolders")
    return bags


def _bags(root: Path) -> Iterator[tuple[str, Path]]:
    """Yield name and bag of each run; links to folders are followed, each folder once."""
    seen: set[str] = set()
    for path, folders, files in os.walk(root, followlinks=True):
        real = os.path.realpath(path)
        if real in seen:
            folders.clear()
            continue
        seen.add(real)
        folders[:] = [name for name in folders if not name.startswith(".")]
        here, own, bags = Path(path), Path(real).name, list[str]()
        for ending in (*BAG_ENDINGS, ".db3"):
            bags = bags or [name for name in files if name.endswith(ending) and not name.startswith(".")]
            bags = [own + ending] if own + ending in bags else bags
        is_ros2 = is_database(here) and any(".db3" in name or ".mcap" in name for name in files)
        for name in [""] if is_ros2 and find_bag(here) == here else bags:
            folder = root / own if here == root else here
            called = folder if Path(name).stem in ("", own) else (here / name).with_suffix("")
            yield called.relative_to(root).as_posix(), here / name


Groups = list[list[RunDataset]]


def split(
    runs: Runs,
    *,
    rng: np.random.Generator | None = None,
    by: Literal["run", "world"] = "run",
    **parts: float | Sequence[str],
) -> dict[str, Runs]:
    """Split runs into data sets without a common run.

    Args:
        runs: all runs.
        rng: assigns runs to parts; required with shares.
        by: unit that is not split: a run, or all runs in the same world (equal environment, layout and seed).
        parts: by name, shares of the number of runs (or worlds) with the sum 1, ``train=0.7, val=0.3``; or lists of
            runs, ``train=["park_1", "lake_1"], val=["forest_1"]``.

    Raises:
        ConfigurationError: fewer runs than parts, shares whose sum is not 1, or a run in two lists.
        UnknownNameError: an unknown run in a list.
    """
    shares = {name: float(part) for name, part in parts.items() if isinstance(part, int | float)}
    lists = {name: part for name, part in parts.items() if not isinstance(part, int | float)}
    if not parts or (shares and lists):
        raise ConfigurationError("parts must be either all shares, such as train=0.7, val=0.3, or all lists of runs")
    groups = _groups(runs, by)
    chosen = _by_list(runs, groups, by, lists) if lists else _by_share(groups, by, shares, rng)
    return {name: Runs([run for run in runs.runs if run in members]) for name, members in chosen.items()}


def _groups(runs: Runs, by: str) -> Groups:
    """Group runs that must not be separated; data sets of the same bag never are."""
    if by not in ("run", "world"):
        raise UnknownNameError("unit of a split", by, ("run", "world"))
    groups: dict[object, list[RunDataset]] = {}
    for run in runs.runs:
        world = run.run.world
        groups.setdefault(run.run.bag.resolve() if by == "run" or world is None else world, []).append(run)
    return list(groups.values())


def _by_share(
    groups: Groups, by: str, shares: Mapping[str, float], rng: np.random.Generator | None
) -> dict[str, list[RunDataset]]:
    values = np.array(list(shares.values()))
    if not (values > 0.0).all() or abs(values.sum() - 1.0) > 1e-6:
        raise ConfigurationError(f"shares must be above 0 with the sum 1, got {', '.join(f'{v:g}' for v in values)}")
    if len(groups) < len(values):
        raise ConfigurationError(f"{len(values)} parts need at least {len(values)} {by}s, got {len(groups)}")
    if rng is None:
        raise ConfigurationError("shares need a random generator, such as rng=np.random.default_rng(0)")
    counts = np.ones(len(values), np.int64)
    while counts.sum() < len(groups):
        counts[np.argmax(values * len(groups) - counts)] += 1
    drawn = np.split(rng.permutation(len(groups)), np.cumsum(counts)[:-1])
    return {name: [run for k in own for run in groups[k]] for name, own in zip(shares, drawn, strict=True)}


def _by_list(runs: Runs, groups: Groups, by: str, lists: Mapping[str, Sequence[str]]) -> dict[str, list[RunDataset]]:
    taken: dict[int, tuple[str, str]] = {}
    for part, names in lists.items():
        if isinstance(names, str) or not names:
            raise ConfigurationError(f"part {part!r} must be a share or a list of runs, got {names!r}")
        for name in names:
            if name not in runs.names:
                raise UnknownNameError("run", name, runs.names)
            group = next(k for k, members in enumerate(groups) if any(run.name == name for run in members))
            other, first = taken.setdefault(group, (part, name))
            if other != part:
                what = f"run {name!r} is" if first == name else f"{first!r} and {name!r} are of the same {by}, which is"
                raise ConfigurationError(f"{what} in two parts, {other!r} and {part!r}")
    return {part: [run for run in runs.runs if run.name in names] for part, names in lists.items()}


def collate(samples: Sequence[Sample]) -> dict[str, Any]:
    """Make a batch, for ``DataLoader(ds, collate_fn=collate)``.

    Arrays with the same shape in all frames are stacked to a tensor, (batch, 3, h, w) for ``image``; stamps become a
    tensor, names a list. Items of clouds (``RAGGED``) differ in length and become a list of tensors, one per frame,
    without padding. ``torch.cat(batch["cloud"])`` or
    ``torch.nn.utils.rnn.pad_sequence(batch["cloud"], batch_first=True)`` make one tensor of them.

    Raises:
        ConfigurationError: PyTorch is not installed.
    """
    try:
        import torch
        from torch.utils.data import default_collate
    except ImportError as error:
        raise ConfigurationError("collate needs PyTorch (pip install torch)") from error
    batch: dict[str, Any] = {}
    for key in samples[0]:
        values = [sample[key] for sample in samples]  # type: ignore[literal-required]
        batch[key] = [torch.as_tensor(value) for value in values] if key in RAGGED else default_collate(values)
    return batch
