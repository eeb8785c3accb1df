# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Optical flow: how far each pixel's surface point has moved in the image when the camera takes the next one.

The point is that of the depth image. The world stands still, the robot moves with the camera, and the sky is infinitely
far. A ray from the next pose to the point finds whether something hides it there.
"""

from typing import Final

import numpy as np

from fieldtruth.core import lenses, transforms
from fieldtruth.core.arrays import Array, Float32Array, Mask
from fieldtruth.experiment.sensor_families import ImagingConfig
from fieldtruth.kernels.camera import FlowPoints, hide_points, move_points
from fieldtruth.kernels.packets import new_packet
from fieldtruth.sense.robot import RobotView, meet
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.pinhole import pinhole
from fieldtruth.sensors.camera.ray_table import ray_table

_BAND: Final = 32  # rows at once


class FlowSensor:
    """Optical flow of the images of a camera. Use one per thread: it owns its buffers."""

    def __init__(self, config: ImagingConfig, scene: Scene) -> None:
        self._config, self._scene = config, scene
        self._lens, self._pinhole, self._table = config.projection, pinhole(config), ray_table(config)
        shape = (_BAND, config.width)
        self._points = FlowPoints(np.empty((*shape, 3)), np.empty(shape), np.empty((*shape, 2)))
        self._packet = new_packet(coherent=True)

    def between(
        self,
        depth: Float32Array,
        world_from_optical: Array,
        world_from_next: Array,
        robot: RobotView | None = None,
        of_robot: Mask | None = None,
    ) -> Float32Array:
        """Flow (h, w, 2) [pixel] to the right and down from one pose (4, 4) to the next.

        It is NaN where the next image does not show the point: outside the image, hidden, or beyond ``far``. Across the
        seam of a whole panorama it takes the shorter direction. What the view sees of the robot, pixels ``of_robot``
        (h, w), moves with it: its flow is 0, also that of wheels, which look the same however they have turned.
        """
        height, width = depth.shape
        flow = np.empty((height, width, 2), np.float32)
        moved = transforms.inverse(world_from_next) @ world_from_optical
        own = np.zeros((1, 1), np.bool_) if of_robot is None else of_robot
        for top in range(0, height, _BAND):
            rows = slice(top, min(top + _BAND, height))
            points = FlowPoints(*(each[: rows.stop - top] for each in self._points))
            move_points(self._pinhole, self._table, moved, depth, own, top, points)
            if len(self._table):
                points.image[:] = lenses.project(self._lens, points.ray)
            if robot is not None:
                _hide_behind_robot(points, robot, own[rows])
            self._cut(points)
            hide_points(self._scene.rays.handle, self._packet, world_from_next, self._config.far, points)
            flow[rows] = points.image - np.stack(np.meshgrid(np.arange(width), np.arange(top, rows.stop)), axis=-1)
        if self._lens.model == "equirectangular":
            around = 2.0 * np.pi * self._lens.fx
            flow[..., 0] -= (around * np.rint(flow[..., 0] / around)).astype(np.float32)
        if of_robot is not None:
            flow[of_robot & ~np.isnan(flow[..., 0])] = 0.0
        return flow

    def _cut(self, points: FlowPoints) -> None:
        """Remove points outside the borders of the image's outermost pixels, and those beyond ``far``."""
        u, v = points.image[..., 0], points.image[..., 1]
        with np.errstate(invalid="ignore"):
            inside = (np.abs(u + 0.5 - self._config.width / 2) <= self._config.width / 2) & (
                np.abs(v + 0.5 - self._config.height / 2) <= self._config.height / 2
            )
            points.image[~inside | ((points.distance > self._config.far) & np.isfinite(points.distance))] = np.nan


def _hide_behind_robot(points: FlowPoints, robot: RobotView, own: Mask) -> None:
    """Remove points of the world that the robot hides."""
    base_from_optical = transforms.inverse(robot.optical_from_base)
    length = np.linalg.norm(points.ray, axis=-1, keepdims=True)
    along = (points.ray / length).reshape(-1, 3) @ base_from_optical[:3, :3].T
    range_m = meet(robot.table, robot.eye, along).range_m.reshape(own.shape)
    points.image[(range_m < points.distance) & ~own] = np.nan
