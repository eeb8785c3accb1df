# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""How the colour of the ground varies over decimetres to metres: drier and greener patches, dust, trodden lanes."""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Terrain

SCALES: Final = ((0.25, 0.10), (0.6, 0.10), (2.0, 0.10), (8.0, 0.08))
"""Width [m] of patches and standard deviation of the logarithm of their brightness."""
DRYNESS: Final = (0.35, 0.0, 0.0)
"""Changes of red, green and blue with the dryness of green plants: a bleached patch is redder."""
LANES: Final = 0.10
"""By how much the middle of a trail is brighter than its edges, where litter lies."""


def ground_wear(terrain: Terrain, rgb: NDArray[np.floating], seed: int) -> Array:
    """Factors (nx, ny, 4) at the cover's nodes, about 1: on red, green and blue off trails, on brightness on trails.

    ``rgb`` (nx, ny, 3) is the colour of the ground there: what is green varies in dryness, the rest in brightness only.
    """
    rng = np.random.default_rng([seed, 11])
    shape, spacing = terrain.cover.values.shape[:2], terrain.cover.spacing
    fields = [[_field(rng, shape, width / spacing, sigma) for width, sigma in SCALES] for _ in range(2)]
    bright, dry = np.sum(fields, axis=1)
    green = np.clip(6.0 * (rgb[..., 1] / np.maximum(rgb.mean(axis=-1), 1e-6) - 1.05), 0.0, 1.0)
    colour = np.exp(bright[..., None] + (green * dry)[..., None] * np.array(DRYNESS))
    x = terrain.cover.x0 + spacing * np.arange(shape[0])
    y = terrain.cover.y0 + spacing * np.arange(shape[1])
    inside = np.clip(-terrain.trail_distance.at(*np.meshgrid(x, y, indexing="ij")) / 0.6, 0.0, 1.0)
    trail = np.exp(bright + dry * 0.5 + LANES * (inside - 0.5))
    return np.concatenate([colour, trail[..., None]], axis=-1)


def _field(rng: np.random.Generator, shape: tuple[int, ...], width: float, sigma: float) -> Array:
    """Normal numbers of deviation ``sigma`` that vary over ``width`` [node]; 0 if that is less than a node."""
    white = rng.standard_normal(shape, dtype=np.float32)
    if width < 0.5:
        return np.zeros(shape)
    gain = max(
        np.sqrt(np.pi) * width, 1.0
    )  # a Gaussian of deviation s lowers that of white noise to 1 / (2 sqrt(pi) s)
    return np.asarray(sigma * gain * gaussian_filter(white, width / 2, mode="wrap"))
