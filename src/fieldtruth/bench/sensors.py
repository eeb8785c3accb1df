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
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, thread_time
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.topics import topics_of
from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.cache_folder import keep_temporary_files_in_memory
from fieldtruth.drive.track import Stamps, Track, stamps_at_rate
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import SensorConfig
from fieldtruth.kernels import packets
from fieldtruth.kernels.bare import FIELDS, TRACERS, BarePacket
from fieldtruth.record.slices import Slices
from fieldtruth.record.streams import Sensors, Stream, streams_of
from fieldtruth.render.bake import BakedScene
from fieldtruth.sensors.kind import At, Sensor, SensorWorld, movement_of, standing
from fieldtruth.sensors.known import new_sensors, sensor_class
from fieldtruth.simulation.stepped import Driven

_WORDS: Final = packets.RAYHIT_WORDS // packets.LANES
_SECOND_NS: Final = 10**9
_TRIAL_POSES: Final = 4


class Mode(NamedTuple):
    """Packets of ``lanes`` rays in tiles of ``rows`` x lanes / rows, with or without Embree's flag ``coherent``."""

    lanes: int
    rows: int
    coherent: bool


MODES: Final = (
    Mode(1, 1, False),  # the flag does not affect single rays
    *(Mode(8, rows, coherent) for rows in (1, 2, 4, 8) for coherent in (False, True)),
    *(Mode(16, rows, coherent) for rows in (1, 2, 4, 8, 16) for coherent in (False, True)),
)


class BareTracer:
    """Traces rays of fixed unit ``directions`` (rows, columns, 3) in the sensor's frame, up to ``far`` [m].

    It does less than any sensor, whose time is thus compared with a lower bound: directions are prepared in single
    precision in packet order, and what all rays share is set once.

    Raises:
        ValueError: rows and columns are not multiples of the tile.
    """

    def __init__(self, scene: np.uint64, directions: Float32Array, far: float, mode: Mode) -> None:
        rows, columns, lanes = mode.rows, mode.lanes // mode.rows, mode.lanes
        height, width = directions.shape[:2]
        if height % rows or width % columns:
            raise ValueError(f"rays must be a multiple of tiles of {rows} x {columns}, got {height} x {width}")
        self._tiles = (height // rows, rows, width // columns, columns)
        tiles = directions.reshape(*self._tiles, 3).transpose(0, 2, 4, 1, 3)
        self._directions = np.ascontiguousarray(tiles, np.float32).reshape(-1, 3, lanes)
        self._distance = np.zeros((len(self._directions), lanes), np.float32)
        ray, valid = packets.aligned(_WORDS * lanes), packets.aligned(lanes, np.int32)
        words, arguments = ray.view(np.uint32), packets.arguments_block(coherent=mode.coherent)
        words[FIELDS["MASK"] * lanes :][:lanes] = packets.MISS
        valid[:] = -1
        self._packet = BarePacket(ray, words, ray.ctypes.data, valid.ctypes.data, arguments.ctypes.data)
        self._kept = valid, arguments  # the packet has their addresses
        self._kernel = TRACERS[lanes]
        self._scene, self._far = scene, np.float32(far)

    def trace(self, world_from_sensor: Array) -> None:
        """Trace all rays from a pose (4, 4)."""
        pose = world_from_sensor.astype(np.float32)
        self._kernel(self._scene, self._packet, pose, self._directions, self._far, self._distance)

    @property
    def distances(self) -> Float32Array:
        """Distances [m] (rows, columns) of the last trace's hits; ``far`` for a miss."""
        tall, rows, wide, columns = self._tiles
        return (
            self._distance.reshape(tall, wide, rows, columns).transpose(0, 2, 1, 3).reshape(tall * rows, wide * columns)
        )


def best_mode(scene: np.uint64, directions: Float32Array, far: float, poses: Sequence[Array]) -> Mode:
    """Find the fastest mode: all whose tiles fit are tried from the first pose, the three best from all ``poses``."""

    def seconds(mode: Mode, poses: Sequence[Array]) -> float:
        tracer = BareTracer(scene, directions, far, mode)
        tracer.trace(poses[0])  # compiled, and its memory used, before the clock runs
        start = perf_counter()
        for pose in poses:
            tracer.trace(pose)
        return perf_counter() - start

    height, width = directions.shape[:2]
    fitting = [mode for mode in MODES if height % mode.rows == 0 and width % (mode.lanes // mode.rows) == 0]
    leaders = sorted(fitting, key=lambda mode: seconds(mode, poses[:1]))[:3]
    return min(leaders, key=lambda mode: seconds(mode, poses))


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
    """Give the slices of what the sensors of a rig see, to be made by ``workers`` threads."""
    rig = rig.model_copy(update={"sensors": tuple(each for each in rig.sensors if each.enabled and each.sees)})
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
    for sensor in sensors.values() if used else ():
        for output in sensor.config.outputs():
            sensor.read(output, At(0, 0, 0, standing(np.eye(4))))
    return sensors


Task = Callable[[Array], object]
"""Bare Embree or what a sensor makes of its rays, called with its pose."""


@dataclass(frozen=True)
class Views:
    """Poses of a sensor in each stretch of the drive; bare Embree and the sensor's tasks take turns there."""

    poses: list[list[Array]]
    rays: int
    """Of all views."""
    names: tuple[str, ...]
    """Of the tasks."""
    new_groups: Callable[[], list[list[Task]]]
    """Makes those of one thread; the tasks of a group need the results of those before them."""

    @property
    def count(self) -> int:
        """Number of views."""
        return sum(map(len, self.poses))


def measure_sensors(
    driven: Driven, sensors: Sequence[SensorConfig], stretches: Stretches, workers: int, slices: Slices | None = None
) -> dict[str, float]:
    """Rates of sensors of one class and of bare rays in the same directions, each in a thread of its own.

    With ``slices`` also of the recording of the same views; pairs are counted if the only sensor is one.
    """
    views = [each for each in (_views(driven, config, stretches) for config in sensors) if each is not None]
    if not views:
        return {}
    record = None if slices is None else lambda k: slices.make_one(stretches.seconds[k])
    seconds, rays = _core_seconds(views, workers, record), sum(each.rays for each in views)
    bare, tasks = float(seconds[0, 0]), dict(zip(views[0].names, seconds[1:, 0].tolist(), strict=False))
    family = sensors[0].family
    found = {
        f"{family}_mrays_per_s": rays / 1e6 / next(iter(tasks.values())),
        f"{family}_bare_mrays_per_s": rays / 1e6 / bare,
        **{f"{name}_over_bare": took / bare for name, took in tasks.items()},
    }
    if slices is not None:
        found["images_per_s"] = sum(each.count for each in views) * workers / float(seconds[-1, 1])
        if len(sensors) == 1 and len(_mounts(sensors[0])) == 2:
            found["pairs_per_s"] = found["images_per_s"] / 2.0
        found["image_efficiency"] = bare / float(seconds[-1, 0])
    return found


def _views(driven: Driven, config: SensorConfig, stretches: Stretches) -> Views | None:
    """Views of a sensor, with bare Embree in its best mode; None for one that has no rays."""

    def new_sensor() -> Sensor:
        return sensor_class(config)(config, driven.sensor_world)

    rays = new_sensor().rays()
    if rays is None:
        return None
    directions, handle = rays.directions, driven.sensor_world.scene.rays.handle
    poses = _poses(driven.track, stretches, config.rate_hz, _mounts(config))
    first = [stretch[0] for stretch in poses if stretch]
    mode = best_mode(handle, directions, rays.far, first[:: -(-len(first) // _TRIAL_POSES)])

    def new_groups() -> list[list[Task]]:
        own = new_sensor().rays()
        assert own is not None
        bare = BareTracer(handle, directions, rays.far, mode).trace
        return [[bare], *(list(group.values()) for group in own.tasks)]

    count = sum(map(len, poses)) * directions.size // 3
    return Views(poses, count, tuple(name for group in rays.tasks for name in group), new_groups)


def _mounts(config: SensorConfig) -> list[Array]:
    """Poses base_from_sensor (4, 4) of the frames of the readings that a sensor takes at a stamp."""
    frames = config.base_from_frames()
    return [frames[output.frame] for output in config.outputs() if not output.ideal]


def _poses(track: Track, stretches: Stretches, rate_hz: float, mounts: Sequence[Array]) -> list[list[Array]]:
    """Poses world_from_sensor (4, 4) in each stretch, of several sensors one after another at each stamp."""
    stamps, movement = stamps_at_rate(rate_hz, int(track.motion.stamps_ns[-1])), movement_of(track)
    return [
        [movement.pose(int(stamp)) @ mount for stamp in stamps[rows] for mount in mounts]
        for rows in stretches.rows(stamps)
    ]


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


def _seconds(group: Sequence[Task], poses: Sequence[Array]) -> Array:
    """Times [s] of each of a group, as ``seconds_of``, over consecutive views.

    Other work between them would leave less of the scene in the processor's cache.
    """
    total: Array = np.sum([[seconds_of(call, pose) for call in group] for pose in poses], axis=0)
    return total
