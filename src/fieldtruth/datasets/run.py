# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One run as a map-style data set: frames by index, in any order, from any process."""

import copy
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple, Protocol, SupportsIndex, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.calibration import read_static_frames
from fieldtruth.bag.errors import BagError, read_errors
from fieldtruth.bag.reader import open_bag
from fieldtruth.bag.run import Run, open_run
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.classes import CLASSES, Label
from fieldtruth.core.errors import ConfigurationError, UnknownNameError
from fieldtruth.datasets.association import Stream, associate, explain_no_frame, read_streams
from fieldtruth.datasets.items import GEOMETRY, ITEMS, Sample, Sensor
from fieldtruth.datasets.poses import Poses, pose_topic
from fieldtruth.datasets.storage import Storage
from fieldtruth.ontology.label_map import LabelMap, label_map_of
from fieldtruth.sensors.camera.config import EXTRAS, Imager
from fieldtruth.sensors.lidar.config import LidarConfig

DEFAULT_ITEMS: Final = ("image", "mask")
_SENSORS: Final[tuple[Sensor, ...]] = ("camera", "lidar")

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
        self._sensors = [sensor for sensor in _SENSORS if sensor in needed or sensor == self.anchor]
        self.run = open_run(Path(path))
        source = _Source.of(self.run, camera, lidar)
        self._topics = {item: source.topic(self.run, item) for item in self.items if item in ITEMS}
        self.name = self.run.name
        """Name of the run in samples; ``open_runs`` sets it to the run's path in the folder."""
        opened = _open(self.run, self._topics_by_sensor(source), self.items, source)
        self._storage, self._poses, self._fixed = opened.storage, opened.poses, opened.fixed
        chosen = associate(opened.streams, self.anchor, round(tolerance_s * 1e9), opened.covered)
        self._streams = {stream.topic: stream for group in chosen.values() for stream in group}
        self._stamps = {sensor: group[0].stamps_ns for sensor, group in chosen.items()}
        if not len(self):
            why = explain_no_frame(opened.streams, self.anchor)
            raise BagError(f"{self.run.bag} has no frame with {', '.join(self.items)}: {why}")

    @property
    def stamps_ns(self) -> Counts:
        """(len,) stamp [ns] of each frame."""
        return self._stamps[self.anchor]

    def __len__(self) -> int:
        return len(self._stamps[self.anchor])

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

    def _sample(self, i: int) -> Sample:
        sample: dict[str, Any] = {"run": self.name, "stamp_ns": int(self.stamps_ns[i])}
        for sensor in self._sensors:
            sample[f"{sensor}_stamp_ns"] = int(self._stamps[sensor][i])
        messages: dict[str, Any] = {}
        for item, topic in self._topics.items():
            if topic not in messages:
                stream = self._streams[topic]
                messages[topic] = self._storage.message(topic, int(stream.chunk[i]), int(stream.offset[i]))
            with read_errors(self.run.bag):
                sample[item] = ITEMS[item].value(messages[topic], self._ids)
        if self._poses is not None:
            sample |= self._true_poses(i, self._poses)
        if "calibration" in self.items:
            sample |= copy.deepcopy(self._fixed)
        return cast(Sample, sample)

    def _true_poses(self, i: int, poses: Poses) -> dict[str, Array]:
        result = {"world_from_base": poses.world_from_base(int(self.stamps_ns[i]))}
        for sensor in self._sensors:
            stamp = int(self._stamps[sensor][i])
            same = stamp == self.stamps_ns[i]
            world_from_base = result["world_from_base"] if same else poses.world_from_base(stamp)
            result[f"world_from_{sensor}"] = world_from_base @ self._fixed[f"base_from_{sensor}"]
        return result

    def _topics_by_sensor(self, source: "_Source") -> dict[Sensor, list[str]]:
        """Return topics by sensor; an anchor without items has its main topic."""
        default = {"camera": "image", "lidar": "cloud"}
        return {
            sensor: list(dict.fromkeys(topic for item, topic in self._topics.items() if ITEMS[item].sensor == sensor))
            or [source.topic(self.run, default[sensor])]
            for sensor in self._sensors
        }


def checked_index(index: SupportsIndex, length: int) -> int:
    """Return an index from 0 to ``length`` - 1; negative ones count from the end."""
    if isinstance(index, slice):
        raise TypeError("a data set cannot be sliced; use torch.utils.data.Subset(ds, range(...))")
    frame = operator.index(index)
    if not -length <= frame < length:
        raise IndexError(f"frame must be between {-length} and {length - 1}, got {frame}")
    return frame % length


class _Source(NamedTuple):
    """The sensors of the rig that are read; None if it has none of this kind."""

    camera: Imager | None
    lidar: LidarConfig | None

    @classmethod
    def of(cls, run: Run, camera: str | None, lidar: str | None) -> "_Source":
        """Choose sensors by name, or the first of the rig."""
        return cls(_named("camera", camera, run.rig.imagers), _named("LiDAR", lidar, run.rig.lidars))

    def topic(self, run: Run, item: str) -> str:
        """Return the topic of an item.

        Raises:
            BagError: the rig has no such sensor.
        """
        sensor, stream, _ = ITEMS[item]
        if sensor == "camera" and self.camera is not None:
            return self.camera.topic_of(stream)
        if sensor == "lidar" and self.lidar is not None:
            return self.lidar.topic
        raise BagError(f"{item}: the rig of {run.bag} has no {'LiDAR' if sensor == 'lidar' else sensor}")


class _Named(Protocol):
    @property
    def name(self) -> str: ...


_Found = TypeVar("_Found", bound=_Named)


def _named(kind: str, name: str | None, sensors: Sequence[_Found]) -> _Found | None:
    known = {sensor.name: sensor for sensor in sensors}
    if name is not None and name not in known:
        raise UnknownNameError(kind, name, known)
    return next(iter(sensors), None) if name is None else known[name]


class _Opened(NamedTuple):
    """Data from a bag's index and its first messages."""

    storage: Storage
    streams: dict[Sensor, list[Stream]]
    poses: Poses | None
    fixed: dict[str, Any]
    """Calibration by key of the sample."""

    def covered(self, stamps_ns: Counts) -> NDArray[np.bool_]:
        """Return which stamps have a true pose, or all if none is requested."""
        return np.full(len(stamps_ns), True) if self.poses is None else self.poses.cover(stamps_ns)


def _open(run: Run, topics: Mapping[Sensor, list[str]], items: Sequence[str], source: _Source) -> _Opened:
    readings = [topic for group in topics.values() for topic in group]
    _require(run, readings, source.camera)
    pose = pose_topic(run) if "pose" in items else None
    geometry = any(item in GEOMETRY for item in items)
    camera = source.camera if "calibration" in items and "camera" in topics else None
    info = None if camera is None else camera.topic_of("camera_info")
    run.require(*[table.TF_STATIC] * geometry, *filter(None, [info]))
    with open_bag(run.bag, true_stamps=run.clocked) as bag:
        storage = Storage(bag)
        streams = read_streams(bag, storage, [*readings, *filter(None, (pose, info))])
    fixed: dict[str, Any] = {}
    if geometry:
        static = read_static_frames(run)
        for sensor, group in topics.items():
            first = _first(storage, streams[group[0]])
            fixed[f"base_from_{sensor}"] = static.base_from(first.header.frame_id)
    if info is not None:
        fixed |= _lens(_first(storage, streams[info]), f"{info} of {run.bag}")
    by_sensor = {sensor: [streams[topic] for topic in group] for sensor, group in topics.items()}
    return _Opened(storage, by_sensor, None if pose is None else Poses(storage, streams[pose]), fixed)


def _lens(info: Any, where: str) -> dict[str, Array | str]:
    """Return ``K``, ``D`` and ``distortion_model`` of a CameraInfo.

    Raises:
        BagError: not a calibration; of a panorama, K is zeros.
    """
    matrix, coefficients = np.array(info.K, np.float64).reshape(3, 3), np.array(info.D, np.float64)
    pinhole = np.isfinite(matrix).all() and matrix[0, 0] > 0.0 < matrix[1, 1]
    if not (pinhole or (info.distortion_model == "equirectangular" and not matrix.any())):
        raise BagError(f"{where} has an invalid calibration: K is {matrix.ravel().tolist()}")
    return {"K": matrix, "D": coefficients, "distortion_model": str(info.distortion_model)}


def _first(storage: Storage, stream: Stream) -> Any:
    return storage.message(stream.topic, int(stream.chunk[0]), int(stream.offset[0]))


def _require(run: Run, topics: Sequence[str], camera: Imager | None) -> None:
    """Check that the bag has the topics; the error for optional ones shows how to record them."""
    for topic in topics:
        for extra in EXTRAS:
            if topic not in run.counts and camera is not None and topic == camera.topic_of(extra):
                raise BagError(f"{run.bag} has no {topic}; `fieldtruth generate NAME --extras {extra}` records it")
    run.require(*topics)


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
