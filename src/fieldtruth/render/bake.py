# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Preparing a scene for photographs: ``bake`` computes its light once; cameras then share the result."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from fieldtruth.core.cache_folder import cache_folder
from fieldtruth.core.parallel import cpu_count
from fieldtruth.experiment.config import LightConfig
from fieldtruth.experiment.weather_config import WeatherConfig
from fieldtruth.render.air import air_of, light_in
from fieldtruth.render.light import bake_light
from fieldtruth.render.light_cache import cached_light
from fieldtruth.render.materials import material_table
from fieldtruth.render.sky import SKY_OVER_SUN
from fieldtruth.render.surfaces import surface_table
from fieldtruth.render.tables import LightTable, Shading
from fieldtruth.sense.scene import Scene

OPEN_SHARE: Final = 0.72
"""Mean light on the ground of a park over that of a meadow; there the exposure is 1."""
ADAPTATION: Final = 0.8
"""Exponent with which the exposure follows the mean light; 1 would make all worlds equally bright."""


@dataclass(frozen=True, kw_only=True)
class BakedScene:
    """A scene with its light: what a ``Camera`` renders. Threads may share it."""

    scene: Scene
    shading: Shading


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
        light: direction of the sun; None takes the defaults.
        weather: what is in the air; None is clear air.
        workers: threads; None takes every available core. The result does not depend on it.
        folder: cache folder; None takes the user's.
    """
    light = LightConfig() if light is None else light
    workers = cpu_count() if workers is None else workers
    table = cached_light(scene, light, folder or cache_folder(), lambda: bake_light(scene, light, workers))
    materials, air = material_table(scene.world), air_of(weather)
    shading = Shading(
        scene=scene.rays.handle,
        hits=scene.hits,
        surfaces=surface_table(scene, table.vertex_sky),
        materials=materials,
        light=light_in(air, table) if air.any() else table,
        has_water=bool((materials.mirror > 0).any()),
        exposure=_exposure(table),
        air=air,
        has_weather=bool((air > 0).any()),
    )
    return BakedScene(scene=scene, shading=shading)


def _exposure(light: LightTable) -> np.float32:
    """Exposure of this world relative to an open meadow: longer below a closed canopy.

    It follows the mean light on the ground only in part, so that a forest stays darker than a meadow. All images share
    it, so that stereo pairs agree and no image depends on those before it.
    """
    level = float(light.ground_sun.values.mean()) * light.sun[2] + SKY_OVER_SUN * float(light.ground_sky.values.mean())
    open_level = light.sun[2] + SKY_OVER_SUN
    return np.float32(np.clip((OPEN_SHARE * open_level / level) ** ADAPTATION, 0.8, 6.0))
