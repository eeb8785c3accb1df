# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Sensors against bare Embree: the same rays from the same poses, in turns, so that other load slows both equally.

All cores work at consecutive views of a drive, one try each, as when a run is recorded: a second try would find its
part of the scene in the processor's cache, and a thread alone has the memory to itself.
"""

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, thread_time
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.topics import topics_of
from fieldtruth.bench.bare import BareTracer, best_mode
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.cache_folder import keep_temporary_files_in_memory
from fieldtruth.core.lenses import directions
from fieldtruth.drive.track import Stamps, Track, stamps_at_rate
from fieldtruth.experiment.rig import Rig
from fieldtruth.record.slices import Slices
from fieldtruth.record.streams import Sensors, Stream, streams_of
from fieldtruth.render.bake import BakedScene
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.sensors.camera.sensing import IdealCamera
from fieldtruth.sensors.kind import At, Movement, SensorWorld, movement_of
from fieldtruth.sensors.known import new_sensors
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import IdealLidar, ray_directions

_SECOND_NS: Final = 10**9


class Stretches(NamedTuple):
    """The first ``views`` readings of each sensor in some ``seconds`` of a drive, counted from 0; each is one slice."""

    seconds: tuple[int, ...]
    views: int

    def rows(self, stamps_ns: Stamps) -> list[NDArray[np.int64]]:
        """Return the numbers of these readings among all ``stamps_ns``, for each second."""
        ends = (np.searchsorted(stamps_ns, [k * _SECOND_NS, (k + 1) * _SECOND_NS], side="right") for k in self.seconds)
        return [np.arange(first, min(first + self.views, last)) for first, last in ends]


def stretches_of(duration_s: float, views: int, workers: int) -> Stretches:
    """Spread about ``views`` over six stretches of a drive, or the next multiple of ``workers``, evenly spaced."""
    number, whole = workers * -(-6 // workers), max(1, int(duration_s))
    seconds = sorted({int((k + 0.5) * whole / number) for k in range(number)})
    return Stretches(tuple(seconds), -(-views // len(seconds)))


@contextmanager
def recording(baked: BakedScene, track: Track, rig: Rig, stretches: Stretches, workers: int) -> Iterator[Slices]:
    """Give the slices of what the cameras and LiDARs of a rig see, to be made by ``workers`` threads."""
    rig = rig.model_copy(update={"sensors": (*rig.enabled(CameraConfig), *rig.enabled(LidarConfig))})
    topics = [topic for topic in topics_of(rig) if topic.sensor]
    names = {topic.name for topic in topics}
    every = streams_of(baked.scene.world, track, rig)
    streams = [_only(stretches, stream) for stream in every if names.issuperset(stream.topics)]
    ready = [sensors_of(baked, rig, used=True) for _ in range(workers)]
    keep_temporary_files_in_memory()
    with TemporaryDirectory() as folder:
        yield Slices(Path(folder), streams, topics, ready.pop, slice_ns=_SECOND_NS)


def _only(stretches: Stretches, stream: Stream) -> Stream:
    rows = np.concatenate(stretches.rows(stream.stamps_ns))
    return Stream(stream.topics, stream.stamps_ns[rows], lambda k, sensors: stream.messages(rows[k], sensors))


def seconds_of(work: Callable[..., object], *given: object) -> Array:
    """Return the processor time [s] of a call in this thread, which other load changes little, and its time [s]."""
    start = np.array([thread_time(), perf_counter()])
    work(*given)
    took: Array = np.array([thread_time(), perf_counter()]) - start
    return took


def sensors_of(baked: BakedScene, rig: Rig, *, used: bool = False) -> Sensors:
    """The sensors of one worker in a scene that all share.

    ``used``: after the first use of their memory, which a long run pays once.
    """
    sensors = new_sensors(SensorWorld(baked.scene.world, rig, baked=baked, reuse=True))
    still = Movement(lambda stamps: np.tile(np.eye(4), (*np.shape(stamps), 1, 1)))
    for sensor in sensors.values() if used else ():
        for output in sensor.config.outputs():
            sensor.read(output, At(0, 0, 0, still))
    return sensors


_TRIAL_POSES = 4
_STEP: Final = transforms.pose((0.01, 0.0, 0.04), (0.0, 0.5, 0.0))
"""From an optical frame to that of the next image: 1 m/s and 12 deg/s at 25 Hz."""
Group = list[Callable[[Array], object]]
"""Bare Embree or a sensor, called with its pose, and those that need its result."""


def pixel_directions(config: CameraConfig) -> Float32Array:
    """Unit directions (h, w, 3) through the pixel centres in the optical frame.

    Pixels for which the lens has no ray get the optical axis, because bare Embree traces rows and columns.
    """
    u, v = np.arange(config.width), np.arange(config.height)[:, None]
    found = np.asarray(directions(config.projection, u, v), np.float32)
    return np.where(np.isnan(found), np.array([0.0, 0.0, 1.0], np.float32), found)


@dataclass(frozen=True)
class Views:
    """Poses of a sensor in each stretch of the drive, and what takes turns there: bare Embree and sensors."""

    poses: list[list[Array]]
    new_groups: Callable[[], list[Group]]
    """Makes those of one thread."""

    @property
    def count(self) -> int:
        """Number of views."""
        return sum(map(len, self.poses))


def measure_lidars(scene: Scene, track: Track, rig: Rig, stretches: Stretches, workers: int) -> dict[str, float]:
    """Rates of labelled scans of all LiDARs and of bare rays, each in a thread of its own; empty without LiDAR."""
    if not rig.enabled(LidarConfig):
        return {}
    views, rays = [], 0
    for config in rig.enabled(LidarConfig):
        directions = ray_directions(config).astype(np.float32)
        poses = _poses(track, stretches, config.rate_hz, [config.mount.base_from_sensor])
        views.append(_views(scene, directions, config.max_range, poses, partial(_scans, config, scene)))
        rays += views[-1].count * directions.size // 3
    bare, scan = _core_seconds(views, workers)[:, 0].tolist()
    return {
        "lidar_mrays_per_s": rays / 1e6 / scan,
        "lidar_bare_mrays_per_s": rays / 1e6 / bare,
        "lidar_over_bare": scan / bare,
    }


def measure_cameras(
    baked: BakedScene, track: Track, rig: Rig, stretches: Stretches, slices: Slices, workers: int
) -> dict[str, float]:
    """Label images and photographs of all cameras against bare rays, and the recording of the same views as ``slices``.

    Pairs are counted if the only cameras are a stereo pair.
    """
    views, rays = [], 0
    for config in rig.enabled(CameraConfig):
        directions = pixel_directions(config)
        poses = _poses(track, stretches, config.rate_hz, [imager.base_from_optical for imager in config.imagers()])
        views.append(_views(baked.scene, directions, config.far, poses, partial(_images, config, baked)))
        rays += views[-1].count * directions.size // 3
    seconds = _core_seconds(views, workers, lambda k: slices.make_one(stretches.seconds[k]))
    bare, label, photo, normals, flow, recorded = seconds[:, 0].tolist()
    found = {
        "camera_bare_mrays_per_s": rays / 1e6 / bare,
        "label_image_over_bare": label / bare,
        "photograph_over_bare": photo / bare,
        "normals_over_bare": normals / bare,
        "flow_over_bare": flow / bare,
        "images_per_s": sum(each.count for each in views) * workers / float(seconds[-1, 1]),
    }
    if len(rig.enabled(CameraConfig)) == 1 and len(rig.imagers) == 2:
        found["stereo_pairs_per_s"] = found["images_per_s"] / 2.0
    return found | {"image_efficiency": bare / recorded}


def _poses(track: Track, stretches: Stretches, rate_hz: float, mounts: Sequence[Array]) -> list[list[Array]]:
    """Poses world_from_sensor (4, 4) in each stretch, of several sensors one after another at each stamp."""
    stamps, movement = stamps_at_rate(rate_hz, int(track.motion.stamps_ns[-1])), movement_of(track)
    return [
        [movement.pose(int(stamp)) @ mount for stamp in stamps[rows] for mount in mounts]
        for rows in stretches.rows(stamps)
    ]


def _scans(config: LidarConfig, scene: Scene) -> list[Group]:
    return [[IdealLidar(config, scene).scan]]


def _images(config: CameraConfig, baked: BakedScene) -> list[Group]:
    camera = IdealCamera(config, baked, reuse=True)
    geometry = LabelCamera(config.model_copy(update={"normals": True}), baked.scene, reuse=True)

    def flow(pose: Array) -> object:  # from the labels that the camera has just made from the same pose
        assert geometry.last is not None
        return geometry.flow(geometry.last, pose, pose @ _STEP)

    return [[camera.label], [camera.render], [geometry.label, flow]]


def _views(
    scene: Scene,
    directions: Float32Array,
    far: float,
    poses: list[list[Array]],
    new_sensors: Callable[[], list[Group]],
) -> Views:
    """Views of a sensor with rays in these directions, with bare Embree in its best mode."""
    handle, first = scene.rays.handle, [stretch[0] for stretch in poses if stretch]
    mode = best_mode(handle, directions, far, first[:: -(-len(first) // _TRIAL_POSES)])
    return Views(poses, lambda: [[BareTracer(handle, directions, far, mode).trace], *new_sensors()])


def _core_seconds(views: Sequence[Views], workers: int, record: Callable[[int], object] | None = None) -> Array:
    """Return the times [s] of each sensor and of ``record``, if given, as ``seconds_of``, summed over all threads.

    Each thread takes stretch after stretch of the drive, measures its views, one try each, and records them.
    """
    ready, local = [[each.new_groups() for each in views] for _ in range(workers)], threading.local()
    for each, groups in ((each, groups) for made in ready for each, groups in zip(views, made, strict=True)):
        for group in groups:
            _seconds(group, each.poses[0][:1])  # compiled, and its memory used, before the clock runs

    def stretch(k: int) -> Array:
        if not hasattr(local, "groups"):
            local.groups = ready.pop()
        seconds = sum(
            np.concatenate([_seconds(group, each.poses[k]) for group in groups])
            for each, groups in zip(views, local.groups, strict=True)
            if each.poses[k]
        )
        return np.vstack([seconds, seconds_of(record, k)]) if record else np.asarray(seconds)

    with ThreadPoolExecutor(workers) as pool:
        total: Array = np.sum(list(pool.map(stretch, range(len(views[0].poses)))), axis=0)
    return total


def _seconds(group: Group, poses: Sequence[Array]) -> Array:
    """Times [s] of each of a group, as ``seconds_of``, over consecutive views.

    Other work between them would leave less of the scene in the processor's cache.
    """
    total: Array = np.sum([[seconds_of(call, pose) for call in group] for pose in poses], axis=0)
    return total
