# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A mountain's flank: valley on one side, summits on the other, gullies that run through the world from above it.

Three grids, each finer and smaller than the one before: the region down to the horizon (10 m), the neighbourhood that
can be told apart by eye (1 m), the world itself. Each is eroded, and takes its shape from the coarser one.
"""

from typing import Final, NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator, RectBivariateSpline
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Array
from fieldtruth.world.backdrop import Land
from fieldtruth.world.noise import fractal_noise
from fieldtruth.world.relief.erosion import collapsed, eroded
from fieldtruth.world.relief.gentle import gentled, slope_limit

REGION: Final = 1100.0
"""Half the side [m] of the region."""
MARGIN: Final = 90.0
"""Width [m] of the neighbourhood around the world."""

_PROFILE: Final = (
    (-1100, 0), (-700, -5), (-330, -11), (-190, -7), (-150, 0), (-110, 12), (-60, 21), (-25, 25), (-17, 20), (-12, 10),
    (10, 9), (15, 22), (22, 27), (32, 24), (55, 20), (150, 17), (280, 20), (370, 3), (470, -16), (1100, -6),
)  # fmt: skip
"""Slope [deg] upwards along y at y [m]: far side of the valley, its floor, lower flank, shoulder, upper flank, top."""


class Mountain(NamedTuple):
    """The world's ground, (nx, ny) each, and the land about it."""

    heights: Array  # [m]
    drained: Array  # [m^2] that drains through each node, from the mountain above as well
    land: Land


def mountain(
    x: Array, y: Array, *, route_distance: Land, rng: np.random.Generator, roughness: float, gullies: float,
    route_slope_deg: float, steepest_deg: float,
) -> Mountain:  # fmt: skip
    """Shape the flank on nodes x, y [m] of the world.

    ``roughness`` [m] is the deviation of the noise from which erosion starts, ``gullies`` scales what streams cut.
    ``route_distance`` [m] tells how far a place is from the nearest route, where the slope stays below
    ``route_slope_deg``; beyond 8 m it reaches up to ``steepest_deg``.
    """
    region = _region(rng)
    near_x, near_y = (np.arange(c[0] - MARGIN, c[-1] + MARGIN + 0.5) for c in (x, y))
    gx, gy = np.meshgrid(near_x, near_y, indexing="ij")
    distance = route_distance(gx, gy)
    h = region(near_x, near_y) + roughness * fractal_noise(near_x, near_y, wavelength=26.0, octaves=5, rng=rng)
    steep = slope_limit(distance, within=0.9 * route_slope_deg, beyond=steepest_deg + 4, near=2.5, far=9.0)
    h = gentled(h, 1.0, steep, rounds=60)
    away = np.clip(distance / 6.0, 0.25, 1.0)
    near = eroded(h, 1.0, strength=0.016 * gullies * away, creep=0.05, repose_deg=steepest_deg, steps=40)
    spline = RectBivariateSpline(near_x, near_y, near.heights)
    h = spline(x, y) + _grain(x, y, spline, route_distance, rng)
    strength = 0.002 * gullies * np.clip(route_distance(*np.meshgrid(x, y, indexing="ij")) / 4.0, 0.1, 1.0)
    spacing = float(x[1] - x[0])
    h = eroded(h, spacing, strength=strength, creep=0.001, repose_deg=steepest_deg, steps=10).heights
    drained = np.exp(RectBivariateSpline(near_x, near_y, np.log(near.drained), kx=1, ky=1)(x, y))
    return Mountain(h, drained, _joined(spline, region, (x, y)))


def along_routes(
    heights: Array, spacing: float, distance: Array, *, route_slope_deg: float, steepest_deg: float
) -> Array:
    """Heights (nx, ny) [m] whose slope keeps below one bound on the route and another far from it.

    Bumps of less than about 2 m are smoothed away on the route, to a few centimetres.
    """
    limit = slope_limit(distance, within=route_slope_deg, beyond=steepest_deg, near=1.3, far=6.0)
    h = collapsed(heights, spacing, repose_deg=steepest_deg, steps=10)
    h += (gaussian_filter(h, 0.6 / spacing) - h) * np.clip(1.5 - distance / 2.0, 0.0, 0.8)
    return gentled(h, spacing, limit, rounds=60)


def _region(rng: np.random.Generator) -> RectBivariateSpline:
    """Far land as a spline: a ridge and a valley along x, bent, with eroded spurs that begin off the world."""
    c = np.arange(-REGION, REGION + 1, 10.0)
    gx, gy = np.meshgrid(c, c, indexing="ij")
    away = np.hypot(np.maximum(np.abs(gx) - 50, 0), np.maximum(np.abs(gy) - 25, 0))
    far = np.clip((away - 30) / 350, 0, 1)
    bend = (4.0 + 90.0 * far) * fractal_noise(c, c, wavelength=620.0, octaves=3, rng=rng)
    knots, slopes = np.array(_PROFILE, np.float64).T
    fine = np.arange(-REGION - 600, REGION + 601, 1.0)
    profile = np.cumsum(np.tan(np.radians(PchipInterpolator(knots, slopes)(fine.clip(-REGION, REGION)))))
    profile -= np.interp(0.0, fine, profile)
    h = np.interp(gy + bend, fine, profile)
    ridged = 1.0 - np.abs(fractal_noise(c, c, wavelength=420.0, octaves=5, rng=rng, gain=0.5))
    h += far * 26.0 * ridged
    h = eroded(h, 10.0, strength=0.0035 * far, creep=1.0, repose_deg=38.0, steps=30).heights
    return RectBivariateSpline(c, c, h)


def _grain(
    x: Array, y: Array, near: RectBivariateSpline, route_distance: Land, rng: np.random.Generator
) -> Array:  # fmt: skip
    """Small unevenness [m]: hummocks, rougher away from the routes; ribs and ledges of rock where it is steep."""
    away = np.clip((route_distance(*np.meshgrid(x, y, indexing="ij")) - 0.8) / 5.0, 0.0, 1.0)
    hummocks = fractal_noise(x, y, wavelength=3.2, octaves=3, rng=rng)
    slope = np.hypot(near(x, y, dx=1), near(x, y, dy=1))
    rocky = np.clip((slope - 0.3) / 0.25 + 0.5 * fractal_noise(x, y, wavelength=9.0, octaves=2, rng=rng), 0.0, 1.0)
    ribs = 0.8 - np.abs(fractal_noise(x, y, wavelength=4.5, octaves=4, rng=rng, gain=0.55))
    return np.asarray((0.012 + 0.05 * away) * hummocks + 0.34 * away * rocky * ribs)


def _joined(near: RectBivariateSpline, far: RectBivariateSpline, axes: tuple[Array, Array]) -> Land:
    half_x, half_y = (float(a[-1]) for a in axes)

    def land(x: Array, y: Array) -> Array:
        away = np.maximum(np.abs(x) - half_x, np.abs(y) - half_y)
        share = np.clip((away - MARGIN + 40) / 38, 0, 1)
        share = share * share * (3 - 2 * share)
        inside = near.ev(x.clip(-half_x - MARGIN, half_x + MARGIN), y.clip(-half_y - MARGIN, half_y + MARGIN))
        return np.asarray(inside * (1 - share) + far.ev(x.clip(-REGION, REGION), y.clip(-REGION, REGION)) * share)

    return land
