# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of kinds of sensors: those that a kind has of its own, and the one of all other kinds."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.bag.reader import RawMessage
from fieldtruth.drive.track import Motion, Track
from fieldtruth.experiment.topic import Output
from fieldtruth.sensors.kind import At, Sensor, SensorWorld, movement_of, stamps_of
from fieldtruth.sensors.known import OWN, sensor_class
from fieldtruth.validation.check import Rule, Spec, Tally
from fieldtruth.validation.context import Checker, Context, RebuiltWorld, Sampler, at
from fieldtruth.validation.rays import RayReference
from fieldtruth.validation.world import ObjectClasses


class Pass(NamedTuple):
    """What checkers share during the pass over a bag."""

    context: Context
    objects: ObjectClasses
    rays: RayReference | None
    """The second ray tracer, if the world was rebuilt."""
    full: bool
    """Whether every image is retraced, not a sample."""
    samples: int
    """Approximate number of sampled stamps."""

    def sampler(self) -> Sampler:
        """Return a choice of stamps."""
        return Sampler(self.context.run.start_ns, self.context.run.end_ns, self.samples)


def _nothing(context: Context) -> tuple[Spec, ...]:
    return ()


@dataclass(frozen=True)
class KindChecks:
    """Checks of a kind of sensor, by their position in the output."""

    make: Callable[[Pass], list[Checker]]
    """Makes the checkers of a pass."""
    motion: tuple[Spec, ...] = ()
    """Of readings of the motion."""
    form: tuple[Spec, ...] = ()
    """Of the form of readings."""
    retraced: tuple[Spec, ...] = ()
    """Of readings that are made again in the rebuilt world."""
    signal: tuple[Spec, ...] = ()
    """Of runs with sensors that are not ideal."""
    extras: tuple[Spec, ...] = ()
    """Of what only some runs have."""
    extras_of: Callable[[Context], tuple[Spec, ...]] = _nothing
    """Which of the extras a run has."""


_OPEN: Final = 500
"""Readings for which further messages are awaited."""
_BEFORE_NS: Final = 10**9
"""Motion [ns] before a reading that is kept for it."""
SAME_READING: Final = Rule("a sensor reads the same again")
OTHER_SENSORS: Final[Spec] = Spec("other sensors", (SAME_READING,), "readings")


def are_checked(context: Context) -> bool:
    """Whether a rig has such sensors."""
    return any(sensor_class(config) not in OWN for config in context.rig.in_order())


class Readings(Checker):
    """Every reading of such sensors again from the true motion, compared by the sensor's own ``difference``."""

    def __init__(self, context: Context, rebuilt: RebuiltWorld) -> None:
        self._context, self._tally = context, context.tally(OTHER_SENSORS)
        self.tallies, rig = [self._tally], context.rig
        made = context.experiment
        light, weather = (None, None) if made is None else (made.light, made.weather)
        self._sensor_world = SensorWorld(rebuilt.world, rig, light, weather, scene=rebuilt.scene, baked=rebuilt.baked)
        self._configs = {config.name: config for config in rig.in_order() if sensor_class(config) not in OWN}
        outputs = [(config, each) for config in self._configs.values() for each in config.outputs_on(rig.robot)]
        self._of_topic = {topic.name: found for found in outputs for topic in found[1].topics}
        self.topics = tuple(self._of_topic)
        self._open: dict[tuple[str, int], dict[str, Any]] = {}
        """Messages of a reading that has not come as a whole: by output and stamp, then by topic."""
        self._own = threading.local()

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        config, output = self._of_topic[raw.topic]
        reading = self._open.setdefault((output.name, raw.stamp_ns), {})
        reading[raw.topic] = message
        if len(self._open) > _OPEN:  # a topic lacks messages, which the check of counts reports
            del self._open[next(iter(self._open))]
        topics = [topic.name for topic in output.topics]
        if reading.keys() == set(topics) and config.sees:  # what a sensor of motion measures may need the whole drive
            del self._open[output.name, raw.stamp_ns]
            messages = [reading[topic] for topic in topics]
            end_ns = raw.stamp_ns + round(1e9 * config.late_s)
            self._context.motion.when_known(end_ns, lambda: self._submit(raw, output, messages))

    def _submit(self, raw: RawMessage, output: Output, messages: list[Any]) -> None:
        motion = self._context.motion.motion
        since = int(np.searchsorted(motion.stamps_ns, raw.stamp_ns - _BEFORE_NS))
        known = Motion(**{name: rows[since:].copy() for name, rows in vars(motion).items()})
        self._context.jobs.append(lambda: self._compare(raw, output, known, messages))

    def _compare(self, raw: RawMessage, output: Output, motion: Motion, messages: list[Any]) -> list[Tally]:
        sensors: dict[str, Sensor] = vars(self._own)
        config = self._of_topic[raw.topic][0]
        if config.name not in sensors:
            sensors[config.name] = sensor_class(config)(config, self._sensor_world)
        sensor, movement = sensors[config.name], movement_of(Track(motion=motion, swept=motion, base=None))
        number = len(stamps_of(config, output, raw.stamp_ns)) - 1
        reading = sensor.read(output, At(number, raw.stamp_ns, raw.stamp_ns, movement))
        difference = sensor.difference(output, reading, messages)
        part = self._tally.part()
        part[SAME_READING].see(not difference, f"{at(raw)}: {difference}")
        return [part]
