# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Weather in photographs: light towards the camera is scattered out of the ray, and light of the air into it.

Along a distance d the radiance L becomes L exp(-alpha d) + A (1 - exp(-alpha d)) (Koschmieder 1924), in addition to
the haze of clear air, in which a black object is visible for 5.4 km. A is as bright as the horizon and has the colour
of all light from above, as drops scatter all colours alike. What the sun loses above the ground comes from all sides.
"""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Float32Array
from fieldtruth.experiment.weather_config import WeatherConfig
from fieldtruth.render.tables import EXPOSURE, HAZE_PER_METRE, LightTable, Shading
from fieldtruth.sense.air import extinction
from fieldtruth.sense.kernel import light_kernel
from fieldtruth.sense.ray_batch import RayBatch

WAVELENGTHS_NM: Final = (610.0, 550.0, 465.0)
"""Of red, green and blue: where the matching functions of sRGB's primaries are greatest, about."""
LAYER: Final = 1000.0
"""[m] up to which the weather reaches: a ray to the sky at elevation e is in it for LAYER / sin(e)."""


def air_of(weather: WeatherConfig | None) -> Float32Array:
    """Extinction coefficients (3,) [1/m] of the weather for red, green and blue, beyond that of clear air."""
    if weather is None or weather.is_clear:
        return np.zeros(3, np.float32)
    fog = 0.0 if weather.fog_visibility_m is None else HAZE_PER_METRE  # a visibility is that of all the air
    return np.array([extinction(weather, each) - fog for each in WAVELENGTHS_NM], np.float32).clip(0.0)


def light_in(air: Float32Array, light: LightTable) -> LightTable:
    """Return the light in weather: less sun, as much more of the sky, and the light of the air as horizon."""
    high = float(light.sun[2])
    left = np.exp(-air * np.float32(LAYER / high))
    mean = light.dome.mean + (1 - left) * light.sun_rgb * np.float32(high / np.pi)
    horizon = light.dome.horizon.mean() * mean / mean.mean()
    dome = light.dome._replace(mean=mean, horizon=horizon)
    return light._replace(sun_rgb=light.sun_rgb * left, dome=dome)


@light_kernel
def dim(shading: Shading, batch: RayBatch, count: int, colour: Float32Array) -> None:
    """Change the exposed colours (n, 3) of traced rays as the air does; those for which the lens has no ray stay."""
    top, direction, distance = batch.top, batch.direction, batch.distance
    horizon, air = shading.light.dome.horizon, shading.air
    scale = np.float32(EXPOSURE) * np.sqrt(shading.exposure)  # as of haze: less is scattered where less falls
    for k in range(count):
        length = distance[k]
        if top[k] < 0:
            dx, dy, dz = direction[0, k], direction[1, k], direction[2, k]
            if dx * dx + dy * dy + dz * dz < np.float32(0.5):
                continue
            length = np.float32(LAYER) / max(dz, np.float32(1e-4))
        for channel in range(3):
            left = np.exp(-air[channel] * length)
            colour[k, channel] = left * colour[k, channel] + (np.float32(1.0) - left) * scale * horizon[channel]
