# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Frames of a run for data sets of many runs: photographs, labels, clouds, poses and calibration at one stamp.

A frame is a stamp at which all recorded images of the chosen cameras exist. It has the clouds with the same stamp.
Without cameras each cloud is a frame.
"""

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from fieldtruth.bag import decode as read
from fieldtruth.bag import topics as table
from fieldtruth.bag.calibration import StaticFrames, first_message, read_static_frames
from fieldtruth.bag.reader import BagError, open_bag
from fieldtruth.bag.run import Run
from fieldtruth.bag.trajectory import Trajectory, read_trajectory
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.datasets.association import Stream, matched, read_streams
from fieldtruth.datasets.storage import Storage
from fieldtruth.exporters.sequences import returns
from fieldtruth.ontology.label_map import LabelMap
from fieldtruth.sensors.camera.config import EXTRAS, Imager
from fieldtruth.sensors.lidar.config import LidarConfig

LIDAR: Final = "lidar"
"""Name of the LiDAR whose entries are not named after it: the paper's."""


class View(NamedTuple):
    """Images of a camera."""

    jpeg: bytes
    """The photograph, byte for byte as in the bag."""
    mask: NDArray[np.uint8]
    """(h, w) class ids."""
    extras: dict[str, NDArray[Any]]
    """``depth`` (h, w) float32 [m] along the optical axis, infinite in the sky, ``instances`` (h, w) ids,
    ``normals`` (h, w, 3) float32 and ``flow`` (h, w, 2) float32 [pixel]."""


class Frame(NamedTuple):
    """What was measured at a stamp."""

    stamp_ns: int
    views: dict[str, View]
    """By name of the camera's view: left, right."""
    clouds: dict[str, dict[str, NDArray[Any]]]
    """By LiDAR: ``xyz`` (n, 3) float32 [m] in its frame, ``label`` (n,) class ids, and other fields (n,)."""
    about: dict[str, Any]
    """Poses (4, 4) and calibration, as JSON."""


class Source:
    """A run and an ontology, with what all frames share."""

    def __init__(self, run: Run, label_map: LabelMap) -> None:
        self.run, self.ids = run, label_map.ids

    @cached_property
    def trajectory(self) -> Trajectory | None:
        """True poses, if the bag has them."""
        has_pose = table.ODOMETRY in self.run.counts or table.MODEL_STATES in self.run.counts
        return read_trajectory(self.run) if has_pose else None

    @cached_property
    def static(self) -> StaticFrames | None:
        """Mounts, if the bag has them."""
        return read_static_frames(self.run) if table.TF_STATIC in self.run.counts else None


class Frames:
    """The frames of some views and LiDARs of a run, by index; may be read from several threads.

    Without views each cloud of the LiDAR is a frame. ``extras`` are read if they are recorded.

    Raises:
        BagError: no stamp is common to all images, or the bag is damaged.
    """

    def __init__(
        self,
        source: Source,
        imagers: Sequence[Imager],
        lidars: Sequence[LidarConfig] = (),
        extras: Collection[str] = EXTRAS,
    ) -> None:
        run = source.run
        self._run, self._ids = run, source.ids
        self._topics = {imager.name: _image_topics(run, imager, extras) for imager in imagers}
        images = [topic for topics in self._topics.values() for topic in topics.values()]
        clouds = {lidar.name: lidar.topic for lidar in lidars}
        with open_bag(run.bag, true_stamps=run.clocked) as bag:
            self._storage = Storage(bag)
            streams = read_streams(bag, self._storage, [*images, *clouds.values()])
        chosen = matched([streams[topic] for topic in images or clouds.values()])
        self.stamps_ns: Counts = chosen[0].stamps_ns
        """(len,) stamp [ns] of each frame."""
        if not len(self.stamps_ns):
            raise BagError(f"{run.bag} has no frame: no stamp is common to {', '.join(images)}")
        self._streams = {stream.topic: stream for stream in chosen}
        self._clouds = {name: streams[topic] for name, topic in clouds.items()}
        self._row_at = {
            name: {int(stamp): k for k, stamp in enumerate(stream.stamps_ns)} for name, stream in self._clouds.items()
        }
        self._geometry = _Geometry(source, imagers, lidars)

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def __getitem__(self, i: int) -> Frame:
        """Read a frame.

        Raises:
            BagError: the bag is damaged, has changed, or has a colour that no class has.
        """
        stamp = int(self.stamps_ns[i])
        views = {name: self._view(name, i) for name in self._topics}
        clouds = {name: self._cloud(name, rows[stamp]) for name, rows in self._row_at.items() if stamp in rows}
        about = {"stamp_ns": stamp} | self._geometry.at(stamp, clouds)
        return Frame(stamp, views, clouds, about)

    def _view(self, name: str, i: int) -> View:
        messages = {kind: self._message(self._streams[topic], i) for kind, topic in self._topics[name].items()}
        where = f"{name} camera at {int(self.stamps_ns[i])} ns in {self._run.bag}"
        try:
            mask = np.take(self._ids, read.labels(read.image(messages["tag"])))
            extras: dict[str, NDArray[Any]] = {
                kind: getattr(read, kind)(messages[kind]) for kind in EXTRAS if kind in messages
            }
            jpeg = checked_jpeg(messages["photograph"], mask.shape)
        except BagError as error:
            raise BagError(f"{where}: {error}") from error
        return View(jpeg, mask, extras)

    def _cloud(self, name: str, row: int) -> dict[str, NDArray[Any]]:
        found = returns(self._message(self._clouds[name], row), self._run)
        fields = found.rows.dtype.names or ()
        cloud: dict[str, NDArray[Any]] = {
            "xyz": np.stack([found.rows[axis].astype("<f4") for axis in "xyz"], axis=1),
            "label": np.take(self._ids, found.label),
        }
        measured = read.MEASURED if "true_range" in fields else ()
        cloud |= {
            name: np.ascontiguousarray(found.rows[name])
            for name in ("instance", "ring", "column", "t", *measured)
            if name in fields
        }
        return cloud | ({"reflectivity": read.reflectivity(found.rows)} if measured else {})

    def empty_clouds(self) -> dict[str, dict[str, NDArray[Any]]]:
        """Return the arrays of a cloud without points of each LiDAR."""
        first = {name: self._cloud(name, 0) for name in self._clouds}
        return {name: {field: values[:0] for field, values in cloud.items()} for name, cloud in first.items()}

    def _message(self, stream: Stream, row: int) -> Any:
        return self._storage.message(stream.topic, int(stream.chunk[row]), int(stream.offset[row]))


def cameras_of(run: Run) -> dict[str, list[Imager]]:
    """Views with photographs and labels, by name of the camera or pair."""
    labelled = {
        camera.name: [
            imager
            for imager in camera.imagers()
            if {imager.topic_of("photograph"), imager.topic_of("tag")} <= run.counts.keys()
        ]
        for camera in run.rig.cameras
    }
    return {name: imagers for name, imagers in labelled.items() if imagers}


def lidars_of(run: Run) -> list[LidarConfig]:
    """LiDARs with clouds."""
    return [lidar for lidar in run.rig.lidars if lidar.topic in run.counts]


def require_frames(run: Run, *, clouds: bool) -> None:
    """Check that a run has photographs with labels, or with ``clouds`` at least clouds.

    Raises:
        BagError: it names the topics of the first camera and LiDAR.
    """
    if cameras_of(run) or (clouds and lidars_of(run)):
        return
    needed = [f"{each.topic_of('photograph')} with {each.topic_of('tag')}" for each in run.rig.imagers[:1]]
    needed += [lidar.topic for lidar in run.rig.lidars[:1] if clouds]
    what = ", or ".join(needed) or f"camera{' or LiDAR' * clouds}"
    raise BagError(f"{run.bag} has no {what}; available: {', '.join(sorted(run.counts))}")


def count_common(run: Run, imagers: Sequence[Imager]) -> int:
    """Return the number of stamps at which all images of these views exist.

    Raises:
        BagError: the bag is damaged.
    """
    topics = [topic for imager in imagers for topic in _image_topics(run, imager, EXTRAS).values()]
    with open_bag(run.bag, true_stamps=run.clocked) as bag:
        return len(matched([*read_streams(bag, Storage(bag), topics).values()])[0].stamps_ns)


def _image_topics(run: Run, imager: Imager, extras: Collection[str]) -> dict[str, str]:
    """Recorded topics of a view by stream: photograph, tag, and as far as recorded ``extras``."""
    topics = {stream: imager.topic_of(stream) for stream in ("photograph", "tag", *extras)}
    return {stream: topic for stream, topic in topics.items() if topic in run.counts}


class _Geometry:
    """Poses and calibration, as far as the bag has them."""

    def __init__(self, source: Source, imagers: Sequence[Imager], lidars: Sequence[LidarConfig]) -> None:
        run, static = source.run, source.static
        self._trajectory = source.trajectory
        known = [imager for imager in imagers if imager.topic_of("camera_info") in run.counts]
        self.cameras = {imager.name: _camera(run, imager, static) for imager in known}
        self.lidars = {lidar.name: _lidar(run, lidar, static) for lidar in lidars}

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


def _camera(run: Run, imager: Imager, static: StaticFrames | None) -> dict[str, Any]:
    info = first_message(run, imager.topic_of("camera_info"))
    frame = info.header.frame_id
    camera = {
        "frame_id": frame,
        "K": np.asarray(info.K, np.float64).reshape(3, 3).tolist(),
        "P": np.asarray(info.P, np.float64).reshape(3, 4).tolist(),
        "distortion_model": info.distortion_model,
        "D": np.asarray(info.D, np.float64).tolist(),
    }
    return camera if static is None else camera | {"base_from_camera": static.base_from(frame).tolist()}


def _lidar(run: Run, lidar: LidarConfig, static: StaticFrames | None) -> dict[str, Any]:
    if static is None:
        return {}
    frame = first_message(run, lidar.topic).header.frame_id
    return {"frame_id": frame, "base_from_lidar": static.base_from(frame).tolist()}


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
