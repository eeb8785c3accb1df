# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A topic of a bag: its name, its type and its rate."""

from collections.abc import Mapping
from typing import Final, NamedTuple

from fieldtruth.core.readings import Message, Reading

BASE: Final = "base_link"
ODOM: Final = "odom"
"""Frame in which wheel odometry starts (REP-105). It is not in /tf, where the parent of base_link is the world."""
WHEELS: Final = ("front_left", "front_right", "rear_left", "rear_right")


class Topic(NamedTuple):
    """A topic that a run publishes; without ``rate_hz`` it has one message per bag."""

    name: str
    msgtype: str
    rate_hz: float | None
    kind: str = "robot"
    """Kind of the sensor that publishes it, ``robot`` for the truth and ``objects`` for the static objects."""
    sensor: str = ""
    """Name of that sensor."""

    @property
    def latched(self) -> bool:
        """Whether late subscribers get the last message; true for topics that are published once."""
        return self.rate_hz is None


class Output(NamedTuple):
    """A series of readings of a sensor; each makes one message for each of ``topics``."""

    name: str
    """That of the sensor, with a part or ``truth`` behind a slash: ``lidar``, ``stereo/left``, ``imu/truth``."""
    topics: tuple[Topic, ...]
    part: str = ""
    """Which of the sensor's series it is, if there are several, such as ``left``."""
    ideal: bool = False
    """Whether it has what an ideal sensor reads, beside the series of one that is not ideal."""
    clock: str = ""
    """Part of the sensor that loses readings by a draw of its own; see ``record.clocks.clock_of``."""
    frame: str = ""
    """Frame in the headers of its messages; empty if they have none."""
    reading: type[Reading] = Message
    """Type of its readings."""
    fields: Mapping[str, Topic] = {}
    """Topic by part of the reading: of an image by its field, also of those that are off; of wheels by name. Empty:
    its first topic has all."""
    label: str = ""
    """Of a view, that of its imager: left and right of the paper's pair, ``NAME_left`` of others."""
    info: str = ""
    """Topic of the calibration of a view."""

    @property
    def rate_hz(self) -> float:
        """Rate of the readings."""
        rate_hz = self.topics[0].rate_hz
        assert rate_hz is not None
        return rate_hz
