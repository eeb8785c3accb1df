# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Baking: light that does not change while a robot drives, computed once per scene.

World and sun are static. How much of the sun each patch of ground and each leaf sees, what is near them, and what light
sky and surroundings send through the air, is therefore traced in advance and costs nothing per frame. Only objects' own
shadows are traced per pixel, because they need more detail than a table can hold.
"""

from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d, gaussian_filter, maximum_filter

from fieldtruth.core.arrays import Array, Counts, Float32Array, Index, Mask
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.experiment.weather_config import WeatherConfig
from fieldtruth.kernels.light import AIR_TEXEL, NO_SHADOW, SHADOW_RANGE, AirTable, LightTable, MaterialTable, Shading
from fieldtruth.kernels.light_probes import NEAR
from fieldtruth.kernels.packets import Grid
from fieldtruth.render.air import air_of, light_in
from fieldtruth.render.materials import material_table
from fieldtruth.render.sky import dome
from fieldtruth.render.sky.daylight import SUN_RADIUS_DEG, Daylight, metered_daylight, sun_direction
from fieldtruth.render.sun_map import make_sun_map
from fieldtruth.render.surfaces import snow_table, surface_table
from fieldtruth.render.visibility import hemisphere, sun_disc, visibility
from fieldtruth.render.volume import COEFFICIENTS, LAYERS, fill_volume, sphere
from fieldtruth.render.wire_table import wire_table
from fieldtruth.sense.scene import Scene
from fieldtruth.world.grids import coarseness
from fieldtruth.world.model import Heightfield, Mesh, Raster

SUN_TEXEL: Final = 0.05  # [m]
_NEAR_GROUND: Final = 0.8
"""[m] within which what stands on the ground, or belongs to the same object, shades a surface by a share of its own;
the light volume brings what is farther. Of leaves it is ``volume.NEAR``."""

_PARITIES: Final = ((0, 0), (1, 1), (0, 1), (1, 0))
_BLUR: Final = (0.25, 0.5, 0.25)
_RELIEF: Final = 0.1  # [m]; bumps that are farther apart are the ground's shape and cast shadows
_ROWS_AT_ONCE: Final = 50  # an even number
_LEAVES_AT_ONCE: Final = 50_000
_MOST_LEAVES: Final = 40_000_000
"""Faces whose sunlight is kept; in a world with more, copies of a tree that are turned alike share that of a few."""
_LEAF_OFFSET: Final = 0.012  # [m], so that a folded leaf does not shade itself


def bake_light(
    scene: Scene,
    light: LightConfig,
    workers: int,
    weather: WeatherConfig | None = None,
    materials: MaterialTable | None = None,
) -> LightTable:
    """Compute the light of a scene. Only its volume is that in the weather, the rest that in clear air.

    The result does not depend on ``workers``; ``materials`` are made here if they are not given.
    """
    sun = sun_direction(light.values.azimuth_deg, light.values.elevation_deg)
    disc, size = sun_disc(sun, SUN_RADIUS_DEG, 12), scene.world.size
    with ThreadPoolExecutor(workers) as pool:
        spacing, step = SUN_TEXEL * coarseness(size), AIR_TEXEL * coarseness(size)
        x, y = (np.arange(-side / 2, side / 2 + step / 2, step) for side in size)
        day = metered_daylight(light.values, size, np.random.default_rng([scene.world.seed, 7]), pool, dome.SIZE)
        leaf_sun, top_leaf = _leaf_sun(scene, pool, sun)
        table = LightTable(
            sun=sun,
            sun_rgb=day.sun_rgb,
            disc=day.disc,
            unit=day.unit,
            cloud_sun=day.cloud_sun,
            has_cloud_shadow=bool(day.cloud_sun.values.min() < 0.99),
            dome=day.dome,
            sun_map=make_sun_map(scene, sun, pool),
            ground_sun=_below_clouds(_ground_grid(scene, pool, spacing, disc), day),
            ground_near=_ground_grid(scene, pool, spacing, hemisphere(24), reach=_NEAR_GROUND),
            vertex_near=_vertex_near(scene, pool),
            leaf_sun=leaf_sun,
            volume=np.zeros((len(x), len(y), LAYERS, COEFFICIENTS), np.float32),
            volume_base=scene.world.terrain.surface.height_at(*np.meshgrid(x, y, indexing="ij")).astype(np.float32),
            volume_corner=(float(x[0]), float(y[0])),
            volume_per_metre=1.0 / step,
            top_leaf=top_leaf,
        )
        heights = scene.world.terrain.surface.heights
        air, materials = air_of(weather, table, heights), materials or material_table(scene.world, sun)
        lit = light_in(air, table, float(heights.mean()))
        volume = fill_volume(_unfilled(scene, lit, materials, air), lit.dome.mean - table.dome.mean, pool)
        return table._replace(volume=volume)


def _unfilled(scene: Scene, table: LightTable, materials: MaterialTable, air: AirTable) -> Shading:
    """What probes need to see the scene."""
    snow = snow_table(scene.world.terrain)
    return Shading(
        scene=scene.rays.handle,
        hits=scene.hits,
        surfaces=surface_table(scene, table.vertex_near),
        materials=materials,
        light=table,
        wires=wire_table(scene, materials),
        has_water=False,
        exposure=np.float32(1.0),
        air=air,
        snow=snow,
        has_snow=bool(snow.on_top > 0),
    )


def _ground_grid(
    scene: Scene, pool: ThreadPoolExecutor, spacing: float, directions: Array, *, reach: float | None = None
) -> Grid:
    """Visibility of ``directions`` on a grid over the terrain: of the sun, or within ``reach`` [m], weighted by the
    cosine to the vertical.

    It is that just above the relief: shadows are those of objects and of the ground's shape. Each node traces a quarter
    of the directions, its neighbours the others; a blur then combines them, so that all directions have equal weight
    everywhere.
    """
    field, (length, width) = _above_relief(scene.world.terrain.surface), scene.world.size
    x = np.arange(-length / 2, length / 2 + spacing / 2, spacing)
    y = np.arange(-width / 2, width / 2 + spacing / 2, spacing)
    up = np.array([0.0, 0.0, 1.0], np.float32)

    def trace_rows(rows: Array) -> Float32Array:
        px, py = np.meshgrid(rows, y, indexing="ij")
        points = np.stack([px, py, field.height_at(px, py) + 0.005], axis=-1).astype(np.float32)
        seen = np.empty(px.shape, np.float32)
        for k, (i, j) in enumerate(_PARITIES):
            own = points[i::2, j::2].reshape(-1, 3)
            normals = None if reach is None else np.tile(up, (len(own), 1))
            some = directions[k :: len(_PARITIES)]
            share = visibility(scene.rays.handle, own, normals, some, 0.01, SHADOW_RANGE if reach is None else reach)
            seen[i::2, j::2] = share.reshape(seen[i::2, j::2].shape)
        return seen

    starts = range(0, len(x), _ROWS_AT_ONCE)
    seen = np.concatenate(list(pool.map(trace_rows, [x[start : start + _ROWS_AT_ONCE] for start in starts])))
    for axis in (0, 1):
        seen = convolve1d(seen, _BLUR, axis=axis, mode="nearest")
    return Grid(seen, float(x[0]), float(y[0]), 1.0 / spacing)


def _below_clouds(ground_sun: Grid, day: Daylight) -> Grid:
    """Share of the sun's disc seen from the ground, times the share of its light that clouds let through."""
    if day.cloud_sun.values.min() >= 0.99:
        return ground_sun
    clouds, (rows, columns) = day.cloud_sun, ground_sun.values.shape
    raster = Raster(values=clouds.values, spacing=1.0 / clouds.per_metre, x0=clouds.x0, y0=clouds.y0)
    x, y = (c + np.arange(n) / ground_sun.per_metre for c, n in ((ground_sun.x0, rows), (ground_sun.y0, columns)))
    share = raster.at(*np.meshgrid(x, y, indexing="ij")).astype(np.float32)
    return ground_sun._replace(values=ground_sun.values * share)


def _above_relief(field: Heightfield) -> Heightfield:
    """The ground's shape, lifted onto the relief's highest point within ``_RELIEF``; a plane stays as it is."""
    shape = gaussian_filter(field.heights, _RELIEF / field.spacing, mode="nearest")
    nodes = 2 * round(_RELIEF / field.spacing) + 1
    return replace(field, heights=shape + maximum_filter(field.heights - shape, nodes, mode="nearest"))


def _thin_faces(scene: Scene, mesh: Mesh) -> Mask:
    """Which faces (f,) light shines through: leaves."""
    thin = np.array([scene.world.materials[name].translucency > 0 for name in mesh.materials])
    return np.asarray(thin[mesh.material])


def _vertex_near(scene: Scene, pool: ThreadPoolExecutor) -> Float32Array:
    """Share of directions in which a mesh's own faces are not near, at every vertex of every mesh.

    Objects share meshes, so that neighbours cannot be considered.
    """
    wood_rays, leaf_rays = sphere(48, 0.0), sphere(12, 0.0)
    alone = [scene.mesh_rays(mesh) for mesh in scene.meshes]

    def one_mesh(row: int) -> Float32Array:
        mesh = scene.meshes[row]
        share = np.ones(len(mesh.vertices), np.float32)
        if mesh is scene.world.backdrop:
            return share
        leaf = np.zeros(len(mesh.vertices), np.bool_)
        leaf[mesh.faces[_thin_faces(scene, mesh)].ravel()] = True
        points = mesh.vertices + np.float32(0.004) * mesh.normals
        points[:, 2] = np.maximum(points[:, 2], 0.01)
        rays = alone[row].handle
        share[~leaf] = visibility(rays, points[~leaf], mesh.normals[~leaf], wood_rays, 0.004, _NEAR_GROUND)
        # Light falls on, and shines through, both sides of a leaf: neither side has more weight.
        share[leaf] = visibility(rays, points[leaf], None, leaf_rays, 0.004, NEAR)
        return share

    return np.concatenate([*pool.map(one_mesh, range(len(scene.meshes))), np.zeros(0, np.float32)])


class _Leaves(NamedTuple):
    """Leaves of one instance: first row of the result, faces of its mesh that are leaves, and its pose."""

    start: int
    faces: Index
    mesh: Mesh
    pose: Array


def _leaf_sun(scene: Scene, pool: ThreadPoolExecutor, sun: Array) -> tuple[NDArray[np.uint8], Counts]:
    """Whether each leaf of each instance sees the sun from just above its centre, with all occluders.

    Returns:
        0 or 1 for each face of each instance with leaves, and for each top-level geometry its first row.
    """
    top_leaf, end, leaves = [], 0, list[_Leaves]()
    few = _copies(scene)
    alike: dict[tuple[str, int], list[int]] = {}
    faces_of = {mesh.name: np.flatnonzero(_thin_faces(scene, mesh)) for mesh in scene.world.meshes.values()}
    for mesh, pose, *_ in scene.tops:
        if mesh is None or not len(faces_of.get(mesh.name, ())):
            top_leaf.append(NO_SHADOW if mesh is not None and mesh is scene.world.backdrop else -1)
            continue
        known = alike.setdefault((mesh.name, _quarter(pose)), [])
        if len(known) >= few:
            top_leaf.append(known[len(top_leaf) % few])
            continue
        known.append(end)
        top_leaf.append(end)
        leaves.append(_Leaves(end, faces_of[mesh.name], mesh, pose))
        end += len(mesh.faces)
    result = np.zeros(end, np.uint8)
    centres = {n: (m := scene.world.meshes[n]).vertices[m.faces[rows]].mean(axis=1) for n, rows in faces_of.items()}

    def trace_leaves(job: list[_Leaves]) -> None:
        world = np.concatenate([centres[x.mesh.name] @ x.pose[:3, :3].T + x.pose[:3, 3] for x in job])
        points = (world + _LEAF_OFFSET * sun).astype(np.float32)
        seen = visibility(scene.rays.handle, points, None, sun[None], 0.0)
        result[np.concatenate([x.start + x.faces for x in job])] = seen > 0.5

    list(pool.map(trace_leaves, _jobs(leaves)))
    return result, np.array(top_leaf, np.int64)


def _quarter(pose: Array) -> int:
    """Quarter turns about the vertical of a pose (4, 4), to the nearest."""
    return round(float(np.arctan2(pose[1, 0], pose[0, 0])) / (np.pi / 2)) % 4


def _copies(scene: Scene) -> int:
    """Number of copies of a mesh, turned alike, whose leaves have light of their own: all in worlds of usual size."""
    copies = Counter(top.mesh.name for top in scene.tops if top.mesh is not None)
    faces = {mesh.name: len(mesh.faces) for mesh in scene.meshes if _thin_faces(scene, mesh).any()}
    if sum(faces[name] * copies[name] for name in faces) <= _MOST_LEAVES:
        return max(copies.values(), default=1)
    return max(1, _MOST_LEAVES // (4 * sum(faces.values())))


def _jobs(leaves: list[_Leaves]) -> Iterator[list[_Leaves]]:
    """Split into jobs of about _LEAVES_AT_ONCE leaves."""
    job, rays = list[_Leaves](), 0
    for each in leaves:
        job.append(each)
        rays += len(each.faces)
        if rays > _LEAVES_AT_ONCE:
            yield job
            job, rays = [], 0
    if job:
        yield job
