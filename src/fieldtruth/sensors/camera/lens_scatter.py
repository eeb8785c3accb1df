# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bloom about bright parts of the image, and colours that the lens puts at different distances from its centre."""

from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.compile import kernel

CELL: Final = 8
"""Side [pixel] of the cells in which light is scattered: bloom is smooth over more pixels."""
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
    _blend(light, np.asarray(0.5 * (near + far), np.float32), np.float32(share))


def cell_means(light: Float32Array) -> Float32Array:
    """Mean light of cells of CELL x CELL pixels, fewer at the right and lower border."""
    height, width, _ = light.shape
    cells = np.zeros((-(-height // CELL), -(-width // CELL), 3), np.float32)
    _means(light, cells)
    return cells


@kernel
def _means(light: Float32Array, cells: Float32Array) -> None:
    rows, columns, _ = cells.shape
    for i in range(rows):
        for j in range(columns):
            upper, left = i * CELL, j * CELL
            lower, right = min(upper + CELL, light.shape[0]), min(left + CELL, light.shape[1])
            per = np.float32(1.0 / ((lower - upper) * (right - left)))
            for v in range(upper, lower):
                for u in range(left, right):
                    for channel in range(3):
                        cells[i, j, channel] += light[v, u, channel] * per


@kernel
def _blend(light: Float32Array, cells: Float32Array, share: np.float32) -> None:
    height, width, _ = light.shape
    rows, columns, _ = cells.shape
    half, zero, one = np.float32(0.5), np.float32(0.0), np.float32(1.0)
    for v in range(height):
        y = min(max((np.float32(v) + half) / np.float32(CELL) - half, zero), np.float32(rows - 1))
        i = min(int(y), max(rows - 2, 0))
        below, fy = min(i + 1, rows - 1), y - np.float32(i)
        for u in range(width):
            x = min(max((np.float32(u) + half) / np.float32(CELL) - half, zero), np.float32(columns - 1))
            j = min(int(x), max(columns - 2, 0))
            beside, fx = min(j + 1, columns - 1), x - np.float32(j)
            for channel in range(3):
                upper = cells[i, j, channel] + fx * (cells[i, beside, channel] - cells[i, j, channel])
                lower = cells[below, j, channel] + fx * (cells[below, beside, channel] - cells[below, j, channel])
                scattered = upper + fy * (lower - upper)
                light[v, u, channel] = (one - share) * light[v, u, channel] + share * scattered


@kernel
def spread_colours(light: Float32Array, cx: float, cy: float, red: float, blue: float, out: Float32Array) -> None:
    """Fill ``out`` (h, w, 3) with light whose red and blue are farther from (cx, cy) [pixel] than green.

    They are magnified by 1 + ``red`` and 1 + ``blue``, and interpolated linearly.
    """
    height, width, _ = light.shape
    zero, one = np.float32(0.0), np.float32(1.0)
    x0, y0 = np.float32(cx), np.float32(cy)
    right, lower = np.float32(width - 1), np.float32(height - 1)
    for v in range(height):
        for u in range(width):
            out[v, u, 1] = light[v, u, 1]
    for channel in (0, 2):
        scale = np.float32(1.0 / (1.0 + (red if channel == 0 else blue)))
        for v in range(height):
            y = min(max(y0 + (np.float32(v) - y0) * scale, zero), lower)
            i = min(int(y), height - 2)
            fy = y - np.float32(i)
            for u in range(width):
                x = min(max(x0 + (np.float32(u) - x0) * scale, zero), right)
                j = min(int(x), width - 2)
                fx = x - np.float32(j)
                out[v, u, channel] = (one - fy) * (
                    (one - fx) * light[i, j, channel] + fx * light[i, j + 1, channel]
                ) + fy * ((one - fx) * light[i + 1, j, channel] + fx * light[i + 1, j + 1, channel])
