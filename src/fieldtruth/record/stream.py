# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A stream of messages.

A reading depends only on its number, so parts of a recording can be made in any order and by any thread.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

from fieldtruth.drive.track import Stamps
from fieldtruth.sensors.kind import Sensor

Sensors = Mapping[str, Sensor]
"""The sensors of one worker by name; they own buffers, so threads must not share them."""


class Stream(NamedTuple):
    """Readings of one source: reading k is taken at ``stamps_ns[k]`` and makes one message for each of ``topics``."""

    topics: tuple[str, ...]
    stamps_ns: Stamps
    messages: Callable[[int, Sensors], Iterable[bytes]]
