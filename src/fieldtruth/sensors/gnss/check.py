# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Fixes of GNSS receivers, compared with the true motion and the mounts.

They have no noise, so that the residual is rounding: 1e-9 m, the last digit of a latitude of 49.9 deg.
"""

from typing import Any, Final

import numpy as np

from fieldtruth.bag.reader import RawMessage
from fieldtruth.core import frames, geodesy
from fieldtruth.core.arrays import Array
from fieldtruth.validation.check import Rule, Spec
from fieldtruth.validation.context import Checker, Context, at

ANTENNA: Final = Rule("the fix is the true position of the antenna", 1e-6, "m")
FIX: Final = Rule("each reading is a fix without covariance", minor=True)
GNSS: Final[Spec] = Spec("gnss", (ANTENNA, FIX), "fixes", "no GNSS receiver, or no true motion")


class Gnss(Checker):
    """Fixes of every receiver against the true position of its antenna."""

    def __init__(self, context: Context) -> None:
        self._motion, self._tally = context.motion, context.tally(GNSS)
        self.tallies = [self._tally]
        self._antennas = {config.topic: np.array([config.mount.xyz]) for config in context.rig.antennas}
        self.topics = tuple(self._antennas)

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        status, covariance = message.status, message.position_covariance
        found = (status.status, status.service, message.position_covariance_type, bool(covariance.any()))
        self._tally[FIX].see(found == (0, 1, 0, False), f"{at(raw)}: status, service and covariance {found}")
        fix = np.array([message.latitude, message.longitude, message.altitude])
        self._motion.when_known(raw.stamp_ns, lambda: self._compare(raw, fix))

    def _compare(self, raw: RawMessage, fix: Array) -> None:
        antenna = frames.transform(self._motion.state(raw.stamp_ns).world_from_base, self._antennas[raw.topic])[0]
        valid = np.isfinite(fix).all() and abs(fix[0]) <= 90.0
        position = geodesy.world_from_geodetic(fix) if valid else fix * np.nan
        self._tally[ANTENNA].measure(float(np.linalg.norm(position - antenna)), at(raw))
