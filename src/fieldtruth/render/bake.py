# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Everything that a photograph needs to know of a scene beside its triangles: colours, baked light, film."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.cache import cache_folder
from fieldtruth.core.parallel import cpu_count
from fieldtruth.experiment.config import LightConfig
from fieldtruth.render.atlas import srgb_from_linear
from fieldtruth.render.light import LightTable, bake_light
from fieldtruth.render.light_cache import cached_light
from fieldtruth.render.shade import PaintTable, paint_table
from fieldtruth.render.sky import SKY_OVER_SUN
from fieldtruth.render.surfaces import SurfaceTable, surface_table
from fieldtruth.sense.hits import HitTable
from fieldtruth.sense.scene import Scene

CURVE_TOP: Final = 16.0
CURVE_STEPS: Final = 4096
OPEN_SHARE: Final = 0.72
"""Light on the ground of a park, of that on a meadow: there the exposure is 1."""
ADAPTATION: Final = 0.8


class Shading(NamedTuple):
    """Everything that a photograph needs to know of a scene; only read."""

    scene: np.uint64
    hits: HitTable
    surfaces: SurfaceTable
    paint: PaintTable
    light: LightTable
    curve: NDArray[np.uint8]
    has_water: bool
    gain: np.float32  # exposure of this world over that of an open one


def film_curve() -> NDArray[np.uint8]:
    """SRGB byte by the square root of linear light in [0, CURVE_TOP]: a filmic curve (Narkowicz 2015, ACES fit)."""
    light = np.linspace(0.0, np.sqrt(CURVE_TOP), CURVE_STEPS) ** 2
    film = light * (2.51 * light + 0.03) / (light * (2.43 * light + 0.59) + 0.14)
    return np.rint(255.0 * srgb_from_linear(film)).astype(np.uint8)


@dataclass(frozen=True, kw_only=True)
class BakedScene:
    """A scene with its light: what a ``Camera`` renders. Threads may share it."""

    scene: Scene
    shading: Shading


def bake(
    scene: Scene, light: LightConfig | None = None, *, workers: int | None = None, folder: Path | None = None
) -> BakedScene:
    """Compute the light of a scene, or read it from the cache.

    Args:
        scene: the world in the ray tracer.
        light: direction of the sun; None takes the defaults.
        workers: threads; None takes every available core. The result does not depend on it.
        folder: cache folder; None takes the user's.
    """
    light = LightConfig() if light is None else light
    workers = cpu_count() if workers is None else workers
    table = cached_light(scene, light, folder or cache_folder(), lambda: bake_light(scene, light, workers))
    surfaces, paint = surface_table(scene, table.vertex_sky), paint_table(scene.world)
    has_water = bool((paint.mirror > 0).any())
    shading = Shading(scene.rays.handle, scene.hits, surfaces, paint, table, film_curve(), has_water, _gain(table))
    return BakedScene(scene=scene, shading=shading)


def _gain(light: LightTable) -> np.float32:
    """Exposure that a photographer would choose for this world, relative to an open meadow: more below a closed canopy.

    It follows the mean light on the ground, not all the way (a forest's picture stays darker than a meadow's), and it
    is one for all images, so that stereo pairs agree and an image does not depend on those before it.
    """
    level = float(light.ground_sun.values.mean()) * light.sun[2] + SKY_OVER_SUN * float(light.ground_sky.values.mean())
    open_level = light.sun[2] + SKY_OVER_SUN
    return np.float32(np.clip((OPEN_SHARE * open_level / level) ** ADAPTATION, 0.8, 6.0))
