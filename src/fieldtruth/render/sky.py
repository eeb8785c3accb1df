# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The sky as an image of the dome, with clouds.

Preetham, Shirley and Smits, "A Practical Analytic Model for Daylight" (1999).
"""

from typing import Final, NamedTuple

import numpy as np
from scipy.ndimage import map_coordinates, zoom

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.sense.kernel import kernel

SIZE: Final = 1024
TURBIDITY: Final = 3.0
SKY_OVER_SUN: Final = 0.27
"""Irradiance of the ground by the clear sky over that by the sun, with the sun at 40 deg (about 1 : 4)."""

ZENITH_RGB: Final = np.array([0.46, 0.98, 2.30])
HORIZON_RGB: Final = np.array([0.90, 1.00, 1.14])
"""Linear colours of luminance 1 overhead and in the haze near the horizon. Only the paper's luminance is used: its
chromaticity turns the lower sky pink at this turbidity."""


class Dome(NamedTuple):
    """Radiance ``rgb`` (SIZE, SIZE, 3) of the upper half of the sky.

    It is a paraboloid map (Heidrich and Seidel 1998): the direction (x, y, z) is at row x / (1 + z) and column
    y / (1 + z), both from -1 to 1, so that a lookup needs no angle.
    """

    rgb: Float32Array
    mean: Float32Array  # (3,) irradiance of level ground, divided by pi
    horizon: Float32Array  # (3,) radiance near the horizon, the colour of haze


def sun_direction(azimuth_deg: float, elevation_deg: float) -> Array:
    """Unit vector (3,) towards the sun in the world frame (x north, y west, z up); azimuth clockwise from north."""
    azimuth, elevation = np.radians(azimuth_deg), np.radians(elevation_deg)
    return np.array([np.cos(azimuth) * np.cos(elevation), -np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])


def make_dome(sun: Array, rng: np.random.Generator) -> Dome:
    """Make the dome for a sun's direction; ``rng`` shapes the clouds. Irradiance of the sun is 1 by convention."""
    nodes = (np.arange(SIZE) - (SIZE - 1) / 2) / (SIZE / 2 * 0.998)
    p, q = np.meshgrid(nodes, nodes, indexing="ij")
    radius = np.minimum(p * p + q * q, 1.0)  # texels outside the disc take part in interpolation only
    x, y, z = 2.0 * p / (1.0 + radius), 2.0 * q / (1.0 + radius), (1.0 - radius) / (1.0 + radius)
    veil = np.exp(-z / 0.24)[..., None]
    colour = ZENITH_RGB * (1.0 - veil) + HORIZON_RGB * veil
    rgb = colour * _luminance(z, x * sun[0] + y * sun[1] + z * sun[2])[..., None]
    weight = np.where(p * p + q * q < 1.0, z * (1.0 + z) ** 2, 0.0)  # cosine times the solid angle of a texel
    weight /= weight.sum()
    rgb *= SKY_OVER_SUN / np.pi / (rgb.mean(axis=-1) * weight).sum()
    cover, lit = _clouds(x, y, z, sun, rng)
    cloud = np.array([1.0, 0.985, 0.96]) * (0.42 * lit[..., None]) + np.array([0.055, 0.06, 0.07])
    rgb = rgb * (1.0 - cover[..., None]) + cloud * cover[..., None]
    irradiance, horizon = (rgb * weight[..., None]).sum(axis=(0, 1)), rgb[(z > 0.005) & (z < 0.04)].mean(axis=0)
    return Dome(rgb.astype(np.float32), irradiance.astype(np.float32), horizon.astype(np.float32))


def _luminance(z: Array, cos_gamma: Array) -> Array:
    """Luminance of the clear sky, any scale: equation 3 with the appendix's coefficients of Y."""
    a, b, c, d, e = np.array([0.1787, -0.3554, -0.0227, 0.1206, -0.0670]) * TURBIDITY + [
        -1.4630, 0.4275, 5.3251, -2.5771, 0.3703,
    ]  # fmt: skip
    gamma = np.arccos(np.clip(cos_gamma, -1.0, 1.0))
    towards_horizon = 1.0 + a * np.exp(b / np.maximum(z, 0.03))
    return np.asarray(towards_horizon * (1.0 + c * np.exp(d * gamma) + e * cos_gamma**2))


def _clouds(x: Array, y: Array, z: Array, sun: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Opacity and brightness [0, 1] of fair-weather clouds: noise on a plane overhead, lit from the sun's side."""
    field = np.zeros((1024, 1024))
    for octave in range(7):
        coarse = rng.standard_normal((2 ** (octave + 2),) * 2)
        field += zoom(coarse, 1024 // len(coarse), order=3, mode="grid-wrap", grid_mode=True) * 0.56**octave
    field = (field - field.mean()) / field.std()
    stretch = 155.0 / (z + 0.10)
    u, v = x * stretch, y * stretch
    density = map_coordinates(field, [u, v], order=1, mode="grid-wrap")
    towards_sun = map_coordinates(field, [u + 14.0 * sun[0], v + 14.0 * sun[1]], order=1, mode="grid-wrap")
    cover = np.clip((density - 0.55) / 1.1, 0.0, 1.0) ** 0.8 * 0.92
    cover *= np.clip(z / 0.10, 0.0, 1.0) ** 0.7
    lit = np.clip(0.72 - 0.30 * (towards_sun - density) - 0.10 * density, 0.25, 1.0)
    return cover, lit


@kernel
def sky_radiance(g: Float32Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Radiance of a dome's image ``g`` in a unit direction; below the horizon, the horizon's."""
    half, one = np.float32(SIZE / 2), np.float32(1.0)
    flat = max(np.float32(z), np.float32(0.0))
    scale = half * np.float32(0.998) / (flat + np.sqrt(x * x + y * y + flat * flat))
    u, v = half - np.float32(0.5) + x * scale, half - np.float32(0.5) + y * scale
    i, j = int(u), int(v)
    fu, fv = u - np.float32(i), v - np.float32(j)
    a, b, c, d = (one - fu) * (one - fv), (one - fu) * fv, fu * (one - fv), fu * fv
    return (
        g[i, j, 0] * a + g[i, j + 1, 0] * b + g[i + 1, j, 0] * c + g[i + 1, j + 1, 0] * d,
        g[i, j, 1] * a + g[i, j + 1, 1] * b + g[i + 1, j, 1] * c + g[i + 1, j + 1, 1] * d,
        g[i, j, 2] * a + g[i, j + 1, 2] * b + g[i + 1, j, 2] * c + g[i + 1, j + 1, 2] * d,
    )
