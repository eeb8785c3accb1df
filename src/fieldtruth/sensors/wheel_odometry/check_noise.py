# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of real encoders against the ideal ones beside them: laws within five standard deviations."""

import math
from typing import Any, Final

import numpy as np

from fieldtruth.bag.reader import RawMessage
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.sensor_config import TRUTH
from fieldtruth.sensors.wheel_odometry.config import JOINT_STATES
from fieldtruth.validation.check import SIGMAS, Rule, Spec
from fieldtruth.validation.context import Checker, Context

COUNTS: Final = Rule("angles of the wheels are whole counts of their encoders", 1e-6, "counts")
RADII: Final = Rule("wheels turn by what their radii make of the true angles", SIGMAS, "deviations")
ROUNDING: Final = Rule("angles differ by at most a count from those of the true wheels", 1.0 + 1e-6, "counts")
WHEEL_NOISE: Final[Spec] = Spec("wheel noise", (COUNTS, RADII, ROUNDING), "readings", "no encoders with a signal")
_FINE: Final = 1e-9
"""Step [rad] for encoders without counts: rounding of the computer."""


class WheelNoise(Checker):
    """Encoders with a signal against the true angles of the wheels."""

    def __init__(self, context: Context) -> None:
        self._tally = context.tally(WHEEL_NOISE)
        self.tallies = [self._tally]
        config = context.rig.wheel_odometry
        self._signal = None if config is None else config.signal
        self.topics = () if self._signal is None else (JOINT_STATES, JOINT_STATES + TRUTH)
        self._angles: dict[str, dict[int, Array]] = {name: {} for name in self.topics}

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        self._angles[raw.topic][raw.stamp_ns] = np.array(message.position)

    def finish(self) -> None:
        """Compare the angles after the last message."""
        signal = self._signal
        if signal is None:
            return
        read, true = (self._angles[name] for name in self.topics)
        stamps = [stamp for stamp in sorted(read) if stamp in true]
        if not stamps:
            return
        angles, of_true = (np.array([part[stamp] for stamp in stamps]) for part in (read, true))
        count = signal.counts_per_revolution
        step = 2.0 * math.pi / count if count else _FINE
        if count:
            off = np.abs(angles / step - np.rint(angles / step)).max(axis=1)
            self._tally[COUNTS].measure_all(off, lambda k: f"{JOINT_STATES} at {stamps[k]} ns")
        far = np.abs(of_true).max(axis=0)
        ratio = np.sum(angles * of_true, axis=0) / np.maximum(np.sum(of_true**2, axis=0), 1e-300)
        order = np.hypot(signal.radius_error, 2.0 * step / np.maximum(far, step))
        self._tally[RADII].measure_all((ratio - 1.0) / order, lambda k: f"wheel {k}")
        off = np.abs(angles - ratio * of_true).max(axis=1) / step
        self._tally[ROUNDING].measure_all(off, lambda k: f"{JOINT_STATES} at {stamps[k]} ns")
