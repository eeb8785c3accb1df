# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Recording of images and scans as in a run: rendered or scanned, encoded and written as time slices."""

from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.bag.topics import topics_of
from fieldtruth.core.cache_folder import keep_temporary_files_in_memory
from fieldtruth.drive.track import Track
from fieldtruth.experiment.rig import Rig
from fieldtruth.record.slices import Slices
from fieldtruth.record.stream import Sensors
from fieldtruth.record.streams import streams_of
from fieldtruth.render.bake import BakedScene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.kind import At, Movement, SensorWorld
from fieldtruth.sensors.known import new_sensors
from fieldtruth.sensors.lidar.config import LidarConfig

SECONDS: Final = 4
"""Simulated time [s] that is recorded, one slice per second: a multiple of the usual numbers of workers."""


class Recorded(NamedTuple):
    """Time [s] of a recording, and what it recorded."""

    took_s: float
    images: int
    scans: int


def images_per_second(baked: BakedScene, track: Track, rig: Rig, *, images: int, workers: int) -> float:
    """Images per second that ``workers`` threads record, over about ``images`` of each camera at the track's start."""
    rate = max(1.0, images / min(SECONDS, track.duration_s))
    cameras = tuple(camera.model_copy(update={"rate_hz": rate}) for camera in rig.cameras)
    found = record(baked, track, rig.model_copy(update={"sensors": cameras}), workers=workers)
    return found.images / found.took_s


def record(baked: BakedScene, track: Track, rig: Rig, *, workers: int, seconds: float = SECONDS) -> Recorded:
    """Record what the cameras and LiDARs of a rig see in the first seconds of a track, with ``workers`` threads."""
    rig = rig.model_copy(update={"sensors": (*rig.enabled(CameraConfig), *rig.enabled(LidarConfig))})
    topics = [topic for topic in topics_of(rig) if topic.sensor]
    names = {topic.name for topic in topics}
    streams = [
        stream._replace(stamps_ns=stream.stamps_ns[stream.stamps_ns <= seconds * 1e9])
        for stream in streams_of(baked.scene.world, track, rig)
        if names.issuperset(stream.topics)
    ]
    ready = [sensors_of(baked, rig, used=True) for _ in range(workers)]
    keep_temporary_files_in_memory()
    with TemporaryDirectory() as folder:
        slices = Slices(Path(folder), streams, topics, ready.pop)
        start = perf_counter()
        slices.make(workers)
        took = perf_counter() - start
    clouds = {lidar.topic for lidar in rig.lidars}
    scans = sum(len(stream.stamps_ns) for stream in streams if clouds.issuperset(stream.topics))
    return Recorded(took, sum(len(stream.stamps_ns) for stream in streams) - scans, scans)


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
