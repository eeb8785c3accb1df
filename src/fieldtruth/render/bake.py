# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Preparing a scene for photographs: ``bake`` computes its light once; cameras then share the result.

Light, and the tables of materials that the sun lights, are kept on disk, under a key that covers the scene, the
sun, the processor, and the code that bakes.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.cache import cache_folder, cache_key
from fieldtruth.core.cache_folder import load_or_make
from fieldtruth.core.parallel import cpu_count
from fieldtruth.experiment.light_config import LightConfig, WeatherConfig
from fieldtruth.kernels.light import LightTable, MaterialTable, Shading, SnowTable
from fieldtruth.kernels.shading import WHITE
from fieldtruth.render import daylight
from fieldtruth.render.air import air_of, light_in
from fieldtruth.render.daylight import LUMINANCE, sun_direction
from fieldtruth.render.light import bake_light, with_bodies
from fieldtruth.render.materials import material_table
from fieldtruth.render.surfaces import shading_of
from fieldtruth.sense.embree import processor
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
_LIBRARIES: Final = ("embreex", "llvmlite", "numba", "numpy", "scipy")


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
    light, folder = light or LightConfig(), folder or cache_folder()
    workers = cpu_count() if workers is None else workers
    still = scene.still  # light does not depend on what moves
    lit = cached_light(still, light, folder, lambda: _lit(still, light, workers, weather), weather)
    return _baked(scene, lit, weather)


def lit_scene(
    scene: Scene, light: LightConfig, weather: WeatherConfig | None, workers: int, *, texels: int | None = None
) -> BakedScene:
    """Compute the light of a scene as ``bake`` does, without the cache; see ``bake_light`` for ``texels``."""
    return _baked(scene, _lit(scene.still, light, workers, weather, texels), weather)


class Lit(NamedTuple):
    """Light of a scene, and its materials in this light: what the cache keeps."""

    light: LightTable
    materials: MaterialTable


def _lit(
    scene: Scene, light: LightConfig, workers: int, weather: WeatherConfig | None, texels: int | None = None
) -> Lit:
    values = light.values
    sun = sun_direction(values.azimuth_deg, values.elevation_deg)
    materials = material_table(scene.world, sun, values.wetness)
    return Lit(bake_light(scene, light, workers, weather, materials, texels=texels), materials)


def _baked(scene: Scene, lit: Lit, weather: WeatherConfig | None) -> BakedScene:
    """Put light into the weather, and choose the exposure."""
    table, materials = lit
    heights = scene.world.terrain.surface.heights
    air = air_of(weather, table, heights)
    table = with_bodies(light_in(air, table, float(heights.mean())), scene)
    shading = shading_of(scene, table, materials, air)
    water, exposed = bool((materials.mirror > 0).any()), exposure(table, materials, shading.snow)
    shading = shading._replace(has_water=water, exposure=exposed)
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


def cached_light(
    scene: Scene, light: LightConfig, folder: Path, make: Callable[[], Lit], weather: WeatherConfig | None = None
) -> Lit:
    """Read the light of a scene from a cache folder, or make it and keep it there if the folder can be written."""
    path = folder / f"light-{scene.world.name}-{light_key(scene, light, weather)}.npz"
    return load_or_make(path, _read, make, _write)


def light_key(scene: Scene, light: LightConfig, weather: WeatherConfig | None = None) -> str:
    """Digest of all that baked light depends on: code, sun, weather, triangles, poses and colours."""
    world, field = scene.world, scene.world.terrain.surface
    ground = (field.heights, field.x0, field.y0, field.spacing)
    meshes = [
        (m.name, m is world.backdrop, m.vertices, m.normals, m.uv, m.faces, m.material, m.materials)
        for m in scene.meshes
    ]
    names = [mesh.name if mesh is not None else "" for mesh, *_ in scene.top_levels]
    poses, tints = (np.array([getattr(top, n) for top in scene.top_levels]) for n in ("world_from_object", "tint"))
    colours = (world.materials, world.textures, tints, world.terrain)
    inputs = (
        processor(),  # where it differs, the last digit of a photograph does
        light.values,
        (weather or WeatherConfig()).model_dump(),
        world.seed,
        world.size,
        ground,
        meshes,
        names,
        poses,
        colours,
        daylight.DOME_TEXELS,
        Lit._fields,
    )
    return cache_key(["fieldtruth.render.light"], *inputs, libraries=_LIBRARIES)


def _write(path: Path, lit: Lit) -> None:
    dome = lit.light.dome
    small = lit.light._replace(dome=dome._replace(rgb=dome.rgb.astype(np.float16)))  # daylight.py rounds it so
    with path.open("wb") as stream:
        np.savez(stream, allow_pickle=False, **dict(_arrays(lit._replace(light=small), "lit")))


def _read(path: Path) -> Lit:
    with np.load(path, allow_pickle=False) as stored:
        lit: Lit = _table(Lit, dict(stored), "lit")
    dome = lit.light.dome
    return lit._replace(light=lit.light._replace(dome=dome._replace(rgb=dome.rgb.astype(np.float32))))


def _arrays(value: Any, name: str) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the arrays and numbers of a table, and of the tables in it, by names such as ``lit.light.dome.rgb``."""
    if hasattr(value, "_asdict"):
        for key, each in value._asdict().items():
            yield from _arrays(each, f"{name}.{key}")
    else:
        yield name, np.asarray(value)


def _table(kind: Any, arrays: Mapping[str, NDArray[Any]], name: str) -> Any:
    """Make a table of the arrays by the types of its fields."""
    if hasattr(kind, "_fields"):
        return kind(**{key: _table(each, arrays, f"{name}.{key}") for key, each in get_type_hints(kind).items()})
    if get_origin(kind) is tuple:
        return tuple(arrays[name].tolist())
    return kind(arrays[name]) if kind in (float, int, bool) else arrays[name]
