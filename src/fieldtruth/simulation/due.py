# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Frames of readings, and the readings of a sensor that are due as a motion grows.

A reading is complete when the motion is known up to the end of its sweep or shutter, and with optical flow up to the
next one. At the end of the motion all that is left is complete.
"""

import copy
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.core import readings
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import UnknownNameError
from fieldtruth.drive.track import STEP_NS, Stamps, Track, count_at_rate
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import Output, SensorConfig
from fieldtruth.record.streams import Series, series_of
from fieldtruth.sensors.kind import At, MotionSensor, Movement, stamps_of

Named = tuple[str, Any]
"""Name of an output and one of its readings."""
_HORIZON_NS: Final = 60 * 10**9
"""Time for which stamps are computed at first; each further time is twice as long."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame(readings.Frame):
    """Readings that are due together, by name of the sensor: ``frame["lidar"].xyz``.

    Names are those of sensors, with a part or ``truth`` behind a slash where a sensor has several: ``stereo/left``,
    ``imu/truth``. Readings are ``Cloud``, ``Image``, ``Inertial``, ``Fix``, ``WheelSpeeds``, ``Joints``, ``Odometry``
    of ``fieldtruth.core.readings``, or the own type of a sensor of another package. Where a sensor has several readings
    in a step, ``frame[name]`` is the last of them and ``frame.all[name]`` has every one, in time order.
    """

    pose: Array
    """(4, 4) true ``world_from_base`` at ``stamp_ns``."""
    all: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    """Readings by name, in time order; each has its own ``stamp_ns``."""

    def __getitem__(self, sensor: str) -> Any:
        """Return the last reading of a sensor.

        Raises:
            UnknownNameError: the frame has none: the sensor was not due, not asked for, or does not exist.
        """
        if sensor not in self.readings:
            raise UnknownNameError(f"reading at {self.stamp_ns / 1e9:g} s", sensor, self.readings)
        return self.readings[sensor]


def frame_of(stamp_ns: int, pose: Array, found: Iterable[Named]) -> Frame:
    """Return the frame of readings in time order."""
    names: dict[str, list[Any]] = {}
    for name, reading in found:
        names.setdefault(name, []).append(reading)
    return Frame(
        stamp_ns=stamp_ns,
        readings={name: each[-1] for name, each in names.items()},
        pose=pose,
        all={name: tuple(each) for name, each in names.items()},
    )


class Due(NamedTuple):
    """A reading that is complete."""

    output: Output
    at: At


class DueReadings:
    """Readings of one sensor: which are complete, from one time to the next.

    Args:
        config: the sensor.
        rig: the robot that carries it.
        seed: of its clock.
        stands: stamps of a robot that stands at separate poses, at which every sensor reads; None of a motion.
    """

    def __init__(self, config: SensorConfig, rig: Rig, seed: int, stands: Stamps | None) -> None:
        self.config = config
        self._rig, self._seed, self._stands = rig, seed, stands
        self.outputs = config.outputs_on(rig.robot)
        self._taken, self._counted = [0] * len(self.outputs), [0] * len(self.outputs)
        self._horizon_ns, self._series = 0, list[Series]()
        self.memory: Any = None
        """State from which the readings of a sensor of motion go on."""

    def save(self) -> Any:
        """Return what ``restore`` needs to go on from here."""
        return copy.deepcopy((self._taken, self._counted, self.memory))

    def restore(self, saved: Any) -> None:
        """Go on from where ``save`` was called."""
        self._taken, self._counted, self.memory = copy.deepcopy(saved)

    def needed_ns(self, reached_ns: int) -> int:
        """Return the time [ns] from which on the motion is still needed, if it is known up to ``reached_ns``."""
        if not self.config.sees:
            return reached_ns - max(math.ceil(1e9 / output.rate_hz) for output in self.outputs) - 2 * STEP_NS
        stamps = [
            int(series.stamps_ns[series.clock.kept[k]])
            for series, k in zip(self._series, self._taken, strict=False)
            if k < len(series.clock.kept)
        ]
        return min([reached_ns, *stamps]) - math.ceil(1e9 * self.config.early_s) - 2 * STEP_NS

    def _until(self, time_ns: int) -> list[Series]:
        """Return the series, long enough for a time and the next readings behind it."""
        margin = 4 * max(math.ceil(1e9 / output.rate_hz) for output in self.outputs)
        if time_ns + margin > self._horizon_ns:
            self._horizon_ns = max(_HORIZON_NS, 2 * (time_ns + margin))

            def stamps(output: Output) -> Stamps:
                return stamps_of(self.config, output, self._horizon_ns) if self._stands is None else self._stands

            self._series = series_of(self.config, self._rig, stamps, self._seed)
        return self._series

    def seen(self, movement: Movement, reached_ns: int, end_ns: float) -> Iterator[Due]:
        """Yield the readings of a sensor that sees which are complete and were not yielded yet."""
        ended, late_ns = reached_ns >= end_ns, math.ceil(round(1e9 * self.config.late_s, 3))
        for order, series in enumerate(self._until(reached_ns)):
            while (k := self._taken[order]) < len(series.clock.kept):
                at = series.at(k, movement, end_ns)
                complete_ns: float = at.stamp_ns if ended else at.stamp_ns + late_ns
                if self.config.needs_next and not ended:
                    complete_ns = math.inf if at.next_ns is None else max(complete_ns, at.next_ns)
                if complete_ns > reached_ns:
                    break
                self._taken[order] += 1
                yield Due(series.output, at)

    def measured(self, sensor: MotionSensor, track: Track, reached_ns: int) -> Iterator[tuple[Due, Any]]:
        """Yield the readings of a sensor of motion that are due up to a time and were not yielded yet."""
        if self.memory is None:
            self.memory = sensor.begin()
        (true, measured), movement = sensor.extend(self.memory, track), Movement(_no_pose)
        for order, series in enumerate(self._until(reached_ns)):
            count, before = count_at_rate(series.output.rate_hz, reached_ns), self._counted[order]
            self._counted[order], chunk = count, true if series.output.ideal else measured
            for k in range(*np.searchsorted(series.clock.kept, [before, count]).tolist()):
                at = series.at(k, movement)
                in_chunk = at._replace(number=at.number - before)
                yield Due(series.output, at), sensor.reading(series.output, in_chunk, chunk)


def _no_pose(stamp_ns: Any) -> Any:
    raise AssertionError("a sensor of motion reads series only")


def wanted_outputs(rig: Rig, names: Iterable[str] | None) -> set[str]:
    """Return the names of the outputs of the sensors, or outputs, that are asked for; None: of all.

    Raises:
        UnknownNameError: there is no such sensor or output.
    """
    by_sensor = {config.name: [output.name for output in config.outputs_on(rig.robot)] for config in rig.in_order()}
    everything = [name for outputs in by_sensor.values() for name in outputs]
    if names is None:
        return set(everything)
    found: set[str] = set()
    for name in [names] if isinstance(names, str) else names:
        if name not in by_sensor and name not in everything:
            raise UnknownNameError("sensor", str(name), dict.fromkeys([*by_sensor, *everything]))
        found |= set(by_sensor.get(name, [name]))
    return found
