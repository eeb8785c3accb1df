# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What the weather does to the echoes of a scan: all become weaker, and particles return some beams themselves."""

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.weather_config import WeatherConfig
from fieldtruth.kernels.lidar import EchoBuffers
from fieldtruth.kernels.lidar_noise import add_weather
from fieldtruth.sense.air import LIGHT_SPEED, Beam, make_air
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.noise import limit_of, receiver_of


def beam_of(config: LidarConfig) -> Beam:
    """Return the beam of a LiDAR with a signal."""
    signal = config.signal
    assert signal is not None
    return Beam(
        wavelength_nm=signal.wavelength_nm,
        width_m=signal.beam_diameter,
        divergence_rad=float(np.radians(signal.divergence_deg)),
        pulse_ns=2e9 * signal.pulse_length / LIGHT_SPEED,
        min_range=config.min_range,
        max_range=config.max_range,
        gain=receiver_of(signal).gain,
    )


class WeatherInAir:
    """Changes the echoes of a LiDAR's scans as the weather does; see ``measuring.InAir``. Threads may share it."""

    def __init__(self, config: LidarConfig, weather: WeatherConfig, lowest: float = 0.0) -> None:
        """``lowest`` is the height [m] of the lowest ground, where fog that thins with height is densest."""
        assert config.signal is not None
        self._lowest = lowest
        self._air = make_air(weather, beam_of(config))
        # Of the last echo, a particle's counts only where the surface behind it cannot be detected.
        self._least = limit_of(config.signal) if config.signal.returns == "last" else np.inf

    def __call__(self, echoes: EchoBuffers, key: np.uint64, poses: Array, directions: Array) -> None:
        """Change the echoes of the scan with this key, made by beams of these directions at these poses."""
        upwards = np.concatenate([poses[:, 2, :3], poses[:, 2, 3:] - self._lowest], axis=1)
        add_weather(self._air, self._least, key, upwards, directions, echoes)
