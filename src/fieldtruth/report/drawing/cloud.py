# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A labelled cloud in perspective: points as discs in the colours of their classes, with eye-dome lighting.

Eye-dome lighting (Boucheny 2009) needs no normals: it darkens a pixel by how much nearer its neighbours are, which
shows shape and keeps the hue of the classes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Float32Array, Index
from fieldtruth.core.classes import CLASSES, ClassTable
from fieldtruth.report.drawing.images import downscaled
from fieldtruth.report.drawing.style import NIGHT

_OVERSAMPLING: Final = 2
_NEAR: Final = 0.5  # [m]
_DARKENING: Final = 22.0
_NEIGHBOURS: Final = tuple((i, j) for i in (-2, 0, 2) for j in (-2, 0, 2) if i or j)


@dataclass(frozen=True, kw_only=True)
class Cloud:
    """Points ``xyz`` (n, 3) [m] and their class ids ``label`` (n,), from so many ``scans``."""

    xyz: Array
    label: NDArray[np.uint8]
    scans: int
    classes: ClassTable = CLASSES


def looking(towards: Sequence[float] | Array) -> Array:
    """Pose world_from_optical (4, 4), at the origin, of an upright camera that looks in a direction."""
    forward = np.asarray(towards, np.float64) / np.linalg.norm(towards)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    world_from_optical = np.eye(4)
    world_from_optical[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    return world_from_optical


def draw_cloud(
    cloud: Cloud, world_from_optical: Array, *, width: int, height: int, fov_deg: float, size: float = 0.06
) -> NDArray[np.uint8]:
    """Draw points as discs of diameter ``size`` [m] into an image (height, width, 3).

    Args:
        cloud: the points.
        world_from_optical: pose (4, 4) of the camera.
        width: of the image [pixel].
        height: of the image [pixel].
        fov_deg: horizontal field of view.
        size: diameter of a point [m].
    """
    wide, high = width * _OVERSAMPLING, height * _OVERSAMPLING
    focal = wide / 2 / np.tan(np.radians(fov_deg) / 2)
    x, y, z = transforms.transform(transforms.inverse(world_from_optical), cloud.xyz).T
    visible = np.flatnonzero(z > _NEAR)
    order = visible[np.argsort(-z[visible], kind="stable")]  # near points are drawn last, over far ones
    x, y, z = x[order], y[order], z[order]
    column, row = focal * x / z + wide / 2, focal * y / z + high / 2
    radius = np.clip(0.5 * size * focal / z, 0.8, 6.0)
    depth = np.full((high, wide), np.inf, np.float32)
    label = np.zeros((high, wide), np.uint8)
    for i, j, inside in _disc(radius):
        r, c = np.rint(row[inside] + i).astype(int), np.rint(column[inside] + j).astype(int)
        kept = np.flatnonzero((r >= 0) & (r < high) & (c >= 0) & (c < wide))
        r, c, which = r[kept], c[kept], inside[kept]
        nearer = z[which] <= depth[r, c]
        r, c, which = r[nearer], c[nearer], which[nearer]
        depth[r, c] = z[which]
        label[r, c] = cloud.label[order[which]]
    return _shaded(depth, label, cloud.classes.palette)


def _disc(radius: Array) -> list[tuple[int, int, Index]]:
    """Pixel offsets of the largest disc, each with the rows of the points whose disc covers it."""
    largest = int(np.ceil(radius.max(initial=0.0)))
    square = [(i, j) for i in range(-largest, largest + 1) for j in range(-largest, largest + 1)]
    return [(i, j, np.flatnonzero(radius >= np.hypot(i, j))) for i, j in square]


def _shaded(depth: Float32Array, label: NDArray[np.uint8], palette: NDArray[np.uint8]) -> NDArray[np.uint8]:
    hit = np.isfinite(depth)
    log = np.log2(np.where(hit, depth, 1e6))
    rise = np.zeros_like(log)
    for i, j in _NEIGHBOURS:
        rise += np.clip(log - np.roll(log, (i, j), axis=(0, 1)), 0.0, 0.06)
    shade = np.exp(-_DARKENING * rise / len(_NEIGHBOURS))
    colour = np.where(hit[..., None], palette[label] * (0.25 + 0.75 * shade[..., None]), NIGHT)
    return downscaled(np.rint(colour).astype(np.uint8), _OVERSAMPLING)
