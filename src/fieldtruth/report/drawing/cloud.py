# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A labelled cloud in perspective: points as small discs in their classes' colours, darkened below what is nearer.

The darkening is eye-dome lighting (Boucheny 2009), which needs no normals: a pixel is darkened by how much nearer its
neighbours are. Classes keep their hue.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core import frames
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import PALETTE
from fieldtruth.experiment.rig import Rig
from fieldtruth.report.drawing.aerial import halved
from fieldtruth.sense.lidar import Lidar
from fieldtruth.sense.scene import Scene

_OVERSAMPLED: Final = 2
_DARKENING: Final = 22.0
_OUTSIDE: Final = 2.0  # percent of the points that may lie beyond each edge of the picture
_NEIGHBOURS: Final = tuple((i, j) for i in (-2, 0, 2) for j in (-2, 0, 2) if i or j)


@dataclass(frozen=True, kw_only=True)
class Cloud:
    """Points ``xyz`` (n, 3) [m] in the world and their class ids ``label`` (n,), of so many ``scans``."""

    xyz: Array
    label: NDArray[np.uint8]
    scans: int


def scan_from(scene: Scene, rig: Rig, poses: Sequence[Array]) -> Cloud:
    """All points inside the world's edges of a scan from each pose world_from_base (4, 4)."""
    lidar = Lidar(rig.lidar, scene)
    xyz, label = [np.zeros((0, 3))], [np.zeros(0, np.uint8)]
    for pose in poses:
        world_from_lidar = pose @ rig.lidar.mount.base_from_sensor
        scan = lidar.scan(world_from_lidar)
        points = frames.transform(world_from_lidar, scan.xyz)
        inside = (np.abs(points[:, :2]) < np.array(scene.world.size) / 2).all(axis=1)
        xyz.append(points[inside])
        label.append(scan.label[inside])
    return Cloud(xyz=np.concatenate(xyz), label=np.concatenate(label), scans=len(poses))


def outlook(xyz: Array, towards: Sequence[float], *, fov_deg: float, aspect: float) -> Array:
    """Pose world_from_optical (4, 4) of an upright camera that sees nearly all points and nothing else.

    Args:
        xyz: points (n, 3) [m].
        towards: direction of sight.
        fov_deg: horizontal field of view.
        aspect: width by height of the picture.
    """
    forward = np.asarray(towards, np.float64) / np.linalg.norm(towards)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    world_from_optical = np.eye(4)
    world_from_optical[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    if len(xyz):
        world_from_optical[:3, 3] = _eye(xyz, world_from_optical[:3, :3], np.tan(np.radians(fov_deg) / 2), aspect)
    return world_from_optical


def _eye(xyz: Array, rotation: Array, slope: float, aspect: float) -> Array:
    """Place [m] from which the points fill a picture of half width ``slope`` at distance 1, in its middle."""
    sides = (_OUTSIDE, 100 - _OUTSIDE)
    eye = np.mean(np.percentile(xyz, sides, axis=0), axis=0)
    for _ in range(3):
        x, y, z = ((xyz - eye) @ rotation).T
        back = float(np.percentile(np.maximum(np.abs(x) / slope, np.abs(y) * aspect / slope) - z, sides[1]))
        reach = z + back
        seen = reach > 0.1 * back
        across, down = (float(np.mean(np.percentile(v[seen] / reach[seen], sides))) for v in (x, y))
        middle = float(np.median(reach))
        eye = eye + rotation @ (across * middle, down * middle, -back)
    return np.asarray(eye)


def draw_cloud(
    cloud: Cloud, world_from_optical: Array, *, width: int, height: int, fov_deg: float, background: Sequence[int],
    size: float = 0.06,
) -> NDArray[np.uint8]:  # fmt: skip
    """Draw the cloud as discs of ``size`` [m] across, (height, width, 3); ``fov_deg`` is the horizontal angle."""
    wide, high = width * _OVERSAMPLED, height * _OVERSAMPLED
    focal = wide / 2 / np.tan(np.radians(fov_deg) / 2)
    x, y, z = frames.transform(frames.inverse(world_from_optical), cloud.xyz).T
    seen = np.flatnonzero(z > 0.5)
    order = seen[np.argsort(-z[seen], kind="stable")]  # what is nearer is drawn later, over what is farther
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
    return _shaded(depth, label, background)


def _disc(radius: Array) -> list[tuple[int, int, NDArray[np.intp]]]:
    """Offsets of a disc's pixels, each with the rows of the points whose disc is that large."""
    reach = int(np.ceil(radius.max(initial=0.0)))
    square = [(i, j) for i in range(-reach, reach + 1) for j in range(-reach, reach + 1)]
    return [(i, j, np.flatnonzero(radius >= np.hypot(i, j))) for i, j in square]


def _shaded(depth: NDArray[np.float32], label: NDArray[np.uint8], background: Sequence[int]) -> NDArray[np.uint8]:
    hit = np.isfinite(depth)
    log = np.log2(np.where(hit, depth, 1e6))
    rise = np.zeros_like(log)
    for i, j in _NEIGHBOURS:
        rise += np.clip(log - np.roll(log, (i, j), axis=(0, 1)), 0.0, 0.06)
    shade = np.exp(-_DARKENING * rise / len(_NEIGHBOURS))
    colour = np.where(hit[..., None], PALETTE[label] * (0.25 + 0.75 * shade[..., None]), np.asarray(background))
    return halved(np.rint(colour).astype(np.uint8), _OVERSAMPLED)
