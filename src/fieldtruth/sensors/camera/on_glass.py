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
from fieldtruth.kernels.camera import draw_drops
from fieldtruth.sensors.camera.lens_scatter import cell_means

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
        draw_drops(light, soft, drops)
