# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Streams of messages from world, track and rig, and the clocks that stamp them.

Each stream has its stamps and can make any of its readings. A reading depends only on its number, so parts of a
recording can be made in any order and by any thread, each of which has sensors of its own.

Clocks of sensors: what the headers of their messages say, and which messages are lost. The stamp of a message in the
bag stays the true time of its reading. A clock shows, at the time t, t + offset + drift t + jitter with a jitter that
is normal and of each reading its own. Stamps rise: where the jitter is so large that they would not, a stamp is 1 ns
above the one before. A reading whose clock shows 0 or less is lost, as ROS has no such time.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import messages, topics
from fieldtruth.core.arrays import Counts
from fieldtruth.core.classes import GROUND_ID
from fieldtruth.core.random import rng_of
from fieldtruth.drive.track import Commands, Motion, Stamps, Track, stamps_at_rate
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import ClockConfig, Output, SensorConfig
from fieldtruth.sensors.kind import At, MotionSensor, Movement, Sensor, SensorWorld, movement_of, stamps_of
from fieldtruth.sensors.known import new_sensors
from fieldtruth.world.model import World

_CLOCK: Final = "clock"


@dataclass(frozen=True)
class ClockReadings:
    """Times (n,) [ns] that the clock of a sensor shows at its readings, and the numbers of those that are not lost."""

    shown_ns: Stamps
    kept: NDArray[np.int64]


def read_clock(stamps_ns: Stamps, config: ClockConfig, rng: np.random.Generator) -> ClockReadings:
    """Return what a clock shows at true stamps (n,) [ns], and which of the readings are lost."""
    of_jitter, of_drops = rng.spawn(2)
    error_s = config.offset_s + config.drift_ppm * 1e-6 * (stamps_ns / 1e9)
    error_s = error_s + config.jitter_s * of_jitter.standard_normal(len(stamps_ns))
    order = np.arange(len(stamps_ns))
    shown = np.maximum.accumulate(stamps_ns + np.rint(error_s * 1e9).astype(np.int64) - order) + order
    lost = of_drops.random(len(stamps_ns)) < config.drop_share
    return ClockReadings(shown, np.flatnonzero(~lost & (shown > 0)))


Sensors = Mapping[str, Sensor]
"""The sensors of one worker by name; they own buffers, so threads must not share them."""


class Stream(NamedTuple):
    """Readings of one source: reading k is taken at ``stamps_ns[k]`` and makes one message for each of ``topics``."""

    topics: tuple[str, ...]
    stamps_ns: Stamps
    messages: Callable[[Counts, Sensors], Iterable[Iterable[bytes]]]
    """Makes the messages of readings, given by their numbers (n,), n > 0; each when it is asked for, or all at once."""


def sensor_factory(sensor_world: SensorWorld, rig: Rig | None = None) -> Callable[[], Sensors]:
    """Build what the sensors of a rig need, scene and light, and return the function that makes a set for a thread."""
    ready = [new_sensors(sensor_world, rig)]
    if any(sensor.needs_light for sensor in ready[0].values()):
        sensor_world.baked  # noqa: B018

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

    def all_at(self, rows: Counts, movement: Movement) -> At:
        """Return when and where several readings (n,) are taken."""
        numbers = self.clock.kept[rows]
        return At(numbers, self.stamps_ns[numbers], self.clock.shown_ns[numbers], movement)


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
        clock = ClockReadings(stamps, np.arange(len(stamps)))
        if config.clock is not None and not output.ideal:
            rng = rng_of(seed, config.name, _CLOCK, *[output.clock] * bool(output.clock))
            clock = read_clock(stamps, config.clock, rng)
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
    output, topics = series.output, tuple(topic.name for topic in series.output.topics)

    def messages(rows: Counts, sensors: Sensors) -> Iterable[Iterable[bytes]]:
        sensor = sensors[series.config.name]
        if isinstance(sensor, MotionSensor):
            at = series.all_at(rows, movement)
            made = iter(sensor.messages(output, at.number, sensor.read(output, at)))
            return zip(*[made] * len(topics), strict=True)
        each = (series.at(k, movement) for k in rows.tolist())
        return (sensor.messages(output, at.number, sensor.read(output, at)) for at in each)

    return Stream(topics, series.stamps_ns[series.clock.kept], messages)


def streams_of(
    world: World,
    track: Track,
    rig: Rig,
    *,
    latched: bool = False,
    movement: Movement | None = None,
    seed: int | None = None,
    robots: Mapping[str, Motion] | None = None,
    actors: messages.Actors | None = None,
) -> list[Stream]:
    """Return every stream of a recording, in the order of ``topics_of``.

    Args:
        world: what the sensors are in.
        track: the drive.
        rig: the sensors.
        latched: whether static objects come once.
        movement: that of the track, if it was made; it keeps what sensors have measured.
        seed: of the sensors' clocks; None for the world's.
        robots: motions of all robots of an experiment with several, by name, in the order of their ids.
        actors: motions of the actors, which have the ids behind.
    """
    end_ns, movement = int(track.motion.stamps_ns[-1]), movement or movement_of(track)
    poses = track.motion.stamps_ns if track.is_frames else stamps_at_rate(topics.POSE_RATE, end_ns)
    writers = [messages.ModelStatesWriter(world, rows, robots, actors) for rows in [None, GROUND_ID + 1][: 1 + latched]]
    streams = _truth(world, track, rig, poses, writers)
    if actors is not None:
        knots = stamps_at_rate(topics.KNOT_RATE, end_ns)
        streams.append(_small(topics.ACTOR_JOINTS, knots, lambda k: messages.actor_joints(actors, k, knots[k])))
    for config in rig.in_order():
        series = series_along(config, rig, track, world.seed if seed is None else seed)
        streams += [stream_of(each, movement) for each in series]
        if config.needs_wheels and track.base is not None:
            streams.append(_commands(track.base.commands))
    return streams


def _commands(commands: Commands) -> Stream:
    rows = commands.command
    return _small(topics.COMMANDS, commands.stamps_ns, lambda numbers: messages.commands(rows[numbers]))


def _small(topic: str, stamps_ns: Stamps, make: Callable[[Counts], Iterable[bytes]]) -> Stream:
    """Return the stream of messages that need no sensor, and are made many at once."""
    return Stream((topic,), stamps_ns, lambda numbers, _: ((data,) for data in make(numbers)))


def _truth(
    world: World, track: Track, rig: Rig, poses: Stamps, writers: Sequence[messages.ModelStatesWriter]
) -> list[Stream]:
    """Return the streams of the true motion; of two writers, the first is that of static objects."""
    motion, base = track.motion, track.base
    fixed = messages.fixed_transforms(rig, world.origin)
    every_step = motion.stamps_ns
    rows, mounts = np.searchsorted(every_step, poses), messages.wheel_mounts(rig)

    def tf(numbers: Counts) -> Iterable[bytes]:
        at = rows[numbers]
        wheels = {} if base is None else messages.wheel_transforms(mounts, base.wheels.angle[at])
        return messages.tf(numbers, motion.at(at), wheels)

    def all_objects(writer: messages.ModelStatesWriter) -> Callable[[Counts], Iterable[bytes]]:
        return lambda numbers: (writer.message(k, motion) for k in numbers.tolist())

    return [
        _small(topics.CLOCK, every_step, lambda numbers: messages.clocks(every_step[numbers])),
        _small(topics.TF_STATIC, every_step[:1], lambda _: [messages.tf_static(int(every_step[0]), fixed)]),
        *[_small(topics.STATIC_MODEL_STATES, every_step[:1], all_objects(each)) for each in writers[:-1]],
        _small(topics.MODEL_STATES, every_step, all_objects(writers[-1])),
        _small(topics.ODOMETRY, poses, lambda numbers: messages.odometry(numbers, motion.at(rows[numbers]))),
        _small(topics.TF, poses, tf),
    ]
