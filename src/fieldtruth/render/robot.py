# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot in the photographs of its own cameras: dark paint, rubber and steel in the light of the world around it.

Its parts shade each other. How much of the sun reaches it through the trees is traced in each image at ``_NODES``
points above the deck, and interpolated between them along the sun's rays. Light from sky and ground is as in
``shading``, with the light in the air where the robot is. Its shadow on the world is soft by the width of the sun.
"""

from typing import Final

import numpy as np

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.light import RADIUS_DEG, RobotTable, Shading
from fieldtruth.kernels.packets import Grid
from fieldtruth.kernels.robot import paint_samples
from fieldtruth.render.light import sun_disc, visibility
from fieldtruth.sense.robot import RobotView

_NODES: Final = (14, 10)
_MARGIN: Final = 0.1  # [m] beyond the robot's parts
_ABOVE: Final = 0.02  # [m], of the nodes above the highest part
_SUN_RAYS: Final = 4
_SHADOW_RAYS: Final = 12
"""To the sun's disc, from each point that the robot may shade."""


def with_shadow(shading: Shading, view: RobotView) -> Shading:
    """Return the light in which the robot of a view hides the sun from the world."""
    table = view.table
    low, high = (table[:, 1:4] - table[:, 4:7]).min(axis=0), (table[:, 1:4] + table[:, 4:7]).max(axis=0)
    ball = np.array([*(low + high) / 2, np.linalg.norm(high - low) / 2])
    disc = np.ascontiguousarray(sun_disc(shading.light.sun, RADIUS_DEG, _SHADOW_RAYS)[::-1])
    pose = np.ascontiguousarray(transforms.inverse(view.optical_from_base))
    return shading._replace(robot=RobotTable(table, pose, ball, disc))


def paint_robot(
    shading: Shading, view: RobotView, world_from_base: Array, depth: Float32Array, linear: Float32Array
) -> None:
    """Draw the robot into light (h, w, 3) of the world, wherever it is before the world's ``depth`` (h, w) [m]."""
    if len(view.samples.pixel):
        poses = np.ascontiguousarray(world_from_base, np.float64), view.eye
        sunlit, level = _sunlit(shading, view.table, poses[0])
        paint_samples(view.samples, view.table, poses, sunlit, level, shading.light, shading.exposure, depth, linear)


def _sunlit(shading: Shading, table: Array, world_from_base: Array) -> tuple[Grid, float]:
    """Share of the sun that reaches a level above the robot, over x and y of base_link, and its height there [m]."""
    low = (table[:, 1:4] - table[:, 4:7]).min(axis=0) - _MARGIN
    high = (table[:, 1:4] + table[:, 4:7]).max(axis=0) + _MARGIN
    spacing = float(((high - low)[:2] / (np.array(_NODES) - 1)).max())
    x, y = (start + spacing * np.arange(count) for start, count in zip(low, _NODES, strict=False))
    level = float(high[2]) - _MARGIN + _ABOVE
    points = np.stack([*np.meshgrid(x, y, indexing="ij"), np.full(_NODES, level)], axis=-1).reshape(-1, 3)
    world = (points @ world_from_base[:3, :3].T + world_from_base[:3, 3]).astype(np.float32)
    disc = sun_disc(shading.light.sun, RADIUS_DEG, _SUN_RAYS)
    seen = visibility(shading.scene.still, world, None, disc, _ABOVE)
    for other in (shading.scene.plants, shading.scene.ground, shading.scene.moving):
        if other:
            seen *= visibility(other, world, None, disc, _ABOVE)
    return Grid(seen.reshape(_NODES), float(x[0]), float(y[0]), 1.0 / spacing), level
