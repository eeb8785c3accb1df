# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds, scenes, light and second tracers that tests of one process share."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final, TypeVar, cast

import pytest

from fieldtruth.core.cache import cache_folder
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.light_config import LightConfig, WeatherConfig
from fieldtruth.kernels.columns import Faces
from fieldtruth.render import daylight
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.sense.interval import STILL, Moving
from fieldtruth.sense.scene import Scene
from fieldtruth.validation.tracer import ReferenceTracer
from fieldtruth.world.build import load_world
from fieldtruth.world.grids import BUILT_IN
from fieldtruth.world.model import World
from fieldtruth.world_maps.bodies import faces_of

SKY_TEXELS: Final = 512
"""Texels of the sky: one of the full size takes seconds."""
_T = TypeVar("_T")


class Kept:
    """Worlds with what is made of them, each made once in a process. To load and to light a park takes seconds."""

    def __init__(self) -> None:
        self._made = dict[Any, Any]()

    def load_world(self, environment: str, seed: int = 0, layout: Mapping[str, Any] | None = None) -> World:
        return self._once((environment, seed, repr(layout or {})), load_world, environment, seed, layout)

    def world_of(self, e: Experiment) -> World:
        return self.load_world(e.environment, e.seed, e.layout)

    def scene(self, world: World, moving: Moving = STILL) -> Scene:
        return Scene(world, moving) if moving else self._once(("scene", id(world)), Scene, world)

    def tracer(self, world: World, moving: Moving = STILL) -> ReferenceTracer:
        return ReferenceTracer(world, moving) if moving else self._once(("tracer", id(world)), ReferenceTracer, world)

    def faces_of(self, world: World) -> Faces:
        return self._once(("faces", id(world)), faces_of, world)

    def bake(
        self,
        scene: Scene,
        light: LightConfig | None = None,
        weather: WeatherConfig | None = None,
        *,
        workers: int | None = None,
    ) -> BakedScene:
        """The light of a scene, for any workers; that of a built-in world is coarse, in a cache of its own."""
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(daylight, "DOME_TEXELS", SKY_TEXELS)
            key, made = (id(scene), light or LightConfig(), weather or WeatherConfig()), bake
            if scene.world.size == BUILT_IN:
                patch.setattr("fieldtruth.render.light.AIR_TEXEL", 3.0)
                patch.setattr("fieldtruth.render.light.sphere", lambda count, turn: daylight.sphere(count // 4, turn))
                made = partial(bake, folder=cache_folder() / "coarse")
            return self._once(key, made, scene, light, weather)

    def _once(self, key: Any, make: Callable[..., _T], *given: Any) -> _T:
        if key not in self._made:
            self._made[key] = make(*given), given  # which are kept, so that nothing else gets their ids
        return cast(_T, self._made[key][0])


KEPT: Final = Kept()
"""Those of this process."""
