# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Baked light on disk, under a key that covers the scene, the sun, the processor, and the code that bakes."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from fieldtruth.core.cache import cache_key
from fieldtruth.core.cache_folder import load_or_make
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.experiment.weather_config import WeatherConfig
from fieldtruth.kernels.light import Dome, LightTable, SunMap
from fieldtruth.kernels.packets import Grid
from fieldtruth.render.sky import dome
from fieldtruth.sense.processor import processor
from fieldtruth.sense.scene import Scene

_GRIDS: Final = ("ground_sun", "ground_near", "cloud_sun")
_LIBRARIES: Final = ("embreex", "llvmlite", "numba", "numpy", "scipy")


def cached_light(
    scene: Scene, light: LightConfig, folder: Path, make: Callable[[], LightTable], weather: WeatherConfig | None = None
) -> LightTable:
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
    names = [mesh.name if mesh is not None else "" for mesh, *_ in scene.tops]
    poses, tints = (np.array([getattr(top, n) for top in scene.tops]) for n in ("world_from_object", "tint"))
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
        dome.SIZE,
    )
    return cache_key(["fieldtruth.render.light"], *inputs, libraries=_LIBRARIES)


def _write(path: Path, table: LightTable) -> None:
    arrays: dict[str, Any] = {name: value for name, value in table._asdict().items() if isinstance(value, np.ndarray)}
    for name in _GRIDS:
        grid: Grid = getattr(table, name)
        arrays |= {name: grid.values, f"{name}_at": np.array([grid.x0, grid.y0, grid.per_metre])}
    arrays["volume_at"] = np.array([*table.volume_corner, table.volume_per_metre])
    arrays["has_cloud_shadow"] = np.array(table.has_cloud_shadow)
    arrays |= {f"dome_{name}": value for name, value in table.dome._asdict().items()}
    arrays |= {f"sun_map_{name}": np.asarray(value) for name, value in table.sun_map._asdict().items()}
    arrays["dome_rgb"] = table.dome.rgb.astype(np.float16)  # daylight.py rounds it so
    with path.open("wb") as stream:
        np.savez(stream, allow_pickle=False, **arrays)


def _read(path: Path) -> LightTable:
    with np.load(path, allow_pickle=False) as stored:
        arrays: dict[str, Any] = dict(stored)
    grids: dict[str, Any] = {n: Grid(arrays.pop(n), *map(float, arrays.pop(f"{n}_at"))) for n in _GRIDS}
    arrays["dome_rgb"] = arrays["dome_rgb"].astype(np.float32)
    sky = Dome(**{n: arrays.pop(f"dome_{n}") for n in Dome._fields})
    found = {n: arrays.pop(f"sun_map_{n}") for n in SunMap._fields}
    corner = float(found["corner"][0]), float(found["corner"][1])
    sun_map = SunMap(found["depth"], found["axes"], corner, float(found["per_metre"]))
    x, y, per_metre = map(float, arrays.pop("volume_at"))
    shaded = bool(arrays.pop("has_cloud_shadow"))
    return LightTable(
        dome=sky,
        sun_map=sun_map,
        has_cloud_shadow=shaded,
        volume_corner=(x, y),
        volume_per_metre=per_metre,
        **grids,
        **arrays,
    )
