# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Drops, flakes and dust before a camera's sensor: those that fall through an exposure, and those on the glass.

docs/weather.md explains single drops of rain and flakes of snow before a camera, and docs/camera_signal.md drops and
dust on the glass, which depend on the view, the seed and the stamp, not on photographs before. Sizes of drops in the
air are distributed as extinction and LiDARs have them (``sense.air``); what is smaller or farther than what is drawn is
part of the air's extinction.
"""

from typing import Final, NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter

from fieldtruth.core import lenses
from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.random import rng_of
from fieldtruth.experiment.light_config import WeatherConfig
from fieldtruth.kernels.camera import draw_drops, draw_streaks
from fieldtruth.kernels.light import EXPOSURE, Shading
from fieldtruth.sense.air import Drops, rain, snow
from fieldtruth.sensors.camera.photo import cell_means

DROP_LIGHT: Final = 0.94
"""Share of the light through a drop, of 165 deg of the scene (Garg and Nayar, Int. J. Computer Vision 75, 2007)."""
FLAKE_ALBEDO: Final = 0.9
"""Of fresh snow in visible light (Wiscombe and Warren, J. Atmos. Sci. 37, 1980: above 0.9)."""
APERTURE: Final = 1.2e-3
"""[m] of a small lens, of 4 mm at f/3.5. It is focused far away: a point at a distance d is as wide as this there."""
_NEAREST: Final = 0.25  # [m]
_FARTHEST: Final = 15.0  # [m]
_MOST: Final = 40_000
"""Particles of a photograph; where there are more, those that are farthest are not drawn."""
_LEAST_MM: Final = {"rain": 1.0, "snow": 0.5}
"""Melted diameter [mm] of the smallest that are drawn."""


class Particles(NamedTuple):
    """Particles of one kind: position (n, 3) [m] in the optical frame, diameter and fall speed (n,) [m], [m/s]."""

    position: Array
    diameter: Array
    speed: Array


def fall_speed(kind: str, diameter_mm: Array) -> Array:
    """Terminal velocity [m/s] of raindrops (Atlas, Srivastava and Sekhon 1973) or flakes (Locatelli and Hobbs 1974)."""
    if kind == "rain":
        return np.asarray(np.maximum(9.65 - 10.3 * np.exp(-0.6 * diameter_mm), 0.0))
    return np.asarray(0.8 * diameter_mm**0.16)


def particles_of(kind: str, drops: Drops, half_angle: float, rng: np.random.Generator) -> Particles:
    """Particles within a cone of a half angle [rad] about the optical axis; as many as Poisson's law has there."""
    least = _LEAST_MM[kind]
    per_m3 = drops.per_m3 * np.exp(-drops.per_mm * least)
    per_metre3 = 2.0 * np.pi / 3.0 * (1.0 - np.cos(half_angle)) * per_m3
    far = min((_MOST / per_metre3 + _NEAREST**3) ** (1 / 3), _FARTHEST)
    count = rng.poisson(per_metre3 * (far**3 - _NEAREST**3))
    distance = (_NEAREST**3 + rng.random(count) * (far**3 - _NEAREST**3)) ** (1 / 3)
    cosine, turn = 1.0 - rng.random(count) * (1.0 - np.cos(half_angle)), 2.0 * np.pi * rng.random(count)
    sine = np.sqrt(1.0 - cosine**2)
    position = distance[:, None] * np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine], axis=1)
    melted = least + rng.exponential(1.0 / drops.per_mm, count)
    diameter_mm = drops.size[0] * melted ** drops.size[1]
    return Particles(position, 1e-3 * diameter_mm, fall_speed(kind, diameter_mm))


def streak_of(
    particles: Particles, lens: lenses.Lens, poses: Array, time_s: float
) -> tuple[Float32Array, Float32Array, Float32Array]:
    """Ends (n, 2, 2) [pixel], width [pixel] and opacity (n,) of streaks.

    ``poses`` (3, 4, 4) are ``world_from_optical`` at the begin, middle and end of the exposure.
    """
    middle = particles.position @ poses[1, :3, :3].T + poses[1, :3, 3]
    fallen = np.zeros_like(middle)
    fallen[:, 2] = 0.5 * time_s * particles.speed
    ends = [lenses.project(lens, (p - pose[:3, 3]) @ pose[:3, :3]) for p, pose in
            ((middle + fallen, poses[0]), (middle - fallen, poses[2]))]  # fmt: skip
    per_metre = lens.fx / np.linalg.norm(particles.position, axis=1)
    width = per_metre * np.hypot(particles.diameter, APERTURE)
    length = np.linalg.norm(ends[1] - ends[0], axis=1)
    covered = np.pi / 4 * (per_metre * particles.diameter) ** 2
    opacity = covered / ((length + width) * np.maximum(width, 1.0))
    seen = np.isfinite(length)
    return (
        np.stack(ends, axis=1)[seen].astype(np.float32),
        width[seen].astype(np.float32),
        np.minimum(opacity[seen], 1.0).astype(np.float32),
    )


def add_streaks(
    linear: Float32Array,
    shading: Shading,
    weather: WeatherConfig,
    lens: lenses.Lens,
    poses: Array,
    time_s: float,
    rng: np.random.Generator,
) -> None:
    """Draw the drops and flakes of one exposure into light (h, w, 3); ``poses`` as for ``streak_of``."""
    height, width, _ = linear.shape
    corners = lenses.directions(
        lens, np.array([0.0, width - 1.0, 0.0, width - 1.0]), np.array([0, 0, 1, 1]) * (height - 1.0)
    )
    half = float(np.nanmax(np.arccos(np.clip(np.nan_to_num(corners[:, 2], nan=-1.0), -1.0, 1.0))))
    around = shading.light.volume[:, :, 0, 0:12:4].mean(axis=(0, 1)) * np.float32(EXPOSURE) * shading.exposure
    falling = [("rain", rain(weather.rain_mm_h, 550.0), DROP_LIGHT)] if weather.rain_mm_h else []
    falling += [("snow", snow(weather.snow_mm_h), FLAKE_ALBEDO)] if weather.snow_mm_h else []
    for kind, drops, share in falling:
        found = particles_of(kind, drops, min(half + 0.05, np.pi), rng)
        draw_streaks(*streak_of(found, lens, poses, time_s), np.asarray(np.float32(share) * around, np.float32), linear)


_LIFE_S: Final = (10.0, 60.0)
_RADIUS: Final = 0.018
"""Median radius of a drop over the image's height; a standard deviation of its logarithm is ``_SPREAD``."""
_SPREAD: Final = 0.45
_STICKS: Final = 0.6  # share of drops that do not slide
_FASTEST: Final = 0.03  # [image heights / s]
_DUST_RADIUS: Final = 0.012
_DUST_OPACITY: Final = (0.02, 0.20)


def drops_at(seed: int, view: str, count: int, time_s: float, shape: tuple[int, int]) -> Array:
    """Drops (count, 3) on the glass of a view at a time: u, v, radius [pixel] in an image (height, width)."""
    height, width = shape
    found = np.empty((count, 3))
    for k in range(count):
        life, begun = rng_of(seed, view, "drop", k).uniform((_LIFE_S[0], 0.0), (_LIFE_S[1], 1.0))
        turns = time_s / life + begun
        rng = rng_of(seed, view, "drop", k, int(turns))
        u, v, slides, speed = rng.random(4)
        radius = _RADIUS * np.exp(_SPREAD * rng.standard_normal())
        slid = (slides > _STICKS) * speed * _FASTEST * life * (turns % 1.0)
        found[k] = u * width, (v + slid) * height, radius * height
    return found


def dust_of(seed: int, view: str, count: int, shape: tuple[int, int]) -> Array:
    """Specks (count, 4) on the glass of a view: u, v, radius [pixel], opacity."""
    rng = rng_of(seed, view, "dust")
    height, width = shape
    radius = _DUST_RADIUS * height * np.exp(_SPREAD * rng.standard_normal(count))
    return np.stack(
        [*(rng.random((2, count)) * [[width], [height]]), radius, rng.uniform(*_DUST_OPACITY, count)], axis=1
    )


def add_drops(light: Float32Array, drops: Array) -> None:
    """Draw drops (n, 3), see ``drops_at``, into light (h, w, 3).

    Each shows the scene upside down and small (Roser and Geiger, "Video-based raindrop detection for improved image
    registration", ICCV Workshops 2009).
    """
    if len(drops):
        soft: Float32Array = gaussian_filter(cell_means(light), (1.5, 1.5, 0.0), mode="nearest")
        draw_drops(light, soft, drops)
