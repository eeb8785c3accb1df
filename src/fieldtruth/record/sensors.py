# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The sensors of a rig in a place, one set per worker thread, and the streams of their messages."""

from collections.abc import Callable, Iterable

import numpy as np

from fieldtruth.drive.track import Stamps
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import SensorConfig
from fieldtruth.experiment.topic import Output
from fieldtruth.record.clocks import ClockReadings, clock_of
from fieldtruth.record.stream import Sensors, Stream
from fieldtruth.sensors.kind import At, Movement, Place
from fieldtruth.sensors.known import new_sensors


def sensor_factory(place: Place, rig: Rig | None = None) -> Callable[[], Sensors]:
    """Build what the sensors of a rig need, scene and light, and return the function that makes a set for a thread."""
    ready = [new_sensors(place, rig)]

    def make() -> Sensors:
        try:
            return ready.pop()
        except IndexError:
            return new_sensors(place, rig)

    return make


def sensor_streams(
    config: SensorConfig, rig: Rig, stamps_of: Callable[[Output], Stamps], movement: Movement, seed: int
) -> list[Stream]:
    """Return the streams of a sensor, one for each of its outputs.

    Args:
        config: the sensor.
        rig: the robot that carries it.
        stamps_of: true stamps [ns] of the readings of an output.
        movement: motion of the robot.
        seed: of the sensor's clock.
    """
    streams = []
    for output in config.outputs_on(rig.robot):
        stamps = stamps_of(output)
        exact = ClockReadings(stamps, np.arange(len(stamps)))
        clock = exact if output.ideal else clock_of(config, stamps, seed, output.clock)
        streams.append(clock.without_lost(_stream(config.name, output, stamps, clock, movement)))
    return streams


def _stream(name: str, output: Output, stamps: Stamps, clock: ClockReadings, movement: Movement) -> Stream:
    following = np.append(clock.kept, -1)[np.searchsorted(clock.kept, np.arange(len(stamps)), side="right")]

    def messages(k: int, sensors: Sensors) -> Iterable[bytes]:
        after = int(following[k])
        next_ns = None if after < 0 else int(stamps[after])
        at, sensor = At(k, int(stamps[k]), int(clock.shown_ns[k]), movement, next_ns), sensors[name]
        return sensor.messages(output, k, sensor.read(output, at))

    return Stream(tuple(topic.name for topic in output.topics), stamps, messages)
