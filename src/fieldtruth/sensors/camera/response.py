# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Response curves: from linear light, 1 is a white surface in the sun, to the values of a photograph."""

from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import kernel
from fieldtruth.render.atlas import srgb_from_linear
from fieldtruth.render.tonemap import FILMIC, FILMIC_TOP
from fieldtruth.sensors.camera.signal import Response

LUMINANCE: Final = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Of linear sRGB (ITU-R BT.709)."""
FULL_SCALE: Final[dict[Response, float]] = {"filmic": 7.25, "srgb": 1.0, "linear": 1.0}
"""Linear light from which a curve is white: there the sensor saturates."""
_STEPS: Final = 4096


class Curve(NamedTuple):
    """Bytes over the square root of linear light in [0, ``top``], as kernels take them."""

    bytes_of: NDArray[np.uint8]
    top: float


@cache
def curve_of(response: Response, contrast: float = 0.0) -> Curve:
    """Return a response curve whose slope is 1 + ``contrast`` times as great at medium grey, and less at both ends."""
    light, top = np.linspace(0.0, 1.0, _STEPS) ** 2, FILMIC_TOP if response == "filmic" else 1.0
    values = {"filmic": FILMIC / 255.0, "srgb": srgb_from_linear(light), "linear": light}[response]
    bent = values - 2.0 * contrast * values * (1.0 - values) * (1.0 - 2.0 * values)
    return Curve(np.rint(255.0 * bent).astype(np.uint8), top)


def encoded(light: Array, response: Response, contrast: float = 0.0) -> Array:
    """Values in [0, 1] of light of any shape."""
    table, top = curve_of(response, contrast)
    row = np.sqrt(np.clip(light, 0.0, top) / top) * (len(table) - 1)
    return np.asarray(np.interp(row, np.arange(len(table)), table / 255.0))


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
