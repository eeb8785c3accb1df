# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Fractal noise on a grid and in space: sums of smooth random fields of halving wavelength."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates


def fractal_noise(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    *,
    wavelength: float,
    octaves: int,
    rng: np.random.Generator,
    gain: float = 0.5,
) -> NDArray[np.float64]:
    """Noise (len(x), len(y)) of about unit deviation; the longest ``wavelength`` [m] halves ``octaves`` - 1 times.

    Each octave is a grid of independent normal numbers, half a wavelength apart, joined by cubic splines, and weighs
    ``gain`` times the one before (Perlin 1985 calls the same sum turbulence without the absolute value).
    """
    total, energy = np.zeros((len(x), len(y))), 0.0
    for octave in range(octaves):
        step, weight = wavelength / 2 ** (octave + 1), gain**octave
        nodes = rng.standard_normal((int(np.ptp(x) / step) + 5, int(np.ptp(y) / step) + 5))
        u, v = np.meshgrid((x - x[0]) / step + 2.0, (y - y[0]) / step + 2.0, indexing="ij")
        total += weight * map_coordinates(nodes, [u, v], order=3, mode="nearest")
        energy += weight**2
    return np.asarray(total / np.sqrt(0.756 * energy))  # cubic splines keep about 0.756 of the nodes' variance


def solid_noise(
    points: NDArray[np.float64], *, wavelength: float, octaves: int, rng: np.random.Generator, gain: float = 0.5
) -> NDArray[np.float64]:
    """Noise (n,) of about unit deviation at ``points`` (n, d), in any number d of dimensions; else as on a grid."""
    total, energy = np.zeros(len(points)), 0.0
    low, extent = points.min(axis=0), np.ptp(points, axis=0)
    for octave in range(octaves):
        step, weight = wavelength / 2 ** (octave + 1), gain**octave
        nodes = rng.standard_normal(tuple((extent / step).astype(int) + 5))
        total += weight * map_coordinates(nodes, ((points - low) / step + 2.0).T, order=3, mode="nearest")
        energy += weight**2
    return np.asarray(total / np.sqrt(0.87 ** points.shape[1] * energy))  # the splines keep 0.87 a dimension
