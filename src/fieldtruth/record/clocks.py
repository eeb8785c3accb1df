# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Clocks of sensors: what the headers of their messages say, and which messages are lost.

The stamp of a message in the bag stays the true time of its reading. A clock shows, at the time t, t + offset + drift t
+ jitter with a jitter that is normal and of each reading its own. Stamps rise: where the jitter is so large that they
would not, a stamp is 1 ns above the one before. A reading whose clock shows 0 or less is lost, as ROS has no such time.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.random import rng_of
from fieldtruth.drive.track import Stamps
from fieldtruth.experiment.clock_config import ClockConfig
from fieldtruth.experiment.sensor_config import SensorConfig

_CLOCK: Final = "clock"


@dataclass(frozen=True)
class ClockReadings:
    """What the clock of a sensor shows at its readings [ns] (n,), and the numbers of those that are not lost."""

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


def clock_of(config: SensorConfig, stamps_ns: Stamps, seed: int, part: str = "") -> ClockReadings:
    """Return the clock of a sensor at its readings; a ``part`` of the sensor with its own rate loses its own ones."""
    if config.clock is None:
        return ClockReadings(stamps_ns, np.arange(len(stamps_ns)))
    return read_clock(stamps_ns, config.clock, rng_of(seed, config.name, _CLOCK, *[part] * bool(part)))
