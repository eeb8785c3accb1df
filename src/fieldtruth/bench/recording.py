# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Recording of stereo pairs as in a run: photographs and tag images rendered, encoded and written as time slices."""

from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Final

import numpy as np

from fieldtruth.bag.topics import topics_of
from fieldtruth.drive.track import Track
from fieldtruth.experiment.rig import Rig
from fieldtruth.record.slices import Slices
from fieldtruth.record.streams import Sensors, streams_of
from fieldtruth.render.bake import BakedScene
from fieldtruth.render.camera import Camera

SECONDS: Final = 4
"""Simulated time [s] that is recorded, one slice per second: a multiple of the usual numbers of workers."""


def pairs_per_second(baked: BakedScene, track: Track, rig: Rig, *, pairs: int, workers: int) -> float:
    """Stereo pairs per second that ``workers`` threads record, over about ``pairs`` pairs of the track's start."""
    seconds = min(SECONDS, track.duration_s)
    cameras = rig.stereo.model_copy(update={"rate_hz": max(1.0, pairs / seconds)})
    rig = rig.model_copy(update={"sensors": (cameras,)})
    topics = [topic for topic in topics_of(rig) if topic.kind == "stereo"]
    names = {topic.name for topic in topics}
    streams = [
        stream._replace(stamps_ns=stream.stamps_ns[stream.stamps_ns <= seconds * 1e9])
        for stream in streams_of(baked.scene.world, track, rig)
        if names.issuperset(stream.topics)
    ]
    ready = [Camera(cameras, baked, reuse=True) for _ in range(workers)]
    for camera in ready:
        camera.render(np.eye(4))  # exclude the first use of each worker's memory, which a long run pays once
    with TemporaryDirectory() as folder:
        slices = Slices(Path(folder), streams, topics, lambda: Sensors(cameras={cameras.name: ready.pop()}))
        start = perf_counter()
        slices.make(workers)
        took = perf_counter() - start
    return len(streams[0].stamps_ns) / took
