# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Errors of ranges: how they grow with elevation and signal, and the states of an RTK receiver."""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Counts, Mask
from fieldtruth.sensors.gnss.signal import GnssSignal

REFERENCE_DBHZ: Final = 45.0
"""Carrier-to-noise density ratio at which the sigmas of multipath and thermal noise hold."""
_EARTH: Final = 6_378_137.0  # [m]
_LAYER: Final = 350_000.0  # [m], height of the ionosphere

SINGLE, FLOAT, FIXED = 0, 1, 2
"""States of an RTK receiver: alone, ambiguities as real numbers, and as whole ones."""


def obliquity(sine: Array) -> Array:
    """Path through the ionosphere's layer relative to the zenith, by the sine of the elevation: 1 to 3.14.

    Source: RTCA DO-229, appendix A.4.4.10.4, a thin shell 350 km high.
    """
    factor: Array = 1.0 / np.sqrt(1.0 - (1.0 - sine * sine) * (_EARTH / (_EARTH + _LAYER)) ** 2)
    return factor


def carrier_to_noise(sine: Array, amplitude: Array, signal: GnssSignal) -> Array:
    """Carrier-to-noise density ratio [dB-Hz] by the sine of the elevation and the share of amplitude that arrives."""
    horizon, zenith = signal.cn0_horizon_dbhz, signal.cn0_zenith_dbhz
    with np.errstate(divide="ignore"):
        ratio: Array = horizon + (zenith - horizon) * np.maximum(sine, 0.0) + 20.0 * np.log10(amplitude)
    return ratio


def sigmas(sine: Array, ratio: Array, state: Counts, signal: GnssSignal) -> tuple[Array, Array, Array]:
    """Standard deviations (t, n) [m] of the slow error, of that of reflections and of the white one.

    Args:
        sine: (t, n) of the elevations.
        ratio: (t, n) carrier-to-noise density ratios [dB-Hz].
        state: (t,) of the receiver.
        signal: figures.

    The variance of noise is inverse to the signal's power (Hartinger and Brunner, Variances of GPS phase observations:
    the SIGMA-epsilon model, GPS Solutions 2, 1999); reflections are as strong under trees while the direct signal, by
    whose amplitude their error is divided, is weaker.
    """
    alone, floating = (state == SINGLE)[:, None], (state == FLOAT)[:, None]
    growth = 10.0 ** ((REFERENCE_DBHZ - np.maximum(ratio, 0.0)) / 20.0)
    phase = np.where(floating, signal.rtk_float_sigma_m, signal.rtk_fixed_sigma_m)
    return (
        np.where(alone, signal.range_sigma_m * obliquity(sine), 0.0),
        np.where(alone, signal.multipath_sigma_m, phase) * growth,
        np.where(alone, signal.white_sigma_m, signal.rtk_white_sigma_m) * growth,
    )


class RtkStates:
    """States of an RTK receiver, which go on from call to call: they do not depend on how a drive is cut.

    It had its ambiguities before the drive. The phase of a satellite that was too weak counts from its beginning again,
    and takes ``rtk_fix_s`` to be of use.

    Args:
        rng: used by these states only.
        step_s: time [s] from one to the next.
        signal: figures.
    """

    def __init__(self, rng: np.random.Generator, step_s: float, signal: GnssSignal) -> None:
        self._rng, self._step_s, self._signal = rng, step_s, signal
        self._number = 0
        self._weak_at: Array | float = -np.inf  # number at which each satellite was last too weak
        self._linked_at = self._since = -np.inf

    def extend(self, ratio: Array) -> Counts:
        """Return the next states (t,) by the carrier-to-noise density ratios (t, n) of satellites in use, else -inf."""
        return np.array([self._next(row) for row in ratio], np.int64)

    def _next(self, ratio: Array) -> int:
        signal, step_s = self._signal, self._step_s
        now = self._number * step_s
        strong = ratio >= signal.rtk_cn0_min_dbhz
        self._weak_at = np.where(strong, self._weak_at, self._number)
        count = np.count_nonzero(strong & ((self._number - self._weak_at) * step_s >= signal.rtk_fix_s))
        chance = self._rng.random(3)
        lost = chance[0] < _probability(signal.rtk_losses_per_hour, step_s)
        if chance[1] < _probability(signal.link_losses_per_hour, step_s):
            pause = -signal.link_loss_s * np.log1p(-chance[2])  # exponential distribution
            self._linked_at = max(self._linked_at, now + pause)
        alone = now < self._linked_at
        if alone or lost:
            self._since = now
        self._number += 1
        fixed = not lost and now - self._since >= signal.rtk_fix_s and count >= signal.rtk_min_satellites
        return SINGLE if alone else FIXED if fixed else FLOAT


def in_use(sine: Array, ratio: Array, signal: GnssSignal) -> Mask:
    """Which satellites (t, n) stand high enough and are strong enough."""
    above = sine > np.sin(np.radians(signal.elevation_mask_deg))
    used: Mask = above & np.isfinite(ratio) & (ratio >= signal.cn0_min_dbhz)
    return used


def _probability(per_hour: float, step_s: float) -> float:
    return float(-np.expm1(-per_hour * step_s / 3600.0))
