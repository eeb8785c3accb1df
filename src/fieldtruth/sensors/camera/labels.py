# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Labels, instances, depth, normals and optical flow: from the rays through the centres of the pixels.

Optical flow: how far each pixel's surface point has moved in the image when the camera takes the next one. The point is
that of the depth image. The world stands still, bodies that move and plants that lean take their points with them, the
robot moves with the camera, and the sky is infinitely far. A ray from the next pose to the point finds whether
something hides it there.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core import lenses, transforms
from fieldtruth.core.arrays import Array, Float32Array, Index, Mask
from fieldtruth.core.classes import CLASSES, ClassTable, Label
from fieldtruth.experiment.imaging_config import ImagingConfig
from fieldtruth.kernels.camera import FlowPoints, hide_points, move_points
from fieldtruth.kernels.camera_rays import BLOCK, View, label_image, new_batch, trace
from fieldtruth.kernels.light import SHADOW_RANGE
from fieldtruth.kernels.packets import NO_NORMALS, LabelBuffers, NormalBuffers, new_packet
from fieldtruth.sense.interval import Interval
from fieldtruth.sense.lens import intrinsics_of, ray_table
from fieldtruth.sense.robot import RobotView, hide_world, meet
from fieldtruth.sense.scene import Scene, by_top

_BAND: Final = 32  # rows of which the flow is computed at once


def _hide_behind_robot(points: FlowPoints, robot: RobotView, own: Mask) -> None:
    """Remove points of the world that the robot hides."""
    base_from_optical = transforms.inverse(robot.optical_from_base)
    length = np.linalg.norm(points.ray, axis=-1, keepdims=True)
    along = (points.ray / length).reshape(-1, 3) @ base_from_optical[:3, :3].T
    range_m = meet(robot.table, robot.eye, along).range_m.reshape(own.shape)
    points.image[(range_m < points.distance) & ~own] = np.nan


@dataclass(frozen=True, kw_only=True)
class LabelImages:
    """Class id ``label``, instance id ``instance`` and ``depth`` [m] per pixel, each (h, w).

    Depth is measured along the optical axis; by ``equidistant`` and ``equirectangular`` lenses, which see beyond 90 deg
    from it, along the ray. Sky has depth 0 and instance id 0, and so have pixels for which the lens has no ray.
    """

    label: NDArray[np.uint8]
    instance: NDArray[np.uint32]
    depth: Float32Array
    normal: Float32Array = field(default_factory=lambda: NO_NORMALS.image)
    """(h, w, 3) unit normal of the triangle, towards the camera, in the optical frame; 0 where depth is. It has no
    pixels unless the camera's ``normals`` are on."""
    part: NDArray[np.uint8] = field(default_factory=lambda: np.zeros((0, 0), np.uint8))
    """(h, w) ``PlantPart``; it has no pixels unless the camera's ``parts`` are on."""
    top: NDArray[np.uint32] = field(default_factory=lambda: np.zeros((0, 0), np.uint32))
    """(h, w) Row in ``Scene.top_levels`` and 1 more; it has no pixels unless the camera's ``passability`` is on."""


Images = TypeVar("Images", bound=LabelImages)


class LabelCamera:
    """A camera that returns labels only. Use one per thread: each owns its buffers.

    The origin is the optical frame of REP-103: x right, y down, z forward. The ray of pixel (row v, column u) passes
    through the pixel's centre in the direction ((u - cx) / fx, (v - cy) / fy, 1); with a lens other than the pinhole,
    in the direction that the lens images on the pixel's centre. Surfaces farther along the ray than ``far`` are sky.
    There is no noise or exposure time. With ``reuse`` each call overwrites the arrays that the previous call returned,
    which saves a tenth of the time (measured) in long sequences.
    """

    def __init__(self, config: ImagingConfig, scene: Scene, *, reuse: bool = False) -> None:
        self.config = config
        self.scene = scene
        self.intrinsics = intrinsics_of(config)
        self._table = ray_table(config)
        self._reuse = reuse
        self._packet, self._batch = new_packet(coherent=True), new_batch(BLOCK, normals=config.normals)
        axes = [top.world_from_object[:3, :3] for top in scene.top_levels]
        self._axes = np.array(axes * config.normals).reshape(-1, 3, 3)
        self._codes = scene.part_codes if config.parts else None
        self._hits = scene.hits if self._codes is None else self._codes.hits
        if config.passability:
            self._hits = by_top(self._hits)
        self.last: LabelImages | None = None
        """The images that the next call overwrites, of a camera with ``reuse``."""

    def label(self, world_from_optical: Array, robot: RobotView | None = None, stamp_ns: int = 0) -> LabelImages:
        """Label, instance and depth images from a pose (4, 4), with what the view sees of the robot.

        The stamp matters where bodies move.
        """
        images = self._own_images()
        out = self._buffers(images)
        view, interval = self._view(world_from_optical), self._interval(world_from_optical, stamp_ns, stamp_ns)
        label_image(interval.rays, self._hits, self._packet, view, self._batch, out)
        if robot is not None:
            hide_world(robot, out)
        return self._decoded(images)

    def _decoded(self, images: Images) -> Images:
        """Return images whose classes and instance ids, which were codes and rows, are these and what the codes say."""
        if self._codes is not None:
            images.part[:] = self._codes.decode(images.label)
        if self.config.passability:
            images.top[:] = images.instance
            np.take(self.scene.owners, images.top, out=images.instance)
        return images

    def flow(
        self,
        images: LabelImages,
        world_from_optical: Array,
        world_from_next: Array,
        robot: RobotView | None = None,
        stamps_ns: tuple[int, int] = (0, 0),
    ) -> Float32Array:
        """Optical flow (h, w, 2) [pixel] to the right and down from these images to the view's next pose.

        It is NaN where the next image does not show the point: outside the image, hidden, or beyond ``far``. Across the
        seam of a whole panorama it takes the shorter direction. What the view sees of the robot moves with it: its flow
        is 0, also that of wheels, which look the same however they have turned.

        Args:
            images: of the pose ``world_from_optical``.
            world_from_optical: (4, 4).
            world_from_next: (4, 4).
            robot: what the view sees of it.
            stamps_ns: of both poses, where bodies move.
        """
        later = self._interval(world_from_next, stamps_ns[1], stamps_ns[1])
        lens, (height, width) = self.config.projection, images.depth.shape
        shape = (_BAND, width)
        band = FlowPoints(np.empty((*shape, 3)), np.empty(shape), np.empty((*shape, 2)))
        flow = np.empty((height, width, 2), np.float32)
        moved = transforms.inverse(world_from_next) @ world_from_optical
        own = np.zeros((1, 1), np.bool_) if robot is None else images.label == int(Label.ROBOT)
        for top in range(0, height, _BAND):
            rows = slice(top, min(top + _BAND, height))
            points = FlowPoints(*(each[: rows.stop - top] for each in band))
            move_points(self.intrinsics, self._table, moved, images.depth, own, top, points)
            if self.scene.moves:
                poses = np.stack([world_from_optical, world_from_next])
                self._move_along(points, images.instance[rows], top, poses, stamps_ns)
            if len(self._table):
                points.image[:] = lenses.project(lens, points.ray)
            if robot is not None:
                _hide_behind_robot(points, robot, own[rows])
            self._cut(points)
            hide_points(later.rays, self._packet, world_from_next, self.config.far, points)
            flow[rows] = points.image - np.stack(np.meshgrid(np.arange(width), np.arange(top, rows.stop)), axis=-1)
        if lens.model == "equirectangular":
            around = 2.0 * np.pi * lens.fx
            flow[..., 0] -= (around * np.rint(flow[..., 0] / around)).astype(np.float32)
        if robot is not None:
            flow[own & ~np.isnan(flow[..., 0])] = 0.0
        return flow

    def _move_along(
        self, points: FlowPoints, instance: NDArray[np.uint32], top: int, poses: Array, stamps_ns: tuple[int, int]
    ) -> None:
        """Put points of what moves, whose pixels are traced again, where their triangles are at the next stamp."""
        scene, batch, bodies = self.scene, self._batch, len(self.scene.moving)
        rows, columns = np.nonzero(np.isin(instance, self._movers))
        if not len(rows):
            return
        now, view = self._interval(poses[0], stamps_ns[0], stamps_ns[0]), self._view(poses[0])
        for start in range(0, len(rows), BLOCK):
            v, u = rows[start : start + BLOCK], columns[start : start + BLOCK]
            batch.image[0, : len(u)], batch.image[1, : len(u)] = u, v + top
            trace(now.rays, scene.hits.geometry_top, self._packet, view, batch, len(u))
            number = batch.mover[: len(u)].copy()
            for k in np.unique(number[(number >= 0) & (number < bodies)]):
                at, body = np.flatnonzero(number == k), scene.moving[k].body
                corners = body.mesh.vertices[body.mesh.faces[batch.primitive[at]]].astype(np.float64)
                share = batch.barycentric[:, at].astype(np.float64)
                weights = np.stack([1.0 - share.sum(axis=0), *share])
                optical_from_body = transforms.inverse(poses[1]) @ body.at(stamps_ns[1])[0]
                ray = transforms.transform(optical_from_body, np.einsum("kn,nkj->nj", weights, corners))
                self._put(points, (v[at], u[at]), ray)
            if scene.plants is not None and (number >= bodies).any():
                at = np.flatnonzero(number >= bodies)
                along = scene.plants.moved(number[at].astype(np.intp) - bodies, stamps_ns)
                moved = np.asarray(transforms.inverse(poses[1]) @ along @ poses[1])
                ray = points.ray[v[at], u[at]]
                self._put(points, (v[at], u[at]), np.einsum("nij,nj->ni", moved[:, :3, :3], ray) + moved[:, :3, 3])

    def _put(self, points: FlowPoints, pixel: tuple[Index, Index], ray: Array) -> None:
        """Put the points of pixels at the ends of rays (n, 3) [m] in the next optical frame."""
        points.ray[pixel], points.distance[pixel] = ray, np.linalg.norm(ray, axis=1)
        points.image[pixel] = lenses.project(self.config.projection, ray)

    @cached_property
    def _movers(self) -> Index:
        """Instance ids of what moves."""
        plants, ids = self.scene.plants, [each.body.object_id for each in self.scene.moving]
        own = np.zeros(0, np.intp) if plants is None else plants.leaning.plants.object_id[plants.leaning.rows]
        return np.unique(np.append(np.array(ids, np.intp), own))

    def _interval(self, world_from_optical: Array, begin_ns: int, end_ns: int) -> Interval:
        """Return what moves, as far away as the camera sees or a shadow reaches into its images."""
        return self.scene.interval(begin_ns, end_ns, world_from_optical[:3, 3], self.config.far + SHADOW_RANGE)

    def _cut(self, points: FlowPoints) -> None:
        """Remove points outside the borders of the image's outermost pixels, and those beyond ``far``."""
        u, v, config = points.image[..., 0], points.image[..., 1], self.config
        with np.errstate(invalid="ignore"):
            inside = np.abs(u + 0.5 - config.width / 2) <= config.width / 2
            inside &= np.abs(v + 0.5 - config.height / 2) <= config.height / 2
            points.image[~inside | ((points.distance > config.far) & np.isfinite(points.distance))] = np.nan

    def _own_images(self) -> LabelImages:
        """Return arrays of images, new ones unless they are reused."""
        images = self.last or self._new_images()
        self.last = images if self._reuse else None
        return images

    def _new_images(self) -> LabelImages:
        h, w = self.config.height, self.config.width
        normal = np.empty((h * self.config.normals, w, 3), np.float32)  # without pixels if none are wanted
        return LabelImages(
            label=np.empty((h, w), np.uint8),
            instance=np.empty((h, w), np.uint32),
            depth=np.empty((h, w), np.float32),
            normal=normal,
            part=np.empty((h * self.config.parts, w), np.uint8),
            top=np.empty((h * self.config.passability, w), np.uint32),
        )

    def _buffers(self, images: LabelImages) -> LabelBuffers:
        return LabelBuffers(images.label, images.instance, images.depth, NormalBuffers(images.normal, self._axes))

    def _view(self, world_from_optical: Array, time: float = 0.0) -> View:
        pose = np.ascontiguousarray(world_from_optical, np.float64)
        return View(pose, self.intrinsics, self.config.far, self._table, time)


def tag_image(label: NDArray[np.uint8], classes: ClassTable = CLASSES) -> NDArray[np.uint8]:
    """Tag image (h, w, 3): the flat colour of each class id (h, w)."""
    return np.take(classes.palette, label, axis=0)  # five times as fast as palette[label], which holds the GIL
