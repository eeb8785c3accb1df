# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Fixes of GNSS receivers, compared with the true motion and the mounts.

Ideal ones have no noise, so that the residual is rounding: 1e-9 m, the last digit of a latitude of 49.9 deg. Those with
errors are compared with the truth by the covariances that they state.
"""

from typing import Any, Final

import numpy as np

from fieldtruth.bag.reader import RawMessage
from fieldtruth.core import geodesy, transforms
from fieldtruth.core.arrays import Array
from fieldtruth.sensors.gnss.config import GnssConfig
from fieldtruth.validation.check import Rule, Spec
from fieldtruth.validation.context import Checker, Context, at
from fieldtruth.validation.kind_checks import KindChecks

ANTENNA: Final = Rule("the fix is the true position of the antenna", 1e-6, "m")
FIX: Final = Rule("each reading is a fix without covariance", minor=True)
GNSS: Final[Spec] = Spec("gnss", (ANTENNA, FIX), "fixes", "no GNSS receiver, or no true motion")
_LARGEST: Final = 45.0  # one fix in 10^9 exceeds it: chi-square of three coordinates
_MEAN: Final = (2e-4, 31.0)
"""Limits of the mean of a run, beyond which is one run in 10^6 on either side: the law of a single fix, as its largest
errors last as long as a run."""
LARGEST: Final = Rule("no fix is further from the truth than its covariance allows", _LARGEST, "of the variance")
TYPICAL: Final = Rule("the errors of a receiver are as large as its covariances state")
REPORTED: Final = Rule("a fix has a covariance if there are errors, and nothing has one without a position")
FIXES: Final[Spec] = Spec("gnss noise", (LARGEST, TYPICAL, REPORTED), "fixes", "no GNSS receiver with a signal")


class Gnss(Checker):
    """Fixes of every receiver against the true position of its antenna."""

    def __init__(self, context: Context) -> None:
        self._motion, self._tally = context.motion, context.tally(GNSS)
        self.tallies = [self._tally]
        antennas = context.rig.enabled(GnssConfig)
        self._antennas = {config.true_topic(config.topic): np.array([config.mount.xyz]) for config in antennas}
        self._context = context
        self.topics = tuple(self._antennas)

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        status, covariance = message.status, message.position_covariance
        found = (status.status, status.service, message.position_covariance_type, bool(covariance.any()))
        self._tally[FIX].see(found == (0, 1, 0, False), f"{at(raw)}: status, service and covariance {found}")
        fix = np.array([message.latitude, message.longitude, message.altitude])
        self._motion.when_known(raw.stamp_ns, lambda: self._compare(raw, fix))

    def _compare(self, raw: RawMessage, fix: Array) -> None:
        antenna = transforms.transform(self._motion.state(raw.stamp_ns).world_from_base, self._antennas[raw.topic])[0]
        valid = np.isfinite(fix).all() and abs(fix[0]) <= 90.0
        position = geodesy.world_from_geodetic(fix, self._context.origin) if valid else fix * np.nan
        self._tally[ANTENNA].measure(float(np.linalg.norm(position - antenna)), at(raw))


class Fixes(Checker):
    """Every receiver with a signal."""

    def __init__(self, context: Context) -> None:
        self._motion, self._tally, self._context = context.motion, context.tally(FIXES), context
        self.tallies = [self._tally]
        self._exact, self._antennas, self._squares = dict[str, bool](), dict[str, Array](), dict[str, list[float]]()
        for config in context.rig.enabled(GnssConfig):
            if config.signal is not None:
                self._exact[config.topic] = config.signal.is_exact
                self._antennas[config.topic] = np.array([config.mount.xyz])
        self.topics = tuple(self._antennas)

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        status, covariance = message.status, message.position_covariance.reshape(3, 3)
        fix = np.array([message.latitude, message.longitude, message.altitude])
        positioned = status.status >= status.STATUS_FIX
        due = positioned and not self._exact[raw.topic]
        stated = message.position_covariance_type == message.COVARIANCE_TYPE_KNOWN
        right = bool(np.isfinite(fix).all()) == positioned and stated == due == bool(covariance.any())
        self._tally[REPORTED].see(right, f"{at(raw)}: status {status.status}, {fix}, covariance {covariance.ravel()}")
        if right and positioned:
            self._motion.when_known(raw.stamp_ns, lambda: self._compare(raw, fix, covariance))

    def finish(self) -> None:
        """Compare the means after the last message."""
        for topic, squares in self._squares.items():
            mean = float(np.mean(squares))
            text = f"{topic}: the mean of squared errors is {mean:.3g} of the variance"
            self._tally[TYPICAL].see(_MEAN[0] <= mean <= _MEAN[1], text)

    def _compare(self, raw: RawMessage, fix: Array, covariance: Array) -> None:
        antenna = transforms.transform(self._motion.state(raw.stamp_ns).world_from_base, self._antennas[raw.topic])[0]
        north, west, up = geodesy.world_from_geodetic(fix, self._context.origin) - antenna
        error = np.array([-west, north, up])
        if self._exact[raw.topic]:
            covariance = np.eye(3) * 1e-12
        square = float(error @ np.linalg.pinv(covariance) @ error)
        self._tally[LARGEST].measure(square, at(raw))
        if not self._exact[raw.topic]:
            self._squares.setdefault(raw.topic, []).append(square)


CHECKS: Final = KindChecks(
    make=lambda shared: [Gnss(shared.context), Fixes(shared.context)], motion=(GNSS,), signal=(FIXES,)
)
