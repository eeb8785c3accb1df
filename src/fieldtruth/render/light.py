# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Baking: light that does not change while a robot drives, computed once per scene.

World and sun are static. How much of the sun each patch of ground and each leaf sees, what is near them, and what light
sky and surroundings send through the air, is therefore traced in advance and costs nothing per frame. Only objects' own
shadows are traced per pixel, because they need more detail than a table can hold.

The sun's map has how far towards the sun the first surface lies, on a grid across its rays. What lies deeper than the
map says is in shade (Williams, "Casting curved shadows on curved surfaces", SIGGRAPH 1978). The mean of that over a
small area is the soft border of a shadow (Reeves, Salesin and Cook, SIGGRAPH 1987). Shadows of the sun from h metres
away are 0.0093 h wide at their border, so that those of crowns have none that is sharp.

The light volume has what sky, sunlit ground and leaves send through the air, as probes on a grid. Each probe keeps, by
channel, coefficients of the irradiance E on a surface with the unit normal n, over pi:
E(n) / pi = c0 + c1 . n + c2 max(nz, 0)^2, with c0 the mean radiance over all directions and c1 twice the mean of
radiance times direction (Ramamoorthi and Hanrahan 2001, the first two bands). For light from a half space, as over a
plane below an even sky, these are exact; below the CIE's overcast sky they give a level surface 7 % too little. So c2
is what a level surface receives in addition: exact for all that faces up. A leaf reads both of its sides with one
lookup, with n and with -n. Probes are filled by shading what their rays hit as a photograph does, several times: each
time adds a reflection, of light that the volume of the time before brings.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d, gaussian_filter, maximum_filter

from fieldtruth.core.arrays import Array, Counts, Float32Array, Index, Mask
from fieldtruth.experiment.light_config import LightConfig, WeatherConfig
from fieldtruth.kernels.baking import NEAR, PROBES, UP, fill_visibility, gather_probes, trace_sun_row
from fieldtruth.kernels.light import (
    AIR_BASE,
    AIR_LAYER,
    AIR_TEXEL,
    NO_SHADOW,
    RADIUS_DEG,
    SHADOW_RANGE,
    TEXEL,
    LightTable,
    MaterialTable,
    Shading,
    SunMap,
)
from fieldtruth.kernels.packets import Grid, new_packet
from fieldtruth.kernels.shading import new_shading_buffers
from fieldtruth.render import daylight
from fieldtruth.render.air import air_of, light_in
from fieldtruth.render.daylight import Daylight, metered_daylight, soft_dome, sphere, sun_direction
from fieldtruth.render.materials import material_table
from fieldtruth.render.surfaces import shading_of
from fieldtruth.sense.scene import Scene
from fieldtruth.world.grids import coarseness
from fieldtruth.world.model import Heightfield, Mesh, Raster

SUN_TEXEL: Final = 0.05  # [m]
_NEAR_GROUND: Final = 0.8
"""[m] within which what stands on the ground, or belongs to the same object, shades a surface by a share of its own;
the light volume brings what is farther. Of leaves it is ``NEAR``."""
MARGIN: Final = 10.0
"""[m] beyond the world's edge up to which the sun's map reaches."""
NOTHING: Final = np.float32(-1e9)
"""Depth where the sun meets no surface."""
LAYERS: Final = 14
COEFFICIENTS: Final = 16
"""Floats per probe, one cache line: 4 of each channel (c0, then c1 along x, y, z), c2 of each channel, 1 unused."""
RAYS: Final = (16, 16, 48)
"""Directions from each probe, for each reflection: light of the first ones is gathered again."""
_BLUR: Final = (0.25, 0.5, 0.25)
_SETS: Final = 4
_PARITIES: Final = ((0, 0), (1, 1), (0, 1), (1, 0))
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
    *,
    texels: int | None = None,
) -> LightTable:
    """Compute the light of a scene. Only its volume is that in the weather, the rest that in clear air.

    The result does not depend on ``workers``; ``materials`` are made here if they are not given. The dome has
    ``texels`` along each side, by default DOME_TEXELS.
    """
    sun = sun_direction(light.values.azimuth_deg, light.values.elevation_deg)
    disc, size = sun_disc(sun, RADIUS_DEG, 12), scene.world.size
    with ThreadPoolExecutor(workers) as pool:
        spacing, step = SUN_TEXEL * coarseness(size), AIR_TEXEL * coarseness(size)
        x, y = (np.arange(-side / 2, side / 2 + step / 2, step) for side in size)
        rng = np.random.default_rng([scene.world.seed, 7])
        day = metered_daylight(light.values, size, rng, pool, texels or daylight.DOME_TEXELS)
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
            vertex_near=_vertex_near(scene, scene.meshes, pool),
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
        volume = fill_volume(shading_of(scene, lit, materials, air), lit.dome.mean - table.dome.mean, pool)
        return table._replace(volume=volume)


def visibility(
    scene: np.uint64,
    points: Float32Array,
    normals: Float32Array | None,
    directions: Array,
    near: float,
    reach: float = SHADOW_RANGE,
) -> Float32Array:
    """Share (n,) of ``directions`` (k, 3) that are unobstructed at each point (n, 3).

    Directions are weighted by the cosine to the point's normal, or equally without ``normals`` or for a normal of
    length 0. Where no direction has a positive weight, the share is 0.5. Occluders within ``near`` and beyond ``reach``
    [m] are ignored.
    """
    result = np.empty(len(points), np.float32)
    normals = np.zeros_like(points) if normals is None else normals
    ahead = np.ascontiguousarray(directions)  # other strides would compile another kernel
    fill_visibility(scene, new_packet(coherent=True), points, normals, ahead, near, reach, result)
    return result


def sun_disc(sun: Array, radius_deg: float, count: int) -> Array:
    """Directions (count, 3) spread evenly over a disc about the unit vector ``sun``."""
    k = np.arange(count) + 0.5
    radius, angle = np.radians(radius_deg) * np.sqrt(k / count), k * np.pi * (3.0 - np.sqrt(5.0))
    side = np.cross(sun, [0.0, 0.0, 1.0] if abs(sun[2]) < 0.99 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    rays = sun + np.outer(radius * np.cos(angle), side) + np.outer(radius * np.sin(angle), np.cross(sun, side))
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def hemisphere(count: int) -> Array:
    """Directions (count, 3) spread evenly over the upper half (spherical Fibonacci)."""
    k = np.arange(count) + 0.5
    z, angle = k / count, k * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)


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
    """Find the faces (f,) that light shines through: leaves."""
    thin = np.array([scene.world.materials[name].translucency > 0 for name in mesh.materials])
    return np.asarray(thin[mesh.material])


def with_bodies(light: LightTable, scene: Scene) -> LightTable:
    """Return the light of what stands still in a scene, with rows for its bodies that move."""
    if not scene.moving:
        return light
    with ThreadPoolExecutor(1) as pool:
        near = _vertex_near(scene, scene.meshes[len(scene.still.meshes) :], pool, lowest=-np.inf)
    leaves = np.append(light.top_leaf, np.full(len(scene.moving), -1))
    return light._replace(vertex_near=np.append(light.vertex_near, near), top_leaf=leaves)


def _vertex_near(
    scene: Scene, meshes: Sequence[Mesh], pool: ThreadPoolExecutor, *, lowest: float = 0.01
) -> Float32Array:
    """Share of directions in which a mesh's own faces are not near, at every vertex of every mesh.

    What is below ``lowest`` [m] in the mesh's frame is in the soil, and has the share at that height.

    Objects share meshes, so that neighbours cannot be considered.
    """
    wood_rays, leaf_rays = sphere(48, 0.0), sphere(12, 0.0)
    alone = [scene.mesh_rays(mesh) for mesh in meshes]

    def one_mesh(row: int) -> Float32Array:
        mesh = meshes[row]
        share = np.ones(len(mesh.vertices), np.float32)
        if mesh is scene.world.backdrop:
            return share
        leaf = np.zeros(len(mesh.vertices), np.bool_)
        leaf[mesh.faces[_thin_faces(scene, mesh)].ravel()] = True
        points = mesh.vertices + np.float32(0.004) * mesh.normals
        points[:, 2] = np.maximum(points[:, 2], lowest)
        rays = alone[row].handle
        share[~leaf] = visibility(rays, points[~leaf], mesh.normals[~leaf], wood_rays, 0.004, _NEAR_GROUND)
        # Light falls on, and shines through, both sides of a leaf: neither side has more weight.
        share[leaf] = visibility(rays, points[leaf], None, leaf_rays, 0.004, NEAR)
        return share

    return np.concatenate([*pool.map(one_mesh, range(len(meshes))), np.zeros(0, np.float32)])


class _Leaves(NamedTuple):
    """Leaves of one instance: first row of the result, faces of its mesh that are leaves, and its pose."""

    start: int
    faces: Index
    mesh: Mesh
    pose: Array


def _leaf_sun(scene: Scene, pool: ThreadPoolExecutor, sun: Array) -> tuple[NDArray[np.uint8], Counts]:
    """Find for each leaf of each instance if it sees the sun from just above its centre, with all occluders.

    Returns:
        0 or 1 for each face of each instance with leaves, and for each top-level geometry its first row.
    """
    top_leaf, end, leaves = [], 0, list[_Leaves]()
    few = _copies(scene)
    alike: dict[tuple[str, int], list[int]] = {}
    faces_of = {mesh.name: np.flatnonzero(_thin_faces(scene, mesh)) for mesh in scene.world.meshes.values()}
    for mesh, pose, *_ in scene.top_levels:
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
    copies = Counter(top.mesh.name for top in scene.top_levels if top.mesh is not None)
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


def make_sun_map(scene: Scene, sun: Array, pool: ThreadPoolExecutor) -> SunMap:
    """Trace a map from the sun in the direction of the unit vector ``sun``."""
    if sun[2] <= 0.0:
        return SunMap(np.zeros((0, 0), np.float32), np.zeros((3, 3), np.float32), (0.0, 0.0), 1.0)
    corners, texel = _corners(scene), TEXEL * coarseness(scene.world.size)
    axes = _axes(sun, corners)
    low, high = (corners @ axes.T).min(axis=0), (corners @ axes.T).max(axis=0)
    u, v = (np.arange(low[k], high[k] + texel, texel) for k in range(2))
    depth = np.empty((len(u), len(v)), np.float32)

    def trace_row(i: int) -> None:
        start = u[i] * axes[0] + low[1] * axes[1] + (high[2] + 1.0) * axes[2]
        trace_sun_row(scene.rays.handle, new_packet(coherent=True), start, texel * axes[1], -axes[2], depth[i])

    list(pool.map(trace_row, range(len(u))))
    depth = np.where(np.isfinite(depth), np.float32(high[2] + 1.0) - depth, NOTHING)
    return SunMap(depth, axes.astype(np.float32), (float(low[0]), float(low[1])), 1.0 / texel)


def _corners(scene: Scene) -> Array:
    """Corners (8, 3) of a box around the world with its margin."""
    heights, highest = scene.world.terrain.surface.heights, []
    for mesh, pose, *_ in scene.top_levels:
        if mesh is not None and mesh is not scene.world.backdrop:
            highest.append(pose[2, 3] + np.abs(mesh.vertices @ pose[2, :3]).max())
    x, y = (side / 2.0 + MARGIN for side in scene.world.size)
    top = max([float(heights.max()), *highest])
    return np.array([(a, b, c) for a in (-x, x) for b in (-y, y) for c in (float(heights.min()), top)])


def _axes(sun: Array, corners: Array) -> Array:
    """Axes (3, 3) of the map, turned about the sun's direction so that its rectangle is the smallest."""
    side = np.cross([0.0, 0.0, 1.0] if sun[2] < 0.99 else [0.0, 1.0, 0.0], sun)
    side /= np.linalg.norm(side)
    other, best, least = np.cross(sun, side), np.eye(3), np.inf
    for turn in np.radians(np.arange(90)):
        u, v = np.cos(turn) * side + np.sin(turn) * other, np.cos(turn) * other - np.sin(turn) * side
        area = np.ptp(corners @ u) * np.ptp(corners @ v)
        if area < least:
            best, least = np.stack([u, v, sun]), area
    return best


def fill_volume(shading: Shading, veil: Float32Array, pool: ThreadPoolExecutor) -> Float32Array:
    """Fill the probes (nx, ny, LAYERS, COEFFICIENTS) of ``shading.light``, whose volume gives their number.

    ``veil`` (3,) is radiance of the air that comes from the whole sky in addition to that of the dome.
    """
    shading = shading._replace(light=shading.light._replace(dome=soft_dome(shading.light.dome)))  # rays are few
    for rays in RAYS:
        volume = _gathered(shading, veil, rays, pool)
        shading = shading._replace(light=shading.light._replace(volume=volume))
    return shading.light.volume


def _gathered(shading: Shading, veil: Float32Array, rays: int, pool: ThreadPoolExecutor) -> Float32Array:
    """Gather over all probes in ``rays`` directions, then blur; probes inside of solid objects have no weight."""
    light = shading.light
    nx, ny, nz, _ = light.volume.shape
    volume, inside = np.zeros_like(light.volume), np.zeros((nx, ny, nz), np.float32)
    x, y = (
        start + np.arange(n) / light.volume_per_metre for start, n in zip(light.volume_corner, (nx, ny), strict=True)
    )
    above = AIR_BASE + AIR_LAYER * np.arange(nz)
    sets = [sphere(rays, 2.0 * np.pi * k * 0.381966).astype(np.float32) for k in range(_SETS)]

    def column_row(i: int) -> None:
        buffers = new_shading_buffers(PROBES * rays)
        for parity in range(_SETS):
            j, k = np.nonzero((np.arange(ny)[:, None] + 2 * i + np.arange(nz)) % _SETS == parity)
            points = np.stack([np.full(len(j), x[i]), y[j], light.volume_base[i, j] + above[k]], axis=-1)
            found, behind = np.zeros((len(j), COEFFICIENTS), np.float32), np.zeros(len(j), np.float32)
            heights = above[k].astype(np.float32)
            gather_probes(shading, buffers, points.astype(np.float32), heights, sets[parity], veil, found, behind)
            found[:, UP : UP + 3] -= found[:, 0:UP:4] + found[:, 3:UP:4]
            volume[i, j, k], inside[i, j, k] = found, behind

    list(pool.map(column_row, range(nx)))
    weight = np.maximum(1.0 - 3.0 * inside, np.float32(1e-3))
    volume *= weight[..., None]
    for axis in (0, 1):
        volume, weight = (convolve1d(each, _BLUR, axis=axis, mode="nearest") for each in (volume, weight))
    return np.ascontiguousarray(volume / weight[..., None], np.float32)
