# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot in the photographs of its own cameras: dark paint, rubber and steel in the light of the world around it.

Its parts shade each other. How much of the sun reaches it through the trees is traced in each image at ``_NODES``
points above the deck, and interpolated between them along the sun's rays. Light from sky and ground is as in
``shading``, with the light in the air where the robot is. The robot casts no shadow on the world.
"""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.render.probes import READ, falling_on, read_probes
from fieldtruth.render.tables import EXPOSURE, LightTable, Shading
from fieldtruth.render.visibility import sun_disc, visibility
from fieldtruth.sense.hits import Grid, read_grid
from fieldtruth.sense.robot_rays import enters
from fieldtruth.sense.robot_view import RobotSamples, RobotView

_ALBEDO: Final = np.array([[0.055, 0.057, 0.060], [0.030, 0.029, 0.028], [0.20, 0.20, 0.19]], np.float32)
"""Of dark paint, rubber and a grey rim, by material: our choice."""
_MIRROR: Final = np.array([0.04, 0.0, 0.0], np.float32)
"""Reflectance at normal incidence: that of a varnish with the refractive index 1.5, in Schlick's approximation."""
_NODES: Final = (14, 10)
_MARGIN: Final = 0.1  # [m] beyond the robot's parts
_ABOVE: Final = 0.02  # [m], of the nodes above the highest part
_SUN_RADIUS_DEG: Final = 0.27
_SUN_RAYS: Final = 4
_MIDDLE: Final = 0.4  # [m] of the robot above the origin of base_link

_Vector = tuple[float, float, float]


def paint_robot(
    shading: Shading, view: RobotView, world_from_base: Array, depth: Float32Array, linear: Float32Array
) -> None:
    """Draw the robot into light (h, w, 3) of the world, wherever it is before the world's ``depth`` (h, w) [m]."""
    if len(view.samples.pixel):
        poses = np.ascontiguousarray(world_from_base, np.float64), view.eye
        sunlit, level = _sunlit(shading, view.table, poses[0])
        _paint(view.samples, view.table, poses, sunlit, level, shading.light, shading.exposure, depth, linear)


def _sunlit(shading: Shading, table: Array, world_from_base: Array) -> tuple[Grid, float]:
    """Share of the sun that reaches a level above the robot, over x and y of base_link, and its height there [m]."""
    low = (table[:, 1:4] - table[:, 4:7]).min(axis=0) - _MARGIN
    high = (table[:, 1:4] + table[:, 4:7]).max(axis=0) + _MARGIN
    spacing = float(((high - low)[:2] / (np.array(_NODES) - 1)).max())
    x, y = (start + spacing * np.arange(count) for start, count in zip(low, _NODES, strict=False))
    level = float(high[2]) - _MARGIN + _ABOVE
    points = np.stack([*np.meshgrid(x, y, indexing="ij"), np.full(_NODES, level)], axis=-1).reshape(-1, 3)
    world = (points @ world_from_base[:3, :3].T + world_from_base[:3, 3]).astype(np.float32)
    seen = visibility(shading.scene, world, None, sun_disc(shading.light.sun, _SUN_RADIUS_DEG, _SUN_RAYS), _ABOVE)
    return Grid(seen.reshape(_NODES), float(x[0]), float(y[0]), 1.0 / spacing), level


@inlined
def _sun_at(table: Array, sunlit: Grid, level: float, x: float, y: float, z: float, sun: _Vector) -> float:
    """Share of the sun that reaches a point of the robot. A convex part does not shade itself."""
    for part in range(len(table)):
        if enters(table, part, x, y, z, sun[0], sun[1], sun[2])[0] < np.inf:
            return 0.0
    along = (level - z) / max(sun[2], 0.1)
    return float(read_grid(sunlit, x + along * sun[0], y + along * sun[1]))


@inlined
def _turned(pose: Array, x: float, y: float, z: float) -> _Vector:
    return (
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z,
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z,
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z,
    )


@inlined
def _reflected(normal: _Vector, ray: _Vector, reflectance: float) -> float:
    """Share of the sky's light that dull varnish reflects to the camera, with Schlick's approximation (1994)."""
    length = np.sqrt(ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2])
    cosine = -(normal[0] * ray[0] + normal[1] * ray[1] + normal[2] * ray[2]) / length
    if reflectance == 0.0 or ray[2] + 2.0 * cosine * length * normal[2] <= 0.0:
        return 0.0
    return reflectance + (1.0 - reflectance) * (1.0 - min(max(cosine, 0.0), 1.0)) ** 5  # type: ignore[no-any-return]


@kernel(allocates=True)
def _paint(
    samples: RobotSamples,
    table: Array,
    poses: tuple[Array, Array],
    sunlit: Grid,
    level: float,
    light: LightTable,
    exposure: np.float32,
    depth: Float32Array,
    linear: Float32Array,
) -> None:
    """Blend the samples into their pixels; ``poses`` are those of base_link and of the camera's origin in it (3,)."""
    pixel, share, own_depth, points, normals, material = samples
    pose, eye = poses
    width, sun, probe = depth.shape[1], (light.sun[0], light.sun[1], light.sun[2]), np.empty(READ, np.float32)
    above = _turned(pose.T, sun[0], sun[1], sun[2])
    (x0, y0), per = light.volume_corner, light.volume_per_metre
    at_x, at_y = np.float32((pose[0, 3] - x0) * per), np.float32((pose[1, 3] - y0) * per)
    read_probes(light.volume, light.volume_base, at_x, at_y, np.float32(pose[2, 3] + _MIDDLE), probe)
    scale, colour, cover = EXPOSURE * exposure, np.zeros(3), 0.0
    for k in range(len(pixel)):
        v, u = pixel[k] // width, pixel[k] % width
        if depth[v, u] == 0.0 or own_depth[k] < depth[v, u]:
            x, y, z = points[k, 0], points[k, 1], points[k, 2]
            n = _turned(pose, normals[k, 0], normals[k, 1], normals[k, 2])
            ray = _turned(pose, x - eye[0], y - eye[1], z - eye[2])
            front = max(n[0] * sun[0] + n[1] * sun[1] + n[2] * sun[2], 0.0) / np.pi
            if front > 0.0:
                front *= _sun_at(table, sunlit, level, x, y, z, above)
            nx, ny, nz = np.float32(n[0]), np.float32(n[1]), np.float32(n[2])
            mirrored = _reflected(n, ray, _MIRROR[material[k]])
            for channel in range(3):
                falling = light.sun_rgb[channel] * front + falling_on(probe, channel, nx, ny, nz)
                level_light = probe[4 * channel] + probe[4 * channel + 3]
                value = _ALBEDO[material[k], channel] * falling + mirrored * level_light
                colour[channel] += share[k] * scale * value
            cover += share[k]
        if k + 1 == len(pixel) or pixel[k + 1] != pixel[k]:
            for channel in range(3):
                linear[v, u, channel] = (1.0 - cover) * linear[v, u, channel] + colour[channel]
                colour[channel] = 0.0
            cover = 0.0
