# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Recording of images and scans as in a run: rendered or scanned, encoded and written as time slices."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, thread_time
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.topics import topics_of
from fieldtruth.core.arrays import Array
from fieldtruth.core.cache_folder import keep_temporary_files_in_memory
from fieldtruth.drive.track import Stamps, Track
from fieldtruth.experiment.rig import Rig
from fieldtruth.record.slices import Slices
from fieldtruth.record.streams import Sensors, Stream, streams_of
from fieldtruth.render.bake import BakedScene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.kind import At, Movement, SensorWorld
from fieldtruth.sensors.known import new_sensors
from fieldtruth.sensors.lidar.config import LidarConfig

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


class Recorded(NamedTuple):
    """Time [s] of a recording, and what it recorded."""

    took_s: float
    images: int
    scans: int


def record(baked: BakedScene, track: Track, rig: Rig, stretches: Stretches, *, workers: int) -> Recorded:
    """Record what the cameras and LiDARs of a rig see, with ``workers`` threads.

    The time is that of all threads over their number, as in a long recording, in which none waits at the end.
    """
    with recording(baked, track, rig, stretches, workers) as slices, ThreadPoolExecutor(workers) as pool:
        took = sum(pool.map(lambda k: float(seconds_of(slices.make_one, k)[1]), stretches.seconds)) / workers
    clouds = {lidar.topic for lidar in rig.lidars}
    scans = sum(len(stream.stamps_ns) for stream in slices.streams if clouds.issuperset(stream.topics))
    return Recorded(took, sum(len(stream.stamps_ns) for stream in slices.streams) - scans, scans)


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
    return Stream(stream.topics, stream.stamps_ns[rows], lambda k, sensors: stream.messages(int(rows[k]), sensors))


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
