# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Stereo pairs through the very slices of a run: both photographs and tag images seen, encoded and written to disk."""

from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from fieldtruth.drive.track import Track
from fieldtruth.experiment.rig import Rig
from fieldtruth.record.slices import Slices
from fieldtruth.record.streams import Sensors, streams_of
from fieldtruth.record.topics import topics_of
from fieldtruth.sense import Camera, Scene


def pairs_per_second(scene: Scene, track: Track, rig: Rig, *, pairs: int, workers: int) -> float:
    """Rate at which so many threads make about ``pairs`` stereo pairs, spread evenly over the track."""
    cameras = rig.cameras.model_copy(update={"rate_hz": pairs / track.duration_s})
    rig = rig.model_copy(update={"cameras": cameras})
    topics = [topic for topic in topics_of(rig) if topic.sensor == "cameras"]
    names = {topic.name for topic in topics}
    streams = [stream for stream in streams_of(scene.world, track, rig) if names.issuperset(stream.topics)]
    with TemporaryDirectory() as folder:
        slices = Slices(Path(folder), streams, topics, lambda: Sensors(camera=Camera(cameras, scene)))
        start = perf_counter()
        slices.make(workers)
        took = perf_counter() - start
    return len(streams[0].stamps_ns) / took
