# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Microrelief: random heights whose profiles have the displacement spectrum that ISO 8608 gives to a class of ground.

A profile along any straight line has the one-sided spectrum Gd(n) = Gd(n0) (n / n0)^-w [m^3] at spatial frequencies n
[cycles/m], n0 = 0.1 (ISO 8608:2016, equation 7). An isotropic field of two-sided spectrum S(q) [m^4], q the magnitude
of the spatial frequency, has profiles of Gd(n) = 2 int S(hypot(n, m)) dm over all m: the frequencies across the line
are summed (the Abel transform of S). For S = C q^-(w + 1) the integral is C n^-w B(1/2, w/2) with Euler's beta
function, so that C = Gd(n0) n0^w / (2 B(1/2, w/2)) gives the profiles asked for. ``BAND`` limits q; up to its lower end
n is unchanged, and near its upper end the profiles lack what lies beyond: for w = 2, Gd(n) is multiplied by
sqrt(1 - (n / q_max)^2).

The same white noise is used for every waviness, so that ground types merge without a seam.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft
from scipy.interpolate import RectBivariateSpline
from scipy.special import beta

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.world.grids import coarseness
from fieldtruth.world.ground_types import REFERENCE_FREQUENCY, Roughness

BAND: Final = (0.125, 10.0)
"""Lowest and highest spatial frequency [cycles/m]: 8 m, above which are the environment's own hills, to 0.1 m."""

SPACING: Final = 0.05
"""Distance [m] between the nodes of the microrelief: two to the shortest wave."""

Axes = tuple[Array, Array]
"""Coordinates [m] along x and along y of a grid's nodes."""


def relief_axes(x: Array, y: Array) -> Axes:
    """Coordinates [m] of the microrelief's nodes between the ends of two axes."""
    spacing = relief_spacing(x, y)
    x, y = (np.linspace(axis[0], axis[-1], round((axis[-1] - axis[0]) / spacing) + 1) for axis in (x, y))
    return x, y


def relief_spacing(x: Array, y: Array) -> float:
    """Distance [m] between the nodes of the microrelief over two axes: ``SPACING``, more in a large world."""
    return SPACING * coarseness((float(x[-1] - x[0]), float(y[-1] - y[0])))


def with_microrelief(
    hills: Array,
    coarse: Axes,
    fine: Axes,
    cover: Sequence[tuple[Roughness, ArrayLike]],
    rng: np.random.Generator,
) -> Array:
    """Heights [m] at the nodes of axes ``fine``: a cubic spline through ``hills`` at those of ``coarse``, and relief.

    ``cover`` has the share of each kind of ground at the nodes of ``coarse``; amplitudes are mixed, not powers. The
    relief is made with nodes ``SPACING`` apart, whatever ``fine`` is: a coarser terrain is a sample of a finer one.
    """
    own = relief_axes(*coarse)
    relief = np.zeros([len(axis) for axis in own])
    white = white_noise(relief.shape, rng)
    for waviness in sorted({roughness.waviness for roughness, _ in cover}):
        amplitude = np.zeros(hills.shape)
        for roughness, share in cover:
            if roughness.waviness == waviness:
                amplitude += np.sqrt(roughness.unevenness) * np.asarray(share, np.float64)
        noise = shaped(white, relief_spacing(*coarse), waviness)[: relief.shape[0], : relief.shape[1]]
        relief += RectBivariateSpline(*coarse, amplitude, kx=1, ky=1)(*own) * noise
    heights = RectBivariateSpline(*coarse, hills)(*fine)
    return np.asarray(heights + RectBivariateSpline(*own, relief, kx=1, ky=1)(*fine))


def white_noise(shape: tuple[int, ...], rng: np.random.Generator) -> Float32Array:
    """Independent normal numbers on a grid of at least ``shape`` nodes whose sides suit a Fourier transform."""
    return rng.standard_normal([fft.next_fast_len(n, real=True) for n in shape], dtype=np.float32)


def shaped(white: Float32Array, spacing: float, waviness: float) -> Float32Array:
    """White noise filtered to heights [m] of unit unevenness, Gd(n0) = 1 m^3; periodic over the array."""
    nx, ny = white.shape
    q = np.hypot(fft.fftfreq(nx, spacing)[:, None], fft.rfftfreq(ny, spacing)).astype(np.float32)
    inside = (q >= BAND[0]) & (q <= min(BAND[1], 0.5 / spacing))
    q[~inside] = 1.0
    level = REFERENCE_FREQUENCY**waviness / (2.0 * beta(0.5, waviness / 2.0))
    gain = np.where(inside, np.float32(np.sqrt(level) / spacing) * q ** np.float32(-(waviness + 1.0) / 2.0), 0.0)
    return np.asarray(fft.irfft2(fft.rfft2(white) * gain.astype(np.float32), s=white.shape), np.float32)
