# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Preparing a scene for photographs: ``bake`` computes its light once; cameras then share the result."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from fieldtruth.core.cache_folder import cache_folder
from fieldtruth.core.parallel import cpu_count
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.experiment.weather_config import WeatherConfig
from fieldtruth.render.air import air_of, light_in
from fieldtruth.render.light import bake_light
from fieldtruth.render.light_cache import cached_light
from fieldtruth.render.materials import material_table
from fieldtruth.render.sky.daylight import sun_direction
from fieldtruth.render.sky.spectrum import LUMINANCE
from fieldtruth.render.snow import snow_table
from fieldtruth.render.surfaces import surface_table
from fieldtruth.render.tables import LightTable, Shading
from fieldtruth.render.wire_table import wire_table
from fieldtruth.sense.scene import Scene

PARK_LEVEL: Final = 0.122
"""Level of light, as ``_exposure`` meters it, in a park under a clear sky; there the exposure is 1."""
ADAPTATION: Final = 0.95
"""Exponent with which the exposure follows the level of light; 1 would make all worlds equally bright."""
LONGEST: Final = 30.0
_MEAN, _UPWARD = np.array([0, 4, 8]), np.array([3, 7, 11])
"""Coefficients of a probe: mean radiance, and its change towards the zenith, by channel."""


@dataclass(frozen=True, kw_only=True)
class BakedScene:
    """A scene with its light: what a ``Camera`` renders. Threads may share it."""

    scene: Scene
    shading: Shading
    weather: WeatherConfig = field(default_factory=WeatherConfig)


def bake(
    scene: Scene,
    light: LightConfig | None = None,
    weather: WeatherConfig | None = None,
    *,
    workers: int | None = None,
    folder: Path | None = None,
) -> BakedScene:
    """Compute the light of a scene, or read it from the cache.

    Args:
        scene: the world in the ray tracer.
        light: sun, clouds and haze; None takes the defaults.
        weather: what is in the air; None is clear air.
        workers: threads; None takes every available core. The result does not depend on it.
        folder: cache folder; None takes the user's.
    """
    light = LightConfig() if light is None else light
    workers = cpu_count() if workers is None else workers
    values, heights, folder = light.values, scene.world.terrain.surface.heights, folder or cache_folder()
    sun = sun_direction(values.azimuth_deg, values.elevation_deg)
    materials, snow = material_table(scene.world, sun, values.wetness), snow_table(scene.world.terrain)
    table = cached_light(scene, light, folder, lambda: bake_light(scene, light, workers, weather, materials), weather)
    air = air_of(weather, table, heights)
    table = light_in(air, table, float(heights.mean()))
    shading = Shading(
        scene=scene.rays.handle,
        hits=scene.hits,
        surfaces=surface_table(scene, table.vertex_near),
        materials=materials,
        light=table,
        wires=wire_table(scene, materials),
        has_water=bool((materials.mirror > 0).any()),
        exposure=_exposure(table),
        air=air,
        snow=snow,
        has_snow=bool(snow.on_top > 0),
    )
    return BakedScene(scene=scene, shading=shading, weather=weather or WeatherConfig())


def _exposure(light: LightTable) -> np.float32:
    """Exposure of this world relative to a park: longer below a closed canopy.

    The level of light, over the radiance of white open ground, is the geometric mean, over the lowest probes (Reinhard
    et al. 2002 take that of pixels), of the mean radiance from all sides and of that from below, as cameras on the
    ground see more of it than of the sky. All images share the exposure, so that stereo pairs agree and no image
    depends on those before it.
    """
    white = np.asarray(light.sun_rgb) * (max(float(light.sun[2]), 0.0) / np.pi) + light.dome.mean
    lowest, open_level = light.volume[:, :, 0], max(float(white @ LUMINANCE), 1e-9)
    sides = lowest[..., _MEAN] @ LUMINANCE / open_level
    below = sides - lowest[..., _UPWARD] @ LUMINANCE / open_level
    level = float(np.exp(np.log(sides.clip(3e-4) * below.clip(3e-4)).mean() / 2.0))
    return np.float32(np.clip((PARK_LEVEL / level) ** ADAPTATION, 0.8, LONGEST))
