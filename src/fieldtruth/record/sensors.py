# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The sensors of a rig in a world, one set per worker thread, and the streams of their messages."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from fieldtruth.drive.track import Stamps, Track
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import SensorConfig
from fieldtruth.experiment.topic import Output
from fieldtruth.record.clocks import ClockReadings, clock_of
from fieldtruth.record.stream import Sensors, Stream
from fieldtruth.sensors.kind import At, Movement, SensorWorld, stamps_of
from fieldtruth.sensors.known import new_sensors


def sensor_factory(sensor_world: SensorWorld, rig: Rig | None = None) -> Callable[[], Sensors]:
    """Build what the sensors of a rig need, scene and light, and return the function that makes a set for a thread."""
    ready = [new_sensors(sensor_world, rig)]

    def make() -> Sensors:
        try:
            return ready.pop()
        except IndexError:
            return new_sensors(sensor_world, rig)

    return make


@dataclass(frozen=True)
class Series:
    """Readings of an output of a sensor, in the order of their stamps; those that its clock loses are left out."""

    config: SensorConfig
    output: Output
    stamps_ns: Stamps
    """True stamps (n,) [ns] of all readings, with the lost ones."""
    clock: ClockReadings

    def at(self, k: int, movement: Movement, end_ns: float = math.inf) -> At:
        """Return when and where the k-th reading is taken that is not lost; none follows it after ``end_ns``."""
        number, after = int(self.clock.kept[k]), self.clock.kept[k + 1 : k + 2]
        following = [int(self.stamps_ns[i]) for i in after if self.stamps_ns[i] <= end_ns]
        stamp, header = int(self.stamps_ns[number]), int(self.clock.shown_ns[number])
        return At(number, stamp, header, movement, following[0] if following else None)


def series_of(config: SensorConfig, rig: Rig, stamps_of: Callable[[Output], Stamps], seed: int) -> list[Series]:
    """Return the series of a sensor, one for each of its outputs.

    Args:
        config: the sensor.
        rig: the robot that carries it.
        stamps_of: true stamps [ns] of the readings of an output.
        seed: of the sensor's clock.
    """
    series = []
    for output in config.outputs_on(rig.robot):
        stamps = stamps_of(output)
        exact = ClockReadings(stamps, np.arange(len(stamps)))
        clock = exact if output.ideal else clock_of(config, stamps, seed, output.clock)
        series.append(Series(config, output, stamps, clock))
    return series


def series_along(config: SensorConfig, rig: Rig, track: Track, seed: int) -> list[Series]:
    """Return the series of a sensor along a drive; at separate poses, sensors that measure the motion have none."""
    stamps = track.motion.stamps_ns
    if track.is_frames:
        return series_of(config, rig, lambda _: stamps, seed) if config.sees else []
    return series_of(config, rig, lambda output: stamps_of(config, output, int(stamps[-1])), seed)


def stream_of(series: Series, movement: Movement) -> Stream:
    """Return the stream of a series along a movement."""
    output = series.output

    def messages(k: int, sensors: Sensors) -> Iterable[bytes]:
        at, sensor = series.at(k, movement), sensors[series.config.name]
        return sensor.messages(output, at.number, sensor.read(output, at))

    return Stream(tuple(topic.name for topic in output.topics), series.stamps_ns[series.clock.kept], messages)
