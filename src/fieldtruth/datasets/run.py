# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One run as a map-style data set: frames by index, in any order, from any process."""

import copy
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, SupportsIndex, cast

import numpy as np

from fieldtruth.bag.calibration import Lens
from fieldtruth.bag.errors import BagError
from fieldtruth.bag.poses import Poses
from fieldtruth.bag.readings import Readings
from fieldtruth.bag.run import open_run
from fieldtruth.bag.sources import EXTRAS, PARTS, Source
from fieldtruth.bag.streams import nearest
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.classes import CLASSES, Label
from fieldtruth.core.errors import ConfigurationError, UnknownNameError
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.datasets.items import GEOMETRY, ITEMS, Sample, Sensor
from fieldtruth.ontology import LabelMap, label_map_of

DEFAULT_ITEMS: Final = ("image", "mask")
_SENSORS: Final[tuple[Sensor, ...]] = ("camera", "lidar")
_KINDS: Final = {"camera": (Image, "camera", "photo"), "lidar": (Cloud, "LiDAR", "main")}
"""Type of readings, name in messages, and main part of a sensor."""
_MAIN_ITEM: Final = {"camera": "image", "lidar": "cloud"}

Transform = Callable[[Sample], Any]


class RunDataset:
    """The frames of one run, for ``torch.utils.data.DataLoader`` or without PyTorch: ``len(ds)``, ``ds[i]``.

    A sample is a dict of NumPy arrays, see ``Sample``; ``ft.collate`` makes tensors of a batch. A frame is a stamp of
    the anchor sensor at which all requested items exist. Items of one sensor have the same stamp, and so have camera
    and LiDAR, unless ``tolerance_s`` allows the nearest reading of the other. Poses are those at the stamp of each
    sensor.

    Args:
        path: folder of a run, or a bag.
        items: contents of a sample: names from ``ITEMS`` (image, mask, depth, instance_mask, cloud, labels, instances,
            rays), and "pose" and "calibration" of the sensors of the other items.
        camera: name of a camera of the rig, such as "left" or "right" of the paper's pair; None: the first.
        lidar: name of a LiDAR of the rig; None: the first.
        anchor: sensor whose stamps define the frames, "camera" or "lidar"; by default the camera if an item needs it.
        tolerance_s: largest difference [s] between the stamps of camera and LiDAR in a frame.
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
        anchor: Sensor | None = None,
        tolerance_s: float = 0.0,
        label_map: str | LabelMap | None = None,
        transform: Transform | None = None,
    ) -> None:
        self.items = _checked_items(items)
        self.transform = transform
        needed = {ITEMS[item].sensor for item in self.items if item in ITEMS}
        self.anchor: Sensor = anchor or ("camera" if "camera" in needed or not needed else "lidar")
        _check_choices(self.anchor, tolerance_s)
        self.classes, self._ids = _ontology(label_map)
        self.run = open_run(Path(path))
        self.name = self.run.name
        """Name of the run in samples; ``open_runs`` sets it to the run's path in the folder."""
        chosen = {"camera": self._chosen("camera", camera), "lidar": self._chosen("lidar", lidar)}
        sensors = [sensor for sensor in _SENSORS if sensor in needed or sensor == self.anchor]
        self._readings = {sensor: self._open(sensor, chosen[sensor]) for sensor in sensors}
        self._poses = self.run.poses if "pose" in self.items else None
        self._fixed = self._geometry()
        tolerance_ns, anchored = round(tolerance_s * 1e9), self._readings[self.anchor].stamps_ns
        self._rows = _associated(self._readings, anchored, tolerance_ns, self._poses)
        if not len(self):
            why = _explain_no_frame(self._readings, anchored)
            raise BagError(f"{self.run.bag} has no frame with {', '.join(self.items)}: {why}")

    @property
    def stamps_ns(self) -> Counts:
        """(len,) stamp [ns] of each frame."""
        return self._stamps(self.anchor)

    def __len__(self) -> int:
        return len(self._rows[self.anchor])

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

    def _stamps(self, sensor: Sensor) -> Counts:
        return self._readings[sensor].stamps_ns[self._rows[sensor]]

    def _sample(self, i: int) -> Sample:
        sample: dict[str, Any] = {"run": self.name, "stamp_ns": int(self.stamps_ns[i])}
        for sensor, readings in self._readings.items():
            sample[f"{sensor}_stamp_ns"] = int(self._stamps(sensor)[i])
            items = [item for item in self.items if item in ITEMS and ITEMS[item].sensor == sensor]
            if items:
                reading = readings.read(int(self._rows[sensor][i]))
                sample |= {item: ITEMS[item].value(reading, self._ids) for item in items}
        if self._poses is not None:
            sample |= self._true_poses(i, self._poses)
        if "calibration" in self.items:
            sample |= copy.deepcopy(self._fixed)
        return cast(Sample, sample)

    def _true_poses(self, i: int, poses: Poses) -> dict[str, Array]:
        result = {"world_from_base": poses.world_from_base(int(self.stamps_ns[i]))}
        for sensor in self._readings:
            stamp = int(self._stamps(sensor)[i])
            same = stamp == self.stamps_ns[i]
            world_from_base = result["world_from_base"] if same else poses.world_from_base(stamp)
            result[f"world_from_{sensor}"] = world_from_base @ self._fixed[f"base_from_{sensor}"]
        return result

    def _chosen(self, sensor: Sensor, name: str | None) -> Source | None:
        """Return the sensor of a name, or the first of the rig, if it has any."""
        kind, called, _ = _KINDS[sensor]
        known = {source.label: source for source in self.run.of(kind, recorded=False)}
        if name is None:
            return next(iter(known.values()), None)
        if name not in {*known, *(source.name for source in known.values())}:
            raise UnknownNameError(called, name, known)
        return self.run.source(name)

    def _open(self, sensor: Sensor, source: Source | None) -> Readings:
        """Open a sensor with what the items need; an anchor without items has its main part."""
        run, (_, called, main) = self.run, _KINDS[sensor]
        items = [item for item in self.items if item in ITEMS and ITEMS[item].sensor == sensor]
        if source is None:
            what = (items or [_MAIN_ITEM[sensor]])[0]
            raise BagError(f"{what}: the rig of {run.bag} has no {called}")
        parts = list(dict.fromkeys(ITEMS[item].part for item in items)) or [main]
        for part in parts:
            topic = source.topics[part]
            if topic not in run.counts and part in EXTRAS:
                raise BagError(
                    f"{run.bag} has no {topic}; `fieldtruth generate NAME --extras {PARTS[part]}` records it"
                )
        return run.readings(source.name, parts, labelled="labels" in items)

    def _geometry(self) -> dict[str, Any]:
        """Calibration by key of the sample, as far as items need it."""
        if not any(item in GEOMETRY for item in self.items):
            return {}
        static = self.run.static
        fixed: dict[str, Any] = {f"base_from_{s}": static.base_from(each.frame()) for s, each in self._readings.items()}
        if "calibration" in self.items and "camera" in self._readings:
            source = self._readings["camera"].source
            fixed |= _lens(self.run.calibration.lens(source.name), f"{source.info} of {self.run.bag}")
        return fixed


def _associated(
    readings: Mapping[Sensor, Readings], anchored: Counts, tolerance_ns: int, poses: Poses | None
) -> dict[Sensor, Counts]:
    """Select rows of each sensor, so that row i of each belongs to frame i: the nearest to a stamp of the anchor.

    Stamps of frames are within the tolerance [ns], and have a true pose, if there are poses.
    """
    if not all(map(len, readings.values())):
        return {sensor: np.empty(0, np.int64) for sensor in readings}
    rows = {sensor: nearest(anchored, each.stamps_ns) for sensor, each in readings.items()}
    keep = np.full(len(anchored), True)
    for sensor, each in readings.items():
        found = each.stamps_ns[rows[sensor]]
        keep &= np.abs(found - anchored) <= tolerance_ns
        keep &= True if poses is None else poses.cover(found)
    return {sensor: own[keep] for sensor, own in rows.items()}


def _explain_no_frame(readings: Mapping[Sensor, Readings], anchored: Counts) -> str:
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


def _check_choices(anchor: str, tolerance_s: float) -> None:
    if anchor not in _SENSORS:
        raise UnknownNameError("anchor", anchor, _SENSORS)
    if not 0.0 <= tolerance_s < np.inf:
        raise ConfigurationError(f"tolerance_s must be a time [s] of at least 0, got {tolerance_s!r}")


def _ontology(label_map: str | LabelMap | None) -> tuple[dict[int, str], Counts]:
    """Return names of classes by output id, and output ids by our class id."""
    if label_map is None:
        return {int(row.label): row.name for row in CLASSES}, np.arange(len(Label))
    chosen = label_map_of(label_map) if isinstance(label_map, str) else label_map
    return {number: other.name for number, other in chosen.classes.items()}, chosen.ids.astype(np.int64)


__all__ = ["DEFAULT_ITEMS", "RunDataset", "Transform", "checked_index"]
