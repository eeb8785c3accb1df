# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Intrinsics of a camera as kernels read them, and for every lens but the pinhole a table of its rays' directions.

A pinhole's directions are computed where they are needed, which is faster. Other lenses have to be inverted by
iteration; that is done once.
"""

from functools import lru_cache
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Float32Array
from fieldtruth.core.lenses import FLAT, Lens, directions
from fieldtruth.experiment.imaging_config import ImagingConfig
from fieldtruth.kernels.camera_rays import NO_TABLE, Intrinsics


def intrinsics_of(config: ImagingConfig) -> Intrinsics:
    """Intrinsics of a camera, whatever its lens: ``lenses.Lens`` states what they mean for each model."""
    lens = config.projection
    return Intrinsics(lens.fx, lens.fy, lens.cx, lens.cy)


_ROWS: Final = 256  # inverted at once


def ray_table(config: ImagingConfig) -> Float32Array:
    """Return unit direction x, y, z in the optical frame, and depth over range, at the pixel centres (h, w, 4).

    Depth is measured along the optical axis by the lenses of ``FLAT``, along the ray by the others. Where the lens has
    no ray all four are 0. Single precision, as of the rays themselves, moves a ray by less than 1e-7 rad, 1e-4 pixel at
    a focal length of 1000 pixels. The table of a pinhole with the whole image is NO_TABLE. Callers share it and must
    not write.
    """
    lens = config.projection
    if lens.model == "pinhole" and lens.circle >= np.pi / 2:
        return NO_TABLE
    return _table(lens, config.width, config.height)


@lru_cache(maxsize=4)
def _table(lens: Lens, width: int, height: int) -> Float32Array:
    table = np.zeros((height, width, 4), np.float32)
    for first in range(0, height, _ROWS):
        v = np.arange(first, min(first + _ROWS, height))
        rays = directions(lens, np.arange(width), v[:, None])
        table[v, :, :3] = np.nan_to_num(rays)
        table[v, :, 3] = np.nan_to_num(rays[..., 2]) if lens.model in FLAT else ~np.isnan(rays[..., 0])
    return table
