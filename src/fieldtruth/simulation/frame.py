# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Frames: readings that a simulation delivers together, by name of the sensor."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from fieldtruth.core import readings
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import UnknownNameError

Named = tuple[str, Any]
"""Name of an output and one of its readings."""


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
