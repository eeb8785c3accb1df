# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Frames of a run for data sets of many runs: photographs, labels, cloud, poses and calibration at one stamp.

A frame is a stamp at which all recorded images of all cameras exist. It has a cloud if one has the same stamp. In a run
without cameras each cloud is a frame.
"""

from collections.abc import Collection, Mapping
from typing import Any, Final, NamedTuple

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from fieldtruth.bag import decode as read
from fieldtruth.bag import topics as table
from fieldtruth.bag.calibration import StaticFrames, first_message, read_static_frames
from fieldtruth.bag.reader import BagError, open_bag
from fieldtruth.bag.run import Run
from fieldtruth.bag.trajectory import read_trajectory
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.datasets.association import Stream, matched, read_streams
from fieldtruth.datasets.storage import Storage
from fieldtruth.exporters.sequences import returns
from fieldtruth.ontology.label_map import LabelMap

ITEMS: Final = ("depth", "instances", "cloud")
"""What a frame may have beside photographs and labels."""

_EXTRAS: Final = {"depth": table.depth, "instances": table.instances}


class View(NamedTuple):
    """Images of a camera."""

    jpeg: bytes
    """The photograph, byte for byte as in the bag."""
    mask: NDArray[np.uint8]
    """(h, w) class ids."""
    extras: dict[str, NDArray[Any]]
    """``depth`` (h, w) float32 [m] along the optical axis, infinite in the sky, and ``instances`` (h, w) ids."""


class Frame(NamedTuple):
    """What was measured at a stamp."""

    stamp_ns: int
    views: dict[str, View]
    """By camera: left, right."""
    cloud: dict[str, NDArray[Any]] | None
    """``xyz`` (n, 3) float32 [m] in the LiDAR's frame, ``label`` (n,) class ids, and other fields of the cloud (n,)."""
    about: dict[str, Any]
    """Poses (4, 4) and calibration, as JSON."""


class Frames:
    """The frames of a run, by index; may be read from several threads. ``items`` are read if they are recorded.

    Without ``images`` each cloud is a frame.

    Raises:
        BagError: neither a photograph with a tag image nor a cloud, no stamp common to all images, or a damaged bag.
    """

    def __init__(self, run: Run, label_map: LabelMap, items: Collection[str] = ITEMS, *, images: bool = True) -> None:
        self._run, self._ids = run, label_map.ids
        self._kinds = [table.photograph, table.tag, *(_EXTRAS[item] for item in items if item in _EXTRAS)]
        self.sides = sides_of(run) if images else []
        self._images = [topic for side in self.sides for topic in self._image_topics(side)]
        points = [table.POINTS] if table.POINTS in run.counts and "cloud" in items else []
        if not self._images and not points:
            needed = f"{table.photograph('left')} with {table.tag('left')}"
            needed += f", or {table.POINTS}" if "cloud" in items else ""
            raise BagError(f"{run.bag} has no {needed}; available: {', '.join(sorted(run.counts))}")
        with open_bag(run.bag) as bag:
            self._storage = Storage(bag)
            streams = read_streams(bag, self._storage, [*self._images, *points])
        chosen = matched([streams[topic] for topic in self._images or points])
        self.stamps_ns: Counts = chosen[0].stamps_ns
        """(len,) stamp [ns] of each frame."""
        if not len(self.stamps_ns):
            raise BagError(f"{run.bag} has no frame: no stamp is common to {', '.join(self._images)}")
        self._streams = {stream.topic: stream for stream in chosen}
        self._clouds = {int(stamp): k for k, stamp in enumerate(streams[table.POINTS].stamps_ns)} if points else {}
        self._cloud_stream = streams.get(table.POINTS)
        self._geometry = _Geometry(run, self.sides)

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def __getitem__(self, i: int) -> Frame:
        """Read a frame.

        Raises:
            BagError: the bag is damaged, has changed, or has a colour that no class has.
        """
        stamp = int(self.stamps_ns[i])
        views = {side: self._view(side, i) for side in self.sides}
        cloud = self._cloud(stamp)
        about = {"stamp_ns": stamp} | self._geometry.at(stamp, has_cloud=cloud is not None)
        return Frame(stamp, views, cloud, about)

    def _view(self, side: str, i: int) -> View:
        messages = {topic: self._message(self._streams[topic], i) for topic in self._image_topics(side)}
        where = f"{side} camera at {int(self.stamps_ns[i])} ns in {self._run.bag}"
        try:
            mask = np.take(self._ids, read.labels(read.image(messages[table.tag(side)])))
            extras: dict[str, NDArray[Any]] = {
                name: getattr(read, name)(messages[topic(side)])
                for name, topic in _EXTRAS.items()
                if topic(side) in messages
            }
            jpeg = checked_jpeg(messages[table.photograph(side)], mask.shape)
        except BagError as error:
            raise BagError(f"{where}: {error}") from error
        return View(jpeg, mask, extras)

    def _cloud(self, stamp_ns: int) -> dict[str, NDArray[Any]] | None:
        row = self._clouds.get(stamp_ns)
        if row is None or self._cloud_stream is None:
            return None
        found = returns(self._message(self._cloud_stream, row), self._run)
        fields = found.rows.dtype.names or ()
        cloud: dict[str, NDArray[Any]] = {
            "xyz": np.stack([found.rows[axis].astype("<f4") for axis in "xyz"], axis=1),
            "label": np.take(self._ids, found.label),
        }
        return cloud | {
            name: np.ascontiguousarray(found.rows[name])
            for name in ("instance", "ring", "column", "t")
            if name in fields
        }

    def _image_topics(self, side: str) -> list[str]:
        return [topic for topic in (kind(side) for kind in self._kinds) if topic in self._run.counts]

    def empty_cloud(self) -> dict[str, NDArray[Any]] | None:
        """Return the arrays of a cloud without points; None for a run without clouds."""
        first = self._cloud(next(iter(self._clouds))) if self._clouds else None
        return None if first is None else {name: values[:0] for name, values in first.items()}

    def _message(self, stream: Stream, row: int) -> Any:
        return self._storage.message(stream.topic, int(stream.chunk[row]), int(stream.offset[row]))


def sides_of(run: Run) -> list[str]:
    """Cameras with photographs and labels."""
    return [side for side in table.SIDES if {table.photograph(side), table.tag(side)} <= set(run.counts)]


class _Geometry:
    """Poses and calibration, as far as the bag has them."""

    def __init__(self, run: Run, sides: list[str]) -> None:
        has_pose = table.ODOMETRY in run.counts or table.MODEL_STATES in run.counts
        self._trajectory = read_trajectory(run) if has_pose else None
        static = read_static_frames(run) if table.TF_STATIC in run.counts else None
        self.cameras = {side: _camera(run, side, static) for side in sides if table.camera_info(side) in run.counts}
        self.lidar: dict[str, Any] = {}
        if static is not None and table.POINTS in run.counts:
            frame = first_message(run, table.POINTS).header.frame_id
            self.lidar = {"frame_id": frame, "base_from_lidar": static.base_from(frame).tolist()}

    def at(self, stamp_ns: int, *, has_cloud: bool) -> dict[str, Any]:
        """Poses and calibration at a stamp, as JSON."""
        world_from_base = None if self._trajectory is None else self._trajectory.world_from_base(stamp_ns)
        about: dict[str, Any] = {} if world_from_base is None else {"world_from_base": world_from_base.tolist()}
        cameras = {side: _placed(camera, "camera", world_from_base) for side, camera in self.cameras.items()}
        lidar = {"lidar": _placed(self.lidar, "lidar", world_from_base)} if has_cloud else {}
        return about | {"cameras": cameras} | lidar


def _placed(sensor: Mapping[str, Any], kind: str, world_from_base: Array | None) -> dict[str, Any]:
    """Calibration of a sensor, with its pose in the world if both are known."""
    mount = sensor.get(f"base_from_{kind}")
    if world_from_base is None or mount is None:
        return dict(sensor)
    return {**sensor, f"world_from_{kind}": (world_from_base @ np.array(mount)).tolist()}


def _camera(run: Run, side: str, static: StaticFrames | None) -> dict[str, Any]:
    info = first_message(run, table.camera_info(side))
    frame = info.header.frame_id
    camera = {
        "frame_id": frame,
        "K": np.asarray(info.K, np.float64).reshape(3, 3).tolist(),
        "P": np.asarray(info.P, np.float64).reshape(3, 4).tolist(),
        "distortion_model": info.distortion_model,
        "D": np.asarray(info.D, np.float64).tolist(),
    }
    return camera if static is None else camera | {"base_from_camera": static.base_from(frame).tolist()}


def checked_jpeg(message: Any, shape: tuple[int, ...]) -> bytes:
    """Return the JPEG of a photograph.

    Args:
        message: sensor_msgs/CompressedImage.
        shape: (h, w) of its tag image.

    Raises:
        BagError: it is not a JPEG, or one of another size.
    """
    data = bytes(message.data)
    try:
        height, width, *_ = simplejpeg.decode_jpeg_header(data)
    except ValueError:
        raise BagError("the photograph is not a JPEG") from None
    if (height, width) != shape:
        tag = f"its tag image has {shape[1]} x {shape[0]} pixels"
        raise BagError(f"the photograph is a JPEG of {width} x {height} pixels; {tag}")
    return data
