# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Response curves: from linear light, 1 is a white surface in the sun, to the values of a photograph."""

from functools import cache
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.kernels.camera import FILMIC, FILMIC_TOP, Curve
from fieldtruth.kernels.textures import srgb_from_linear
from fieldtruth.sensors.camera.signal import Response

LUMINANCE: Final = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Of linear sRGB (ITU-R BT.709)."""
FULL_SCALE: Final[dict[Response, float]] = {"filmic": 7.25, "srgb": 1.0, "linear": 1.0}
"""Linear light from which a curve is white: there the sensor saturates."""
_STEPS: Final = 4096


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
