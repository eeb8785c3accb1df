# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Clocks of sensors: the stamps in headers against the stamps in the bag, which are the true time.

What is random is compared with its law, within five standard deviations of the statistic.
"""

import math
from typing import Any, Final

import numpy as np

from fieldtruth.bag.decode import stamp_ns
from fieldtruth.bag.reader import RawMessage
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.clock_config import ClockConfig
from fieldtruth.experiment.sensor_config import TRUTH, SensorConfig
from fieldtruth.validation.check import Rule, Spec, Tally
from fieldtruth.validation.context import Checker, Context, at

SIGMAS: Final = 5.0
"""Standard deviations of a statistic that are tolerated."""
NORMAL_CORE: Final = math.erf(math.sqrt(0.5))
"""Share of a normal distribution within one standard deviation."""

CLOCK_RISES: Final = Rule("the clock of a sensor rises, and is the same in all messages of a reading")
SHOWN: Final = Rule("the clock shows the true time, its offset, its drift and its jitter", 8.0, "deviations")
MEAN: Final = Rule("the jitter has the mean zero from begin to end", SIGMAS, "deviations")
SPREAD: Final = Rule("the jitter has its deviation", SIGMAS, "deviations")
SHAPE: Final = Rule("the jitter is normal: 68 % are within one deviation", SIGMAS, "deviations")
LOST: Final = Rule("the share of lost readings is that of the experiment", SIGMAS, "deviations")
CLOCKS: Final[Spec] = Spec(
    "clocks", (CLOCK_RISES, SHOWN, MEAN, SPREAD, SHAPE, LOST), "messages", "all sensors have the simulated time"
)
_LEAST: Final = 30
"""Fewest readings whose distribution is compared."""


class Clocks(Checker):
    """The clocks of all sensors that have one of their own."""

    def __init__(self, context: Context) -> None:
        self._run, self._tally = context.run, context.tally(CLOCKS)
        self.tallies = [self._tally]
        self._sensors = {each.name: each for each in context.rig.sensors if each.enabled and each.clock is not None}
        own = [topic for each in self._sensors.values() for topic in each.topics() if not topic.name.endswith(TRUTH)]
        self._topics = {topic.name: topic for topic in own if topic.name in self._run.counts}
        self._begin_s = {name: _begin_s(each.clock) for name, each in self._sensors.items()}
        self.topics = tuple(self._topics)
        self._shown: dict[str, dict[int, int]] = {name: {} for name in self._sensors}
        """By sensor: what its clock shows [ns] by true stamp."""
        self._seen: dict[str, int] = {}
        self._last: dict[str, int] = {}

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        late = raw.stamp_ns / 1e9 > self._begin_s[self._topics[raw.topic].sensor]
        self._seen[raw.topic] = self._seen.get(raw.topic, 0) + late
        if not hasattr(message, "header"):
            return
        stamp, shown = stamp_ns(message.header), self._shown[self._topics[raw.topic].sensor]
        met = shown.setdefault(raw.stamp_ns, stamp) == stamp and stamp > self._last.get(raw.topic, -1)
        self._tally[CLOCK_RISES].see(met, f"{at(raw)}: {stamp} ns after {self._last.get(raw.topic)} ns")
        self._last[raw.topic] = stamp

    def finish(self) -> None:
        """Compare the distributions after the last message."""
        for name, sensor in self._sensors.items():
            assert sensor.clock is not None
            rows = np.array(sorted(self._shown[name].items()), np.int64).reshape(-1, 2)
            if len(rows):
                self._see_jitter(rows[:, 0] / 1e9, (rows[:, 1] - rows[:, 0]) / 1e9, sensor.clock, name)
        for topic in self._topics.values():
            self._see_lost(self._sensors[topic.sensor], topic.name, topic.rate_hz or 0.0)

    def _see_jitter(self, seconds: Array, error_s: Array, clock: ClockConfig, name: str) -> None:
        jitter = error_s - clock.offset_s - clock.drift_ppm * 1e-6 * seconds
        unit = max(clock.jitter_s, 1e-9)  # stamps are whole nanoseconds
        self._tally[SHOWN].measure_all(jitter / unit, lambda k: f"{name} at {seconds[k]:.9f} s")
        if clock.jitter_s and len(jitter) >= _LEAST:
            see_normal(self._tally, (MEAN, SPREAD, SHAPE), jitter / clock.jitter_s, name)

    def _see_lost(self, sensor: SensorConfig, name: str, rate_hz: float) -> None:
        clock, begin = sensor.clock, int(self._begin_s[sensor.name] * rate_hz + 1e-9)
        assert clock is not None
        due = int(self._run.end_ns / 1e9 * rate_hz + 1e-9) - begin
        if due > 0:
            deviation = math.sqrt(clock.drop_share * (1.0 - clock.drop_share) * due)
            lost = due - self._seen[name]
            self._tally[LOST].measure((lost - clock.drop_share * due) / max(deviation, 0.1), f"{name}: {lost} of {due}")


def _begin_s(clock: ClockConfig | None) -> float:
    """Return the time [s] before which a clock may show 0 or less."""
    return 0.0 if clock is None else max(0.0, 6.0 * clock.jitter_s - clock.offset_s) * 1.02


def see_normal(tally: Tally, rules: tuple[Rule, Rule, Rule], values: Array, where: str) -> None:
    """Compare values (n,), in time order, with a standard normal distribution: mean, deviation, share within one."""
    mean, spread, shape = rules
    count = len(values)
    for part, rows in (("first half", values[: count // 2]), ("second half", values[count // 2 :])):
        tally[mean].measure(float(rows.mean()) * math.sqrt(len(rows)), f"{where}, {part}")
    tally[spread].measure((float(np.mean(values**2)) - 1.0) * math.sqrt(count / 2.0), where)
    core = float(np.mean(np.abs(values) < 1.0))
    tally[shape].measure((core - NORMAL_CORE) / math.sqrt(NORMAL_CORE * (1.0 - NORMAL_CORE) / count), where)
