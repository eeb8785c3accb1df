# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Light that does not change while a robot drives, computed once per scene: shadows on the ground, open sky everywhere.

The world stands still and so does the sun. Whether a patch of ground sees the sun, and how much sky a leaf or a corner
sees, is therefore traced once (by as many threads as there are) and costs nothing per frame. Only objects' own shadows
are traced per pixel, because they need finer detail than a table can hold.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from fieldtruth.experiment.config import LightConfig
from fieldtruth.render.sky import Dome, make_dome, sun_direction
from fieldtruth.sense import embree
from fieldtruth.sense.hits import Grid
from fieldtruth.sense.kernel import kernel
from fieldtruth.sense.packets import Packet, new_packet, set_light_ray
from fieldtruth.sense.scene import Scene

SUN_RADIUS_DEG: Final = 0.27
SUN_RGB: Final = np.array([1.0, 0.93, 0.80], np.float32)
SUN_TEXEL: Final = 0.05  # [m]
SKY_TEXEL: Final = 0.25  # [m]
AIR_TEXEL: Final = 1.0  # [m] along x and y, from the world's corner
AIR_LAYER: Final = 1.5  # [m] from one layer of air to the next
AIR_BASE: Final = 0.4  # [m] of the lowest above the ground
AIR_LAYERS: Final = 14
REACH: Final = 80.0  # [m]; what stands farther away casts no shadow
BOUNCE: Final = np.array([0.10, 0.10, 0.05], np.float32)
"""Light from below: albedo of a sunlit meadow times the sun's irradiance, divided by pi."""

NO_SHADOW: Final = -2
_PARITIES: Final = ((0, 0), (1, 1), (0, 1), (1, 0))
_SPREAD: Final = (0.25, 0.5, 0.25)
_STRIP: Final = 50  # rows, an even number
_LEAVES_AT_ONCE: Final = 50_000
_LEAF_LIFT: Final = 0.012  # [m], so that a folded leaf does not shade itself

_LANES = embree.LANES
_FAR = embree.TFAR
_occluded: Any = embree.occluded


class LightTable(NamedTuple):
    """Light as kernels take it. Irradiances are relative to the sun's on a surface that faces it (1)."""

    sun: NDArray[np.float64]  # (3,) unit vector towards the sun
    sun_rgb: NDArray[np.float32]  # (3,) irradiance
    dome: Dome
    bounce: NDArray[np.float32]  # (3,) radiance from below
    ground_sun: Grid  # share of the sun's disc that the ground sees
    ground_sky: Grid  # share of the sky's light that reaches the ground
    vertex_sky: NDArray[np.float32]  # (v,) the same for every vertex of every mesh, standing alone
    leaf_sun: NDArray[np.uint8]  # one per face of each object with leaves: 1 where a leaf sees the sun
    air_sky: NDArray[np.float32]  # (nx, ny, nz) share of open sky in the air, past everything: below crowns it is dark
    top_base: NDArray[np.float32]  # (tops,) [m] height of each thing's foot, from which air_sky is counted
    top_leaf: NDArray[np.int64]  # (tops,) first row of leaf_sun; -1: without leaves, NO_SHADOW: the far land


def bake_light(scene: Scene, light: LightConfig, workers: int) -> LightTable:
    """Compute the light of a scene. The result does not depend on ``workers``."""
    sun = sun_direction(light.sun_azimuth_deg, light.sun_elevation_deg)
    disc = _disc(sun, 12)
    with ThreadPoolExecutor(workers) as pool:
        ground_sun = _ground_grid(scene, pool, SUN_TEXEL, disc, facing=False)
        ground_sky = _ground_grid(scene, pool, SKY_TEXEL, _hemisphere(96), facing=True)
        vertex_sky = _vertex_sky(scene, pool)
        leaf_sun, top_leaf = _leaf_sun(scene, pool, sun)
        air_sky = _air_sky(scene, pool)
    return LightTable(
        sun=sun,
        sun_rgb=SUN_RGB,
        dome=make_dome(sun, np.random.default_rng([scene.world.seed, 7])),
        bounce=BOUNCE,
        ground_sun=ground_sun,
        ground_sky=ground_sky,
        vertex_sky=vertex_sky,
        leaf_sun=leaf_sun,
        air_sky=air_sky,
        top_base=np.array([pose[2, 3] for _, _, pose in scene.tops], np.float32),
        top_leaf=top_leaf,
    )


def _disc(sun: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Directions (count, 3) spread evenly over the sun's disc."""
    k = np.arange(count) + 0.5
    radius, angle = np.radians(SUN_RADIUS_DEG) * np.sqrt(k / count), k * np.pi * (3.0 - np.sqrt(5.0))
    side = np.cross(sun, [0.0, 0.0, 1.0] if abs(sun[2]) < 0.99 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    rays = sun + np.outer(radius * np.cos(angle), side) + np.outer(radius * np.sin(angle), np.cross(sun, side))
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def _hemisphere(count: int) -> NDArray[np.float64]:
    """Directions (count, 3) spread evenly over the upper half (spherical Fibonacci)."""
    k = np.arange(count) + 0.5
    z, angle = k / count, k * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)


def _ground_grid(
    scene: Scene, pool: ThreadPoolExecutor, spacing: float, directions: NDArray[np.float64], *, facing: bool
) -> Grid:
    """Visibility of ``directions`` on a grid over the terrain, strip by strip.

    Each node looks in a quarter of the directions and its neighbours in the others; then each shares with them, so that
    all directions count alike everywhere.
    """
    field, (length, width) = scene.world.terrain.field, scene.world.size
    x = np.arange(-length / 2, length / 2 + spacing / 2, spacing)
    y = np.arange(-width / 2, width / 2 + spacing / 2, spacing)
    normal = np.array([0.0, 0.0, 1.0 if facing else 0.0], np.float32)

    def strip(rows: NDArray[np.float64]) -> NDArray[np.float32]:
        px, py = np.meshgrid(rows, y, indexing="ij")
        points = np.stack([px, py, field.height_at(px, py) + 0.005], axis=-1).astype(np.float32)
        seen = np.empty(px.shape, np.float32)
        for k, (i, j) in enumerate(_PARITIES):
            own = points[i::2, j::2].reshape(-1, 3)
            share = visibility(
                scene.rays.handle, own, np.broadcast_to(normal, own.shape), directions[k :: len(_PARITIES)], 0.01
            )
            seen[i::2, j::2] = share.reshape(seen[i::2, j::2].shape)
        return seen

    starts = range(0, len(x), _STRIP)
    strips = pool.map(strip, [x[start : start + _STRIP] for start in starts])
    seen = np.concatenate(list(strips))
    for axis in (0, 1):
        seen = convolve1d(seen, _SPREAD, axis=axis, mode="nearest")
    return Grid(seen, float(x[0]), float(y[0]), 1.0 / spacing)


def _vertex_sky(scene: Scene, pool: ThreadPoolExecutor) -> NDArray[np.float32]:
    """Open sky at every vertex of every mesh, each standing alone: objects share meshes, so neighbours do not count."""
    world, meshes = scene.world, scene.meshes
    wood_rays, leaf_rays = _hemisphere(24), _hemisphere(11)

    def one(row: int) -> NDArray[np.float32]:
        mesh, open_sky = meshes[row], np.ones(len(meshes[row].vertices), np.float32)
        if mesh is world.backdrop:
            return open_sky
        leaf = np.zeros(len(mesh.vertices), np.bool_)
        thin = np.array([world.materials[n].translucency > 0 for n in mesh.materials])
        leaf[mesh.faces[thin[mesh.material]].ravel()] = True
        points = mesh.vertices + np.float32(0.004) * mesh.normals
        points[:, 2] = np.maximum(points[:, 2], 0.01)
        rays = scene.mesh_rays[row].handle
        open_sky[~leaf] = visibility(rays, points[~leaf], mesh.normals[~leaf], wood_rays, 0.004)
        # Light falls on, and shines through, both sides of a leaf: no side counts more.
        open_sky[leaf] = visibility(rays, points[leaf], np.zeros((leaf.sum(), 3), np.float32), leaf_rays, 0.004)
        return open_sky

    return np.concatenate([*pool.map(one, range(len(meshes))), np.zeros(0, np.float32)])


def _air_sky(scene: Scene, pool: ThreadPoolExecutor) -> NDArray[np.float32]:
    """Open sky in the air over the ground, column by column, layer by layer."""
    field, (length, width) = scene.world.terrain.field, scene.world.size
    x, y = np.arange(-length / 2, length / 2 + 0.5, AIR_TEXEL), np.arange(-width / 2, width / 2 + 0.5, AIR_TEXEL)
    px, py = np.meshgrid(x, y, indexing="ij")
    ground, rays = field.height_at(px, py), _hemisphere(20)

    def layer(k: int) -> NDArray[np.float32]:
        points = np.stack([px, py, ground + AIR_BASE + k * AIR_LAYER], axis=-1).reshape(-1, 3).astype(np.float32)
        return visibility(scene.rays.handle, points, np.zeros_like(points), rays, 0.0).reshape(px.shape)

    return np.ascontiguousarray(np.stack([*pool.map(layer, range(AIR_LAYERS))], axis=-1))


def _leaf_sun(
    scene: Scene, pool: ThreadPoolExecutor, sun: NDArray[np.float64]
) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """Whether each leaf of each object sees the sun past everything else, from just above its middle."""
    world, top_leaf, end = scene.world, [], 0
    thin = {m.name: np.array([world.materials[n].translucency > 0 for n in m.materials]) for m in world.meshes.values()}
    leafy = {name: np.flatnonzero(rows[world.meshes[name].material]) for name, rows in thin.items()}
    middles = {n: world.meshes[n].vertices[world.meshes[n].faces[rows]].mean(axis=1) for n, rows in leafy.items()}
    jobs: list[list[tuple[int, str, NDArray[np.float64]]]] = [[]]
    rays = 0
    for top, mesh, pose in scene.tops:
        if mesh is None or not len(leafy.get(mesh.name, ())):
            top_leaf.append(-1 if mesh is not world.backdrop or mesh is None else NO_SHADOW)
            continue
        top_leaf.append(end)
        jobs[-1].append((end, mesh.name, pose))
        end += len(mesh.faces)
        rays += len(leafy[mesh.name])
        if rays > _LEAVES_AT_ONCE:
            jobs.append([])
            rays = 0
        assert top + 1 == len(top_leaf)
    result = np.zeros(end, np.uint8)

    def some(job: list[tuple[int, str, NDArray[np.float64]]]) -> None:
        if not job:
            return
        middle = np.concatenate([middles[name] @ pose[:3, :3].T + pose[:3, 3] for _, name, pose in job])
        points = (middle + _LEAF_LIFT * sun).astype(np.float32)
        seen = visibility(scene.rays.handle, points, np.zeros_like(points), sun[None], 0.0)
        result[np.concatenate([start + leafy[name] for start, name, _ in job])] = seen > 0.5

    list(pool.map(some, jobs))
    return result, np.array(top_leaf, np.int64)


def visibility(
    scene: np.uint64,
    points: NDArray[np.float32],
    normals: NDArray[np.float32],
    directions: NDArray[np.float64],
    near: float,
) -> NDArray[np.float32]:
    """Share (n,) of ``directions`` (k, 3) that leave each point (n, 3) freely, weighted by the cosine to its normal.

    A normal of length 0 weighs all directions alike. Where no direction lies before the surface, the share is 0.5.
    """
    result = np.empty(len(points), np.float32)
    _visibility(scene, new_packet(coherent=True), points, normals, directions, near, REACH, result)
    return result


@kernel
def _visibility(
    scene: np.uint64, packet: Packet, points: NDArray[np.float32], normals: NDArray[np.float32],
    directions: NDArray[np.float64], near: float, far: float, result: NDArray[np.float32],
) -> None:  # fmt: skip
    """Trace packets of neighbouring points in one direction at a time, which keeps the rays parallel."""
    free, total = np.zeros(_LANES, np.float32), np.zeros(_LANES, np.float32)
    for first in range(0, len(points), _LANES):
        free[:], total[:] = 0.0, 0.0
        for k in range(len(directions)):
            dx, dy, dz = directions[k, 0], directions[k, 1], directions[k, 2]
            for lane in range(_LANES):
                packet.valid[lane] = 0
                row = first + lane
                if row >= len(points):
                    continue
                n = normals[row]
                weight = n[0] * dx + n[1] * dy + n[2] * dz
                if n[0] == 0.0 and n[1] == 0.0 and n[2] == 0.0:
                    weight = 1.0
                if weight <= 0.0:
                    continue
                p = points[row]
                set_light_ray(packet, lane, p[0], p[1], p[2], dx, dy, dz, near, far)
                total[lane] += weight
                free[lane] += weight
            _occluded(packet.valid.ctypes, scene, packet.ray.ctypes, packet.arguments.ctypes)
            for lane in range(_LANES):
                if packet.valid[lane] != 0 and packet.ray[_FAR + lane] < 0.0:
                    n = normals[first + lane]
                    weight = n[0] * dx + n[1] * dy + n[2] * dz
                    if n[0] == 0.0 and n[1] == 0.0 and n[2] == 0.0:
                        weight = 1.0
                    free[lane] -= weight
        for lane in range(min(_LANES, len(points) - first)):
            result[first + lane] = free[lane] / total[lane] if total[lane] > 0.0 else 0.5
