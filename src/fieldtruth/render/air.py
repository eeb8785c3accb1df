# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Air in photographs: light towards the camera is scattered out of the ray, and light of the air into it.

Along a path of optical depth tau the radiance L becomes L exp(-tau) + A (1 - exp(-tau)) (Koschmieder 1924). In clear
air A is the radiance of the sky at the horizon in the same azimuth: bright and yellow towards the sun, as aerosol
scatters forwards, and bluish away from it. Weather takes the light of the sun and returns it from all sides, so that A
is the same in every azimuth and has the colour of all light from above, as drops scatter all colours alike.
"""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Float32Array
from fieldtruth.experiment.light_config import WeatherConfig
from fieldtruth.kernels.light import AZIMUTHS, LAYER, AirTable, LightTable, fog_length, sky_radiance
from fieldtruth.sense.air import clear_extinction, extinction, fog_extinction

WAVELENGTHS_NM: Final = (610.0, 550.0, 465.0)
"""Of red, green and blue: where the matching functions of sRGB's primaries are greatest, about."""
_ELEVATIONS: Final = np.radians([0.5, 1.0, 1.5, 2.0])
_SPREAD_DEG: Final = 12.0
"""Over which A is the mean of the horizon on both sides, so that no cloud stands in the air."""


def air_of(weather: WeatherConfig | None, light: LightTable, heights: Float32Array) -> AirTable:
    """Return the air of some weather, None for clear, above ground of some heights [m]; ``light`` is of clear air."""
    weather = WeatherConfig() if weather is None else weather
    clear = _channels([clear_extinction(weather.visibility_m, each) for each in WAVELENGTHS_NM])
    every = _channels([extinction(weather, each) for each in WAVELENGTHS_NM])
    fog = np.zeros(3, np.float32)
    if weather.fog_visibility_m is not None:  # a visibility is that of all the air
        fog = _channels([fog_extinction(weather.fog_visibility_m, each) for each in WAVELENGTHS_NM])
        every, fog = every - np.minimum(fog, clear), (fog - clear).clip(0.0)
    thins = weather.fog_height_m is not None
    air = AirTable(
        clear=clear,
        even=every - fog if thins else every,
        fog=fog if thins else np.zeros_like(fog),
        fog_scale=np.float32(weather.fog_height_m or 0.0),
        ground=np.float32(heights.min()),
        light=np.zeros((AZIMUTHS + 1, 3), np.float32),
        has_weather=bool(every.max() > 0.0),
    )
    return air._replace(light=_air_light(air, light, float(heights.mean())))


def light_in(air: AirTable, light: LightTable, height: float) -> LightTable:
    """Return the light in weather on ground of a ``height`` [m]: less of the sun, as much more of the sky."""
    if not air.has_weather:
        return light
    high = float(light.sun[2])
    left = _sun_left(air, high, height)
    mean = light.dome.mean + (1 - left) * light.sun_rgb * np.float32(max(high, 0.0) / np.pi)
    horizon = light.dome.horizon.mean() * mean / mean.mean()
    return light._replace(sun_rgb=light.sun_rgb * left, dome=light.dome._replace(mean=mean, horizon=horizon))


def _channels(values: list[float]) -> Float32Array:
    return np.array(values, np.float32)


def _sun_left(air: AirTable, high: float, height: float) -> Float32Array:
    """Share of the sun (3,), the sine of whose elevation is ``high``, on ground of a height."""
    length = LAYER / max(high, 0.05)
    fog = fog_length(height - float(air.ground), LAYER, length, float(air.fog_scale))
    return np.asarray(np.exp(-air.even * np.float32(length) - air.fog * np.float32(fog)), np.float32)


def _air_light(air: AirTable, light: LightTable, height: float) -> Float32Array:
    """Radiance A by azimuth: the horizon's as far as the sun is seen, else its mean with the colour of all light."""
    scale = np.arange(AZIMUTHS + 1) * 4.0 / AZIMUTHS
    quarter, along = scale // 1 % 4, scale % 1
    corner = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]])
    start, end = corner[quarter.astype(int)], corner[quarter.astype(int) + 1]
    x, y = (start + along[:, None] * (end - start)).T
    azimuth = np.arctan2(y, x)[:, None, None] + np.radians(np.linspace(-_SPREAD_DEG, _SPREAD_DEG, 9))[:, None]
    towards = np.cos(azimuth) * np.cos(_ELEVATIONS), np.sin(azimuth) * np.cos(_ELEVATIONS)
    z = np.broadcast_to(np.sin(_ELEVATIONS), towards[0].shape)
    found = [sky_radiance(light.dome.rgb, *each) for each in zip(towards[0].flat, towards[1].flat, z.flat, strict=True)]
    horizon: Float32Array = np.array(found, np.float32).reshape(*z.shape, 3).mean(axis=(1, 2))
    if not air.has_weather:
        return horizon
    seen = float(_sun_left(air, float(light.sun[2]), height).mean())
    return np.asarray(seen * horizon + (1 - seen) * light_in(air, light, height).dome.horizon, np.float32)
