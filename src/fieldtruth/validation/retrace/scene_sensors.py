# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of sensors whose kind another package has added, sensed again in the rebuilt world."""

import threading
from typing import Any, Final

from fieldtruth.bag.reader import RawMessage
from fieldtruth.core.arrays import Array
from fieldtruth.sense.scene_sensor import SCENE_SENSORS, SceneSensor
from fieldtruth.validation.check import Rule, Spec, Tally
from fieldtruth.validation.context import Checker, Context, RebuiltWorld, at

SAME_READING: Final = Rule("a sensor reads the same again")
OTHER_SENSORS: Final[Spec] = Spec("other sensors", (SAME_READING,), "readings")


class SceneSensors(Checker):
    """Every reading again from the true pose, compared by the sensor's own ``difference``."""

    def __init__(self, context: Context, rebuilt: RebuiltWorld) -> None:
        self._context, self._scene = context, rebuilt.scene
        self._tally = context.tally(OTHER_SENSORS)
        self.tallies = [self._tally]
        self._configs = {config.name: config for config in context.rig.scene_sensors}
        self._sensor_of = {topic.name: name for name, own in self._configs.items() for topic in own.topics()}
        self.topics = tuple(self._sensor_of)
        self._open: dict[tuple[str, int], dict[str, Any]] = {}
        """Messages of a reading that has not come as a whole: by sensor and stamp, then by topic."""
        self._own = threading.local()

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        name = self._sensor_of[raw.topic]
        reading = self._open.setdefault((name, raw.stamp_ns), {})
        reading[raw.topic] = message
        topics = [topic.name for topic in self._configs[name].topics()]
        if reading.keys() == set(topics):
            del self._open[name, raw.stamp_ns]
            messages = [reading[topic] for topic in topics]
            self._context.motion.when_known(raw.stamp_ns, lambda: self._submit(raw, name, messages))

    def _submit(self, raw: RawMessage, name: str, messages: list[Any]) -> None:
        base_from_sensor = self._configs[name].mount.base_from_sensor
        pose = self._context.motion.state(raw.stamp_ns).world_from_base @ base_from_sensor
        self._context.jobs.append(lambda: self._compare(raw, name, pose, messages))

    def _compare(self, raw: RawMessage, name: str, pose: Array, messages: list[Any]) -> list[Tally]:
        sensors: dict[str, SceneSensor] = vars(self._own)
        if name not in sensors:
            sensors[name] = SCENE_SENSORS[self._configs[name].kind](self._configs[name], self._scene)
        difference = sensors[name].difference(sensors[name].read(pose), messages)
        part = self._tally.part()
        part[SAME_READING].see(not difference, f"{at(raw)}: {difference}")
        return [part]
