# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What the weather does to the echoes of a scan: all become weaker, and particles return some beams themselves."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.experiment.weather_config import WeatherConfig
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.sense.air import LIGHT_SPEED, Air, Beam, make_air, strongest_echo, transmitted
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.draws import uniforms
from fieldtruth.sensors.lidar.noise import limit_of, receiver_of
from fieldtruth.sensors.lidar.surfaces import EchoBuffers

DRAW: Final = 15
"""Of a ray, the last: the others are of its noise."""
_PARTICLE: Final = int(Label.PARTICLE)


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


@kernel
def add_weather(air: Air, least: float, key: np.uint64, upwards: Array, directions: Array, echoes: EchoBuffers) -> None:
    """Attenuate the echoes of surfaces; the strongest particle of a beam replaces its weakest echo if that is weaker.

    It does not if an echo has a power of at least ``least``. ``upwards`` (columns, 4) is the third row of each pose,
    with the height above the densest fog.
    """
    depths, apparents = echoes.depth, echoes.apparent
    count, columns, rings = depths.shape
    for column in range(columns):
        for ring in range(rings):
            weakest, lowest, strongest, beam = 0, np.inf, 0.0, (0.0, 0.0)
            if air.fog_scale > 0.0:
                ray, up = directions[column, ring], upwards[column]
                beam = max(up[3], 0.0), up[0] * ray[0] + up[1] * ray[1] + up[2] * ray[2]
            for echo in range(count):
                distance, power = np.float64(depths[echo, column, ring]), 0.0
                if distance > 0.0:
                    power = apparents[echo, column, ring] * transmitted(air, distance, beam[0], beam[1])
                    apparents[echo, column, ring], power = power, power / (distance * distance)
                if power < lowest:
                    weakest, lowest = echo, power
                strongest = max(strongest, power)
            clear = np.float64(echoes.clear[column, ring])
            u1, u2 = uniforms(key, column * rings + ring, DRAW)
            power, at, particle = strongest_echo(air, lowest, clear, beam, u1, u2)
            if particle and strongest < least:
                depths[weakest, column, ring], apparents[weakest, column, ring] = at, power * at * at
                echoes.label[weakest, column, ring], echoes.instance[weakest, column, ring] = _PARTICLE, 0
                echoes.mixed[weakest, column, ring] = False
                if count == 2 and 0.0 < depths[1, column, ring] < depths[0, column, ring]:
                    _swap(echoes.label, column, ring)
                    _swap(echoes.instance, column, ring)
                    _swap(echoes.mixed, column, ring)
                    _swap(apparents, column, ring)
                    _swap(depths, column, ring)


@inlined
def _swap(values: NDArray[Any], column: int, ring: int) -> None:
    """Exchange the two echoes of a beam: the nearest is the first."""
    first = values[0, column, ring]
    values[0, column, ring] = values[1, column, ring]
    values[1, column, ring] = first
