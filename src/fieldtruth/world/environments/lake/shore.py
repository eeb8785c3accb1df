# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The shape of a lake's shore: where the water's edge runs, and the ground above and below the water.

The height depends on the distance to the water's edge: a beach or a scarp, then the bank, which flattens into the
meadow; under water a shelf, then the slope down to the bed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter

from fieldtruth.core.arrays import Array
from fieldtruth.world.environments.lake.config import Config
from fieldtruth.world.environments.layout import hills_spacing
from fieldtruth.world.grids import Line, fractal_noise, grid_axes, make_heightfield, make_raster
from fieldtruth.world.materials import Roughness
from fieldtruth.world.model import Heightfield, Raster
from fieldtruth.world.relief import with_microrelief

DEPTH: Final = 3.5  # [m] of the lake's bed
DRY: Final = 6.0  # [m] of land between a corridor's centre line and the water
WORN: Final = 2.4
"""Distance [m] from a corridor's centre line within which the ground is smoothed."""


@dataclass(frozen=True, kw_only=True)
class Shore:
    """A lake's shore: the ground, the distance to the water, and the steepness of the bank."""

    field: Heightfield
    inland: Raster
    """Distance [m] to the water's edge, below 0 in the lake."""
    scarp: Raster
    """0 at a beach, 1 where the bank ends in a scarp."""


def make_shore(
    config: Config, corridors: Sequence[Line], rng: np.random.Generator, fine_rng: np.random.Generator
) -> Shore:
    """Shape a shore along x with the lake at negative y; ``corridors`` stay on land."""
    x, y = grid_axes(config.size, spacing := hills_spacing(config.size))
    coves = fractal_noise(x, y, wavelength=34.0, octaves=4, rng=rng, gain=0.46)
    inland = y[None, :] - config.edge + config.bends * coves
    nodes = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    off_corridor = np.full(inland.shape, np.inf)
    for line in corridors:
        off_corridor = np.minimum(off_corridor, line.distance(nodes).reshape(inland.shape))
    inland = _smooth_max(inland, DRY - off_corridor, 1.0) if corridors else inland
    inland = _signed_distance(inland > 0) * spacing
    turns = fractal_noise(x, y, wavelength=30.0, octaves=2, rng=rng, gain=0.4)
    scarp = 1.0 / (1.0 + np.exp(-2.4 * (turns + 0.15)))
    slumps = fractal_noise(x, y, wavelength=4.5, octaves=3, rng=rng, gain=0.45)
    swell = fractal_noise(x, y, wavelength=30.0, octaves=3, rng=rng, gain=0.4)
    above = _above(inland, scarp, slumps, config.bank) + config.relief * swell * np.clip(inland / 18.0, 0.0, 1.0)
    height = np.where(inland > 0, above, -_below(-inland, scarp))
    # Along corridors the bank has an even slope.
    worn = np.exp(-((off_corridor / WORN) ** 2))
    height += worn * (gaussian_filter(height, WORN / spacing, mode="nearest") - height)
    fine = grid_axes(config.size, config.grid)
    heights = with_microrelief(height + config.water_level, (x, y), fine, _cover(config, inland, height), fine_rng)
    return Shore(
        field=make_heightfield(heights, config.grid, *fine),
        inland=make_raster(inland, spacing, x, y),
        scarp=make_raster(scarp, spacing, x, y),
    )


def _cover(config: Config, inland: Array, height: Array) -> list[tuple[Roughness, Array]]:
    """Mud at and under the water, earth on the scarps, meadow elsewhere, with their shares of the ground."""
    mud = np.clip(1.5 - inland / 2.0, 0.0, 1.0)
    scarp = (1.0 - mud) * np.clip((np.hypot(*np.gradient(height, hills_spacing(config.size))) - 0.4) / 0.2, 0.0, 1.0)
    shares = {"mud": mud, "earth": scarp, "meadow": 1.0 - mud - scarp}
    return [(config.roughness_of(ground), share) for ground, share in shares.items()]


def _smooth_max(a: Array, b: Array, width: float) -> Array:
    return np.asarray(np.logaddexp(a / width, b / width) * width)


def _signed_distance(land: NDArray[np.bool_]) -> Array:
    """Distance [nodes] to the border of a mask, positive inside, smooth over the grid's steps."""
    inside, outside = distance_transform_edt(land), distance_transform_edt(~land)
    return np.asarray(gaussian_filter(np.where(land, inside - 0.5, 0.5 - outside), 2.5, mode="nearest"))


def _above(inland: Array, scarp: Array, slumps: Array, bank: float) -> Array:
    """Height [m] over the water at a distance [m] inland."""
    d = np.maximum(inland, 0.0)
    beach = 3.6 * (1.0 - scarp)
    rise = (bank - 0.8) * (1.0 - np.exp(-(np.maximum(d - beach, 0.0) ** 1.3) / 21.0)) + 0.022 * d
    strand = 0.09 * np.minimum(d, beach)
    # The scarp recedes where the bank has slumped.
    cut = np.clip((d - 0.4 - 0.5 * np.maximum(slumps, -0.6)) / 1.7, 0.0, 1.0)
    step = 1.0 * scarp**1.5 * cut * cut * (3.0 - 2.0 * cut) * np.exp(-np.maximum(d - 2.0, 0.0) / 7.0)
    return np.asarray(rise + strand + step + 0.03 * d * (d < 0.5))


def _below(out: Array, scarp: Array) -> Array:
    """Depth [m] at a distance [m] out from the water's edge."""
    d = np.maximum(out, 0.0)
    shelf = (0.09 + 0.16 * scarp) * d
    slope = 0.32 * np.maximum(d - 5.0, 0.0)
    return np.asarray(DEPTH * np.tanh((shelf + slope) / DEPTH))
