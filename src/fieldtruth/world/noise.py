# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Fractal noise on a grid and in space: sums of smooth random fields of halving wavelength."""

from collections.abc import Callable

import numpy as np
from scipy.ndimage import map_coordinates

from fieldtruth.core.arrays import Array
from fieldtruth.world.grids import grid_axes, make_raster


def fractal_noise(
    x: Array, y: Array, *, wavelength: float, octaves: int, rng: np.random.Generator, gain: float = 0.5
) -> Array:
    """Noise (len(x), len(y)) of about unit deviation; the longest ``wavelength`` [m] halves ``octaves`` - 1 times.

    Each octave interpolates independent normal numbers, half a wavelength apart, with cubic splines; its weight is
    ``gain`` times that of the octave before (the turbulence of Perlin 1985 without the absolute value).
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
    points: Array, *, wavelength: float, octaves: int, rng: np.random.Generator, gain: float = 0.5
) -> Array:
    """Noise (n,) of about unit deviation at ``points`` (n, d), in d dimensions; see ``fractal_noise``."""
    total, energy = np.zeros(len(points)), 0.0
    low, extent = points.min(axis=0), np.ptp(points, axis=0)
    for octave in range(octaves):
        step, weight = wavelength / 2 ** (octave + 1), gain**octave
        nodes = rng.standard_normal(tuple((extent / step).astype(int) + 5))
        total += weight * map_coordinates(nodes, ((points - low) / step + 2.0).T, order=3, mode="nearest")
        energy += weight**2
    return np.asarray(total / np.sqrt(0.87 ** points.shape[1] * energy))  # splines keep 0.87 per dimension


def noise_map(
    size: tuple[float, float], wavelength: float, rng: np.random.Generator, *, nodes: int = 16
) -> Callable[[Array], Array]:
    """Noise of three octaves and about unit deviation over an area (x, y) [m], as a function of positions (n, 2).

    ``nodes`` is the resolution: nodes per wavelength.
    """
    x, y = grid_axes(size, wavelength / nodes)
    values = fractal_noise(x, y, wavelength=wavelength, octaves=3, rng=rng)
    raster = make_raster(values, float(x[1] - x[0]), x, y)
    return lambda xy: raster.at(*xy.T)
