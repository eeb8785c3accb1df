# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A topic of a bag: its name, its type and its rate."""

from typing import Final, NamedTuple

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
