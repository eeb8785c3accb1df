# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The image sensor: from light on its pixels to raw values, and back to light in three channels.

The model is that of EMVA Standard 1288, release 4.0, chapter 2: a raw value y has the mean K (mu_p + mu_d) and the
variance K^2 sigma_d^2 + K^2 mu_p + 1 / 12, with mu_p electrons of light, whose number has a Poisson distribution, read
noise of sigma_d electrons, and a system gain of K per electron. The Poisson distribution is replaced by the normal one
of the same variance; their skewness differs by 1 / sqrt(mu_p).
"""

from typing import Final

import numpy as np

from fieldtruth.kernels.camera import Sensor
from fieldtruth.sensors.camera.response import FULL_SCALE, LUMINANCE
from fieldtruth.sensors.camera.signal import CameraSignal, Mosaic

_FILTERS: Final[dict[Mosaic, tuple[int, int, int, int]]] = {
    "rggb": (0, 1, 1, 2),
    "grbg": (1, 0, 2, 1),
    "gbrg": (1, 2, 0, 1),
    "bggr": (2, 1, 1, 0),
}
"""Channel of the pixels at (0, 0), (0, 1), (1, 0), (1, 1)."""


def sensor_of(signal: CameraSignal, gain: float) -> Sensor:
    """Return the sensor of a camera at a gain of its amplifier.

    At 0 dB the full well is at the full scale of the raw values, which is white in the photograph. Without a full well
    a unit of light is one electron.
    """
    full_scale, top = FULL_SCALE[signal.response], 1.0 if signal.bits is None else 2.0**signal.bits - 1.0
    most = full_scale if signal.full_well_e is None else signal.full_well_e / gain
    colours = np.diag(signal.responsivity)
    grey = (LUMINANCE * signal.responsivity)[None] / float(LUMINANCE @ np.array(signal.responsivity))
    return Sensor(
        channels=np.ascontiguousarray(grey if signal.mosaic == "mono" else colours, np.float64),
        filters=_FILTERS.get(signal.mosaic, (0, 0, 0, 0)),
        electrons=most / full_scale,
        photons=float(signal.photon_noise),
        read_noise_e=signal.read_noise_e,
        gain=(top - signal.black_level) / most,
        black=float(signal.black_level),
        top=top,
        step=0.0 if signal.bits is None else 1.0,
    )


def raw_shape(signal: CameraSignal, height: int, width: int) -> tuple[int, int, int]:
    """Rows, columns, values in each pixel."""
    return height, width, 3 if signal.mosaic == "none" else 1
