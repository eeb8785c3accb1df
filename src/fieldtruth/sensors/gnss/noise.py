# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Errors of ranges: series in time, how they grow with elevation and signal, and the states of an RTK receiver."""

from typing import Final

import numpy as np
from scipy.signal import lfilter

from fieldtruth.core.arrays import Array, Counts, Mask
from fieldtruth.sensors.gnss.signal import GnssSignal

REFERENCE_DBHZ: Final = 45.0
"""Carrier-to-noise density ratio at which the sigmas of multipath and thermal noise hold."""
_EARTH: Final = 6_378_137.0  # [m]
_LAYER: Final = 350_000.0  # [m], height of the ionosphere

SINGLE, FLOAT, FIXED = 0, 1, 2
"""States of an RTK receiver: alone, ambiguities as real numbers, and as whole ones."""


def gauss_markov(rng: np.random.Generator, shape: tuple[int, int], kept: float) -> Array:
    """Return series (t, n) of unit variance whose correlation over k steps is ``kept`` to the power of k.

    It is stationary from the first row on, and a longer series begins with a shorter one.
    """
    white = rng.standard_normal(shape)
    white[1:] *= np.sqrt(1.0 - kept * kept)
    series: Array = lfilter([1.0], [1.0, -kept], white, axis=0)
    return series


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


def locked(strong: Mask, step_s: float, lock_s: float) -> Mask:
    """Which satellites (t, n) have been ``strong`` (t, n) for a time [s], as all had been before the first row."""
    rows = np.arange(len(strong))[:, None]
    weak_at = np.maximum.accumulate(np.where(strong, -np.inf, rows), axis=0)
    return np.asarray(strong & ((rows - weak_at) * step_s >= lock_s))


def rtk_states(rng: np.random.Generator, ratio: Array, step_s: float, signal: GnssSignal) -> Counts:
    """State (t,) of an RTK receiver by the carrier-to-noise density ratios (t, n) of the satellites in use, else -inf.

    It had its ambiguities before the drive. The phase of a satellite that was too weak counts from its beginning again,
    and takes ``rtk_fix_s`` to be of use. A longer series begins with a shorter one.
    """
    usable = locked(ratio >= signal.rtk_cn0_min_dbhz, step_s, signal.rtk_fix_s).sum(axis=1)
    chance = rng.random((len(usable), 3))
    lost = chance[:, 0] < _probability(signal.rtk_losses_per_hour, step_s)
    cut = chance[:, 1] < _probability(signal.link_losses_per_hour, step_s)
    pause = -signal.link_loss_s * np.log1p(-chance[:, 2])  # exponential distribution
    states, linked_at, since = np.empty(len(usable), np.int64), -np.inf, -np.inf
    for k, count in enumerate(usable):
        now = k * step_s
        if cut[k]:
            linked_at = max(linked_at, now + pause[k])
        alone = now < linked_at
        if alone or lost[k]:
            since = now
        fixed = not lost[k] and now - since >= signal.rtk_fix_s and count >= signal.rtk_min_satellites
        states[k] = SINGLE if alone else FIXED if fixed else FLOAT
    return states


def in_use(sine: Array, ratio: Array, signal: GnssSignal) -> Mask:
    """Which satellites (t, n) stand high enough and are strong enough."""
    above = sine > np.sin(np.radians(signal.elevation_mask_deg))
    used: Mask = above & np.isfinite(ratio) & (ratio >= signal.cn0_min_dbhz)
    return used


def _probability(per_hour: float, step_s: float) -> float:
    return float(-np.expm1(-per_hour * step_s / 3600.0))
