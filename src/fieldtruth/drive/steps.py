# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Physics steps at which sensors of the motion read.

A reading is the state at the physics step nearest to the sensor's due time, and carries that step's own stamp; for
rates that divide 1000 Hz the two are equal.
"""

import numpy as np

from fieldtruth.core.arrays import Counts
from fieldtruth.drive.physics import STEP_NS
from fieldtruth.drive.track import stamps_at_rate


def steps_at_rate(rate_hz: float, duration_ns: int, since_ns: int = 0) -> Counts:
    """Physics steps (n,), counted from 1, of the readings of a sensor that are due after one time and up to another."""
    return np.rint(stamps_at_rate(rate_hz, duration_ns, since_ns) / STEP_NS).astype(np.int64)


def due_step(rate_hz: float, number: int) -> int:
    """Return the physics step of the reading with this number, from 1, as ``steps_at_rate`` has it."""
    return round(round(number * (1e9 / rate_hz)) / STEP_NS)
