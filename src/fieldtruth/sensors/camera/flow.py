# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Optical flow: how far each pixel's surface point has moved in the image when the camera takes the next one.

The point is that of the depth image. The world stands still, the robot moves with the camera, and the sky is infinitely
far. A ray from the next pose to the point finds whether something hides it there.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.core import frames, lenses
from fieldtruth.core.arrays import Array, Float32Array, Mask
from fieldtruth.kernels.compile import kernel
from fieldtruth.sense import embree
from fieldtruth.sense.packets import Packet, new_packet, set_ray
from fieldtruth.sense.robot_rays import meet
from fieldtruth.sense.robot_view import RobotView
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.pinhole import Pinhole, pinhole
from fieldtruth.sensors.camera.ray_table import ray_table

NEAR_M: Final = 1e-3
NEAR_SHARE: Final = 1e-4
"""What is in front of a point by less than ``NEAR_M`` and this share of the distance does not hide it: rays have single
precision."""

_BAND: Final = 32  # rows at once
_LANES, _WIDTH, _HEIGHT = embree.LANES, embree.TILE_WIDTH, embree.TILE_HEIGHT
_FAR = embree.TFAR
_occluded: Any = embree.occluded


class _Points(NamedTuple):
    """Points of a band of pixels in the next optical frame. Arrays are overwritten by the next band."""

    ray: Array  # (rows, w, 3) [m], of the sky of unit length; NaN where the lens has no ray
    distance: Array  # (rows, w) [m], infinite for the sky
    image: Array  # (rows, w, 2) [pixel], NaN where it is not in the image


class FlowSensor:
    """Optical flow of the images of a camera. Use one per thread: it owns its buffers."""

    def __init__(self, config: CameraConfig, scene: Scene) -> None:
        self._config, self._scene = config, scene
        self._lens, self._pinhole, self._table = config.projection, pinhole(config), ray_table(config)
        shape = (_BAND, config.width)
        self._points = _Points(np.empty((*shape, 3)), np.empty(shape), np.empty((*shape, 2)))
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
        moved = frames.inverse(world_from_next) @ world_from_optical
        own = np.zeros((1, 1), np.bool_) if of_robot is None else of_robot
        for top in range(0, height, _BAND):
            rows = slice(top, min(top + _BAND, height))
            points = _Points(*(each[: rows.stop - top] for each in self._points))
            _move(self._pinhole, self._table, moved, depth, own, top, points)
            if len(self._table):
                points.image[:] = lenses.project(self._lens, points.ray)
            if robot is not None:
                _hide_behind_robot(points, robot, own[rows])
            self._cut(points)
            _hide(self._scene.rays.handle, self._packet, world_from_next, self._config.far, points)
            flow[rows] = points.image - np.stack(np.meshgrid(np.arange(width), np.arange(top, rows.stop)), axis=-1)
        if self._lens.model == "equirectangular":
            around = 2.0 * np.pi * self._lens.fx
            flow[..., 0] -= (around * np.rint(flow[..., 0] / around)).astype(np.float32)
        if of_robot is not None:
            flow[of_robot & ~np.isnan(flow[..., 0])] = 0.0
        return flow

    def _cut(self, points: _Points) -> None:
        """Remove points outside the borders of the image's outermost pixels, and those beyond ``far``."""
        u, v = points.image[..., 0], points.image[..., 1]
        with np.errstate(invalid="ignore"):
            inside = (np.abs(u + 0.5 - self._config.width / 2) <= self._config.width / 2) & (
                np.abs(v + 0.5 - self._config.height / 2) <= self._config.height / 2
            )
            points.image[~inside | ((points.distance > self._config.far) & np.isfinite(points.distance))] = np.nan


@kernel
def _move(
    lens: Pinhole, table: Float32Array, moved: Array, depth: Float32Array, own: Mask, top: int, out: _Points
) -> None:
    """Take the points of a band from the depth image to the next optical frame, and into a pinhole's image."""
    rows, width = out.distance.shape
    moves = own.shape[0] > 1
    for row in range(rows):
        v = top + row
        for u in range(width):
            if len(table) > 0:
                x, y, z = float(table[v, u, 0]), float(table[v, u, 1]), float(table[v, u, 2])
                scale, share = 1.0, float(table[v, u, 3])
            else:
                x, y, z = (u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, 1.0
                scale, share = 1.0 / np.sqrt(x * x + y * y + 1.0), 1.0
            far_away = depth[v, u] == 0.0
            scale = scale if far_away else depth[v, u] / share
            x, y, z = x * scale, y * scale, z * scale
            if not (moves and own[v, u]):
                a = moved[0, 0] * x + moved[0, 1] * y + moved[0, 2] * z
                b = moved[1, 0] * x + moved[1, 1] * y + moved[1, 2] * z
                c = moved[2, 0] * x + moved[2, 1] * y + moved[2, 2] * z
                if not far_away:
                    a, b, c = a + moved[0, 3], b + moved[1, 3], c + moved[2, 3]
                x, y, z = a, b, c
            if share == 0.0:
                x, y, z = np.nan, np.nan, np.nan
            out.ray[row, u, 0], out.ray[row, u, 1], out.ray[row, u, 2] = x, y, z
            out.distance[row, u] = np.inf if far_away else np.sqrt(x * x + y * y + z * z)
            out.image[row, u, 0] = lens.fx * x / z + lens.cx if z > 0.0 else np.nan
            out.image[row, u, 1] = lens.fy * y / z + lens.cy if z > 0.0 else np.nan


def _hide_behind_robot(points: _Points, robot: RobotView, own: Mask) -> None:
    """Remove points of the world that the robot hides."""
    base_from_optical = frames.inverse(robot.optical_from_base)
    length = np.linalg.norm(points.ray, axis=-1, keepdims=True)
    along = (points.ray / length).reshape(-1, 3) @ base_from_optical[:3, :3].T
    range_m = meet(robot.table, robot.eye, along).range_m.reshape(own.shape)
    points.image[(range_m < points.distance) & ~own] = np.nan


@kernel
def _hide(scene: np.uint64, packet: Packet, pose: Array, far: float, points: _Points) -> None:
    """Remove points that are outside the image, beyond ``far`` or behind the world, seen from the next pose (4, 4)."""
    rows, width = points.distance.shape
    x0, y0, z0 = np.float32(pose[0, 3]), np.float32(pose[1, 3]), np.float32(pose[2, 3])
    for upper in range(0, rows, _HEIGHT):
        for left in range(0, width, _WIDTH):
            for lane in range(_LANES):
                row, u = upper + lane // _WIDTH, left + lane % _WIDTH
                packet.valid[lane] = 0
                if row >= rows or u >= width or np.isnan(points.image[row, u, 0]):
                    continue
                x, y, z = points.ray[row, u, 0], points.ray[row, u, 1], points.ray[row, u, 2]
                d = points.distance[row, u]
                is_sky = d == np.inf
                a = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z
                b = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z
                c = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z
                if not is_sky:  # towards the point from the origin in single precision
                    a, b, c = a + pose[0, 3] - x0, b + pose[1, 3] - y0, c + pose[2, 3] - z0
                scale = 1.0 / np.sqrt(a * a + b * b + c * c)
                reach = far if is_sky else min(d * (1.0 - NEAR_SHARE) - NEAR_M, far)
                set_ray(packet, lane, (x0, y0, z0), (a * scale, b * scale, c * scale), 0.0, max(reach, 0.0))
            _occluded(packet.valid.ctypes, scene, packet.ray.ctypes, packet.arguments.ctypes)
            for lane in range(_LANES):
                if packet.valid[lane] != 0 and packet.ray[_FAR + lane] < 0.0:
                    row, u = upper + lane // _WIDTH, left + lane % _WIDTH
                    points.image[row, u, 0], points.image[row, u, 1] = np.nan, np.nan
