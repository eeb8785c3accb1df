# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bloom about bright parts of the image, and colours that the lens puts at different distances from its centre."""

from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.camera import CELL, blend_cells, fill_means

_TAIL: Final = 4.0


def add_bloom(light: Float32Array, share: float, sigma_px: float) -> None:
    """Scatter a share of light (h, w, 3) around where it belongs: half of it four times as far as the other half.

    The glare spread function of a lens falls more slowly than a normal one (ISO 9358; McCann and Rizzi, The Art and
    Science of HDR Imaging, 2011), as a sum of two does. Light that would leave the image stays at its border.
    """
    cells = cell_means(light)
    near, far = (
        gaussian_filter(cells, (each / CELL, each / CELL, 0.0), mode="nearest") for each in (sigma_px, _TAIL * sigma_px)
    )
    blend_cells(light, np.asarray(0.5 * (near + far), np.float32), np.float32(share))


def cell_means(light: Float32Array) -> Float32Array:
    """Mean light of cells of CELL x CELL pixels, fewer at the right and lower border."""
    height, width, _ = light.shape
    cells = np.zeros((-(-height // CELL), -(-width // CELL), 3), np.float32)
    fill_means(light, cells)
    return cells
