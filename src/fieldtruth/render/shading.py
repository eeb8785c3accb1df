# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Everything that a photograph needs to know of a scene beside its triangles: colours, baked light, film."""

import hashlib
import os
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final, NamedTuple
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.parallel import cpu_count
from fieldtruth.experiment.config import LightConfig
from fieldtruth.render import light as light_module
from fieldtruth.render import sky as sky_module
from fieldtruth.render.atlas import srgb_from_linear
from fieldtruth.render.light import LightTable, bake_light
from fieldtruth.render.shade import PaintTable, paint_table
from fieldtruth.render.sky import SKY_OVER_SUN, Dome
from fieldtruth.render.surfaces import SurfaceTable, surface_table
from fieldtruth.sense.hits import Grid, HitTable
from fieldtruth.sense.scene import Scene
from fieldtruth.world.build import default_cache

CURVE_TOP: Final = 16.0
CURVE_STEPS: Final = 4096
OPEN_SHARE: Final = 0.72
"""Light on the ground of a park, of that on a meadow: there the exposure is 1."""
ADAPTATION: Final = 0.8
_KEPT: Final = 8  # lights in the cache, about 20 MB each; the oldest goes first


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
    scene: Scene, light: LightConfig | None = None, *, workers: int | None = None, cache_folder: Path | None = None
) -> BakedScene:
    """Compute the light of a scene, or read it from the cache.

    Args:
        scene: the world in the ray tracer.
        light: direction of the sun; None takes the defaults.
        workers: threads; None takes every available core. The result does not depend on it.
        cache_folder: where baked light is kept; None takes the user's cache.
    """
    light = LightConfig() if light is None else light
    folder = cache_folder if cache_folder is not None else default_cache()
    path = folder / f"light-{scene.world.name}-{_light_key(scene, light)}.npz"
    table = _read_light(path)
    if table is None:
        table = bake_light(scene, light, cpu_count() if workers is None else workers)
        _save_light(path, table)
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


def _light_key(scene: Scene, light: LightConfig) -> str:
    """Digest of all that light depends on: triangles, their places, what lets light through, the sun, and the code."""
    world, digest = scene.world, hashlib.blake2b(digest_size=12)
    digest.update(f"{light!r} {world.seed} {world.size} {version('numpy')} {version('scipy')}".encode())
    for module in (light_module, sky_module):
        digest.update(Path(str(module.__file__)).read_bytes())
    digest.update(np.ascontiguousarray(world.terrain.field.heights).data)
    for mesh in scene.meshes:
        clear = np.array([world.materials[name].translucency > 0 for name in mesh.materials])[mesh.material]
        for array in (mesh.vertices, mesh.normals, mesh.faces, clear):
            digest.update(np.ascontiguousarray(array).data)
    for _, placed, pose in scene.tops:
        digest.update(f"{placed.name if placed is not None else None}".encode())
        digest.update(np.ascontiguousarray(pose).data)
    return digest.hexdigest()


def _save_light(path: Path, light: LightTable) -> None:
    """Write the light; a cache that cannot be written is done without."""
    arrays: dict[str, Any] = {name: value for name, value in light._asdict().items() if isinstance(value, np.ndarray)}
    for name in ("ground_sun", "ground_sky"):
        grid: Grid = getattr(light, name)
        arrays |= {name: grid.values, f"{name}_at": np.array([grid.x0, grid.y0, grid.per_metre])}
    arrays |= {f"dome_{name}": value for name, value in light.dome._asdict().items()}
    partial = path.with_suffix(f".{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with partial.open("wb") as stream:
            np.savez(stream, allow_pickle=False, **arrays)
        partial.replace(path)
        kept = sorted(path.parent.glob("light-*.npz"), key=lambda p: p.stat().st_mtime)[-_KEPT:]
        for stale in set(path.parent.glob("light-*.npz")) - {*kept, path}:
            stale.unlink(missing_ok=True)
    except OSError:
        partial.unlink(missing_ok=True)


def _read_light(path: Path) -> LightTable | None:
    """Read the light, or return None if there is none, or none that is whole."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays: dict[str, Any] = dict(stored)
        grids: dict[str, Any] = {
            n: Grid(arrays.pop(n), *map(float, arrays.pop(f"{n}_at"))) for n in ("ground_sun", "ground_sky")
        }
        dome = Dome(**{n: arrays.pop(f"dome_{n}") for n in Dome._fields})
        return LightTable(dome=dome, **grids, **arrays)
    except (OSError, ValueError, KeyError, EOFError, TypeError, NotImplementedError, BadZipFile):
        return None
