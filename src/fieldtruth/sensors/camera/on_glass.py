# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Drops of water and specks of dust on the glass before a lens, which is focused far behind them.

A drop is a strong lens of its own: it shows the scene upside down and small (Roser and Geiger, "Video-based raindrop
detection for improved image registration", ICCV Workshops 2009), out of focus here, and darker towards its rim. Sizes,
speeds and lives of drops are our choice. All depend on the view, the seed and the stamp, not on photographs before.
"""

from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.random import rng_of
from fieldtruth.kernels.compile import kernel
from fieldtruth.sensors.camera.lens_scatter import CELL, cell_means

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
    """Draw drops (n, 3), see ``drops_at``, into light (h, w, 3)."""
    if len(drops):
        soft: Float32Array = gaussian_filter(cell_means(light), (1.5, 1.5, 0.0), mode="nearest")
        _draw_drops(light, soft, drops)


@kernel
def _draw_drops(light: Float32Array, soft: Float32Array, drops: Array) -> None:
    height, width, _ = light.shape
    rows, columns, _ = soft.shape
    for n in range(len(drops)):
        x, y, radius = drops[n]
        shrinks = 0.35 * height / radius  # the drop shows 0.7 of the image's height
        for v in range(max(int(y - radius), 0), min(int(y + radius) + 2, height)):
            for u in range(max(int(x - radius), 0), min(int(x + radius) + 2, width)):
                dx, dy = u - x, v - y
                part = np.sqrt(dx * dx + dy * dy) / radius
                if part >= 1.0:
                    continue
                edge = min((1.0 - part) / 0.45, 1.0)
                cover = np.float32(0.92 * edge * edge * (3.0 - 2.0 * edge))
                i = min(max(int((y - dy * shrinks) / CELL), 0), rows - 1)
                j = min(max(int((x - dx * shrinks) / CELL), 0), columns - 1)
                rim = np.float32(1.0 - 0.4 * part**4)
                for channel in range(3):
                    light[v, u, channel] += cover * (rim * soft[i, j, channel] - light[v, u, channel])


@kernel
def add_dust(light: Float32Array, dust: Array) -> None:
    """Dim light (h, w, 3) behind specks (n, 4), see ``dust_of``: normal profiles, as they are far out of focus."""
    height, width, _ = light.shape
    for n in range(len(dust)):
        x, y, radius, opacity = dust[n]
        reach = 2.0 * radius
        for v in range(max(int(y - reach), 0), min(int(y + reach) + 2, height)):
            for u in range(max(int(x - reach), 0), min(int(x + reach) + 2, width)):
                part = ((u - x) ** 2 + (v - y) ** 2) / (radius * radius)
                left = np.float32(1.0 - opacity * np.exp(-2.0 * part))
                for channel in range(3):
                    light[v, u, channel] *= left
