# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tone curves: linear light becomes the 8 bits of sRGB, as in an ideal camera and as in a real one."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.compile import kernel
from fieldtruth.kernels.textures import srgb_from_linear

FILMIC_TOP: Final = 16.0
WHITE: Final = 2.0
"""Linear light from which on a pixel is white."""
_STEPS: Final = 4096
SPILL: Final = 0.07
"""Share of a pixel's light that a good lens spills into each of its four neighbours."""


def _curve() -> NDArray[np.uint8]:
    """SRGB bytes over the square root of linear light in [0, FILMIC_TOP].

    A filmic curve (Narkowicz 2015, ACES fit), scaled so that WHITE is white.
    """
    light = np.linspace(0.0, np.sqrt(FILMIC_TOP), _STEPS) ** 2
    film = light * (2.51 * light + 0.03) / (light * (2.43 * light + 0.59) + 0.14)
    film = np.minimum(film / film[np.searchsorted(light, WHITE)], 1.0)
    return np.rint(255.0 * srgb_from_linear(film)).astype(np.uint8)


FILMIC: Final = _curve()
"""The response curve of an ideal camera."""


@kernel
def tonemap(linear: Float32Array, photo: NDArray[np.uint8]) -> None:
    """Convert exposed linear light (h, w, 3) to sRGB, after spilling light into neighbours as a lens does."""
    height, width, _ = linear.shape
    scale = np.float32((_STEPS - 1) / np.sqrt(FILMIC_TOP))
    keep, spill, top = np.float32(1.0 - 4.0 * SPILL), np.float32(SPILL), np.float32(FILMIC_TOP)
    black = np.float32(0.0)  # where all is occluded, rounding leaves light just below 0
    for v in range(height):
        up, down = max(v - 1, 0), min(v + 1, height - 1)
        for u in range(width):
            left, right = max(u - 1, 0), min(u + 1, width - 1)
            for channel in range(3):
                near = (
                    linear[up, u, channel] + linear[down, u, channel]
                    + linear[v, left, channel] + linear[v, right, channel]
                )  # fmt: skip
                value = keep * linear[v, u, channel] + spill * near
                value = value if value < top else top  # also what is not a number, which no table has
                value = value if value > black else black
                photo[v, u, channel] = FILMIC[int(np.sqrt(value) * scale + np.float32(0.5))]


class Curve(NamedTuple):
    """Bytes over the square root of linear light in [0, ``top``], as kernels take them."""

    bytes_of: NDArray[np.uint8]
    top: float


@kernel
def apply_curve(light: Float32Array, gains: Float32Array, curve: Curve, photo: NDArray[np.uint8]) -> None:
    """Write the photograph (h, w, 3) of light (h, w, 3) with a gain (3,) for each channel."""
    table, top = curve.bytes_of, np.float32(curve.top)
    height, width, _ = light.shape
    scale, half, zero = np.float32((len(table) - 1) / np.sqrt(curve.top)), np.float32(0.5), np.float32(0.0)
    for v in range(height):
        for u in range(width):
            for channel in range(3):
                value = min(max(light[v, u, channel] * gains[channel], zero), top)
                photo[v, u, channel] = table[int(np.sqrt(value) * scale + half)]
