# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ripples of water in wind: waves that travel, in the normals that photographs reflect. The surface stays a plane.

Their mean-square slopes are those that Cox and Munk (1954, J. Opt. Soc. Am. 44) measured on a clean sea: 0.00316 U
along the wind and 0.003 + 0.00192 U across it, of the mean speed U. Each part of the spectrum has the same share in
the logarithm of the wavelength, as in Phillips's saturation range, from the waves that are slowest, of 17 mm, to those
of the peak that the wind has raised after FETCH (JONSWAP: Hasselmann et al. 1973). Gravity and surface tension give
each its speed: omega^2 = g k + T k^3. Slopes and peak follow the mean wind, not its gusts.
"""

from typing import Final, NamedTuple, Self

import numpy as np
from scipy.optimize import brentq

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.random import rng_of
from fieldtruth.experiment.wind_config import WindConfig

COUNT: Final = 48
GRAVITY: Final = 9.81
"""[m/s^2]"""
TENSION: Final = 7.28e-5
"""[m^3/s^2] Surface tension of water over its density."""
FETCH: Final = 50.0
"""[m] Of water that the wind has crossed; assumed."""
_WIDEST: Final = np.radians(85.0)  # between wind and waves, before they are turned to have the two slopes


def mean_square_slopes(speed: float) -> tuple[float, float]:
    """Mean-square slopes along and across a wind of a speed [m/s]."""
    return 0.00316 * speed, 0.003 + 0.00192 * speed


class Ripples(NamedTuple):
    """Waves (n,) of the slope: ``slope`` cos(k . xy - omega t + phase) along k."""

    k: Array  # (n, 2) [rad/m] in the world
    omega: Array  # (n,) [rad/s]
    slope: Array  # (n,)
    phase: Array  # (n,) [rad]

    @classmethod
    def drawn(cls, config: WindConfig, seed: int) -> Self:
        """Draw the waves of a wind above 0 m/s."""
        rng, speed = rng_of(seed, "wind", "ripples"), config.speed_m_s
        along, across = mean_square_slopes(speed)
        peak_hz = 3.5 * GRAVITY / speed * (GRAVITY * FETCH / speed**2) ** -0.33
        shortest = 2.0 * np.pi * np.sqrt(TENSION / GRAVITY)
        longest = max(GRAVITY / (2.0 * np.pi * peak_hz**2), 2.0 * shortest)
        number = 2.0 * np.pi / shortest * (shortest / longest) ** ((np.arange(COUNT) + rng.random(COUNT)) / COUNT)
        aside = np.tan(_WIDEST * (2.0 * (rng.permutation(COUNT) + rng.random(COUNT)) / COUNT - 1.0))

        def excess(scale: float) -> float:
            return float(np.mean(1.0 / (1.0 + (scale * aside) ** 2))) - along / (along + across)

        heading = np.arctan2(config.heading[1], config.heading[0]) + np.arctan(brentq(excess, 1e-9, 1e9) * aside)
        return cls(
            number[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1),
            np.sqrt(GRAVITY * number + TENSION * number**3),
            np.full(COUNT, np.sqrt(2.0 * (along + across) / COUNT)),
            rng.uniform(0.0, 2.0 * np.pi, COUNT),
        )

    def at(self, stamp_ns: int) -> Float32Array:
        """Rows (n, 5) of the waves at a stamp, see ``kernels.light.Shading``."""
        phase = np.mod(self.phase - self.omega * (stamp_ns / 1e9), 2.0 * np.pi)
        return np.column_stack([self.k, self.slope, phase, np.ones(len(phase))]).astype(np.float32)
