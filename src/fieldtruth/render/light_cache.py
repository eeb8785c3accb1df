# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Baked light on disk, under a key that covers the scene, the sun, and the code that bakes."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from fieldtruth.core.cache import cache_key
from fieldtruth.core.cache_folder import load_or_make
from fieldtruth.experiment.config import LightConfig
from fieldtruth.render.sky import Dome
from fieldtruth.render.tables import LightTable
from fieldtruth.sense.hits import Grid
from fieldtruth.sense.scene import Scene

_LIBRARIES: Final = ("embreex", "llvmlite", "numba", "numpy", "scipy")


def cached_light(scene: Scene, light: LightConfig, folder: Path, make: Callable[[], LightTable]) -> LightTable:
    """Read the light of a scene from a cache folder, or make it and keep it there if the folder can be written."""
    path = folder / f"light-{scene.world.name}-{light_key(scene, light)}.npz"
    return load_or_make(path, _read, make, _write)


def light_key(scene: Scene, light: LightConfig) -> str:
    """Digest of all that baked light depends on: code, sun, triangles, poses, and what lets light through."""
    world, field = scene.world, scene.world.terrain.surface
    ground = (field.heights, field.x0, field.y0, field.spacing)
    clear = {name: (material.translucency > 0, material.mirror > 0) for name, material in world.materials.items()}
    meshes = [
        (m.name, m is world.backdrop, m.vertices, m.normals, m.faces, m.material, [clear[n] for n in m.materials])
        for m in scene.meshes
    ]
    names = [mesh.name if mesh is not None else "" for mesh, *_ in scene.tops]
    poses = np.stack([top.world_from_object for top in scene.tops])
    inputs = (light.model_dump(), world.seed, world.size, ground, meshes, names, poses)
    return cache_key(["fieldtruth.render.light"], *inputs, libraries=_LIBRARIES)


def _write(path: Path, table: LightTable) -> None:
    arrays: dict[str, Any] = {name: value for name, value in table._asdict().items() if isinstance(value, np.ndarray)}
    for name in ("ground_sun", "ground_sky"):
        grid: Grid = getattr(table, name)
        arrays |= {name: grid.values, f"{name}_at": np.array([grid.x0, grid.y0, grid.per_metre])}
    arrays |= {f"dome_{name}": value for name, value in table.dome._asdict().items()}
    with path.open("wb") as stream:
        np.savez(stream, allow_pickle=False, **arrays)


def _read(path: Path) -> LightTable:
    with np.load(path, allow_pickle=False) as stored:
        arrays: dict[str, Any] = dict(stored)
    grids: dict[str, Any] = {
        n: Grid(arrays.pop(n), *map(float, arrays.pop(f"{n}_at"))) for n in ("ground_sun", "ground_sky")
    }
    dome = Dome(**{n: arrays.pop(f"dome_{n}") for n in Dome._fields})
    return LightTable(dome=dome, **grids, **arrays)
