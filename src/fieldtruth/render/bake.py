# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Preparing a scene for photographs: ``bake`` computes its light once; cameras then share the result."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.cache import cache_folder
from fieldtruth.core.parallel import cpu_count
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.experiment.weather_config import WeatherConfig
from fieldtruth.kernels.light import LightTable, MaterialTable, Shading, SnowTable
from fieldtruth.kernels.shading import WHITE
from fieldtruth.render.air import air_of, light_in
from fieldtruth.render.light import bake_light
from fieldtruth.render.light_cache import cached_light
from fieldtruth.render.materials import material_table
from fieldtruth.render.sky.daylight import sun_direction
from fieldtruth.render.sky.spectrum import LUMINANCE
from fieldtruth.render.surfaces import snow_table, surface_table
from fieldtruth.render.wire_table import wire_table
from fieldtruth.sense.scene import Scene

PARK_LEVEL: Final = 0.085
"""Radiance of the ground, as ``exposure`` meters it, in a park under a clear sky; there the exposure is 1."""
SHORTEST: Final = 0.5
LONGEST: Final = 30.0
"""Limits of the exposure: fresh snow in the sun stays bright, the floor of a dense forest dim."""
_MEAN, _UPWARD, _LEVEL = np.array([0, 4, 8]), np.array([3, 7, 11]), np.array([12, 13, 14])
"""Coefficients of a probe by channel, whose sum is what a level surface receives."""
_NODES: Final = 1_000_000
"""Nodes of the ground at most that the exposure looks at."""


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
        exposure=exposure(table, materials, snow),
        air=air,
        snow=snow,
        has_snow=bool(snow.on_top > 0),
    )
    return BakedScene(scene=scene, shading=shading, weather=weather or WeatherConfig())


def exposure(light: LightTable, materials: MaterialTable, snow: SnowTable) -> np.float32:
    """Exposure of this world relative to a park: longer below a closed canopy, shorter on pale ground and snow.

    A camera on the ground sees more of it than of the sky, so that the level of light is the ground's mean radiance,
    over that of white ground in the open: its reflectance times what falls on it from the air and from the sun. Means
    are geometric (Reinhard et al. 2002), so that spots of sun do not darken the shade around them. All images share
    the exposure, so that stereo pairs agree and no image depends on those before it.
    """
    from_sun = float(np.asarray(light.sun_rgb) @ LUMINANCE) * max(float(light.sun[2]), 0.0) / np.pi
    white = max(from_sun + float(np.asarray(light.dome.mean) @ LUMINANCE), 1e-9)
    probes = light.volume[:, :, 0]
    from_air = _geometric_mean((probes[..., _MEAN] + probes[..., _UPWARD] + probes[..., _LEVEL]) @ LUMINANCE)
    sunlit = np.asarray(light.ground_sun.values).ravel()
    received = _geometric_mean(from_air + from_sun * sunlit[:: 1 + len(sunlit) // _NODES])
    covered = float(np.mean(snow.ground.values)) if snow.on_top > 0 else 0.0
    reflected = (1 - covered) * _geometric_mean(materials.ground[..., :3] @ LUMINANCE) + covered * WHITE[1]
    return np.float32(np.clip(PARK_LEVEL * white / (reflected * received), SHORTEST, LONGEST))


def _geometric_mean(values: NDArray[Any]) -> float:
    return float(np.exp(np.log(np.maximum(values, 1e-6)).mean()))
