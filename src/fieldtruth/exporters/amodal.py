# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Whole objects in an image, whatever hides them: their boxes, and how much of them is visible.

The silhouette of an object is the set of pixels whose rays, through their centres, meet it when it is alone.
"""

import threading
from collections.abc import Collection
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.bag.file import BagError
from fieldtruth.bag.run import Run
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.experiment.imaging_config import ImagingConfig
from fieldtruth.kernels.camera_rays import BLOCK, RayBatch, View, new_batch, trace
from fieldtruth.kernels.packets import MISS, IntArray, Packet, new_packet
from fieldtruth.sense.embree import Engine, RayScene
from fieldtruth.sense.lens import intrinsics_of, ray_table
from fieldtruth.world.boxes import faces_of, named_objects, outermost
from fieldtruth.world.build import world_of
from fieldtruth.world.model import Instance, World

NEAR: Final = 0.05
"""Distance [m] along the optical axis from which on an object counts for its box in the image: a camera may stand
among its branches."""

Labels = frozenset[int] | None
"""Classes of a part of an object; None for the whole."""


class Silhouette(NamedTuple):
    """An object, or a part, without what hides it."""

    pixels: int
    """In the image."""
    bbox: list[int]
    """x, y of the upper left pixel, width, height: of these pixels."""


def world_of_run(run: Run) -> World:
    """Return the world of a run.

    Raises:
        BagError: a bag from elsewhere, whose world is not known.
    """
    if run.experiment is None:
        raise BagError(f"{run.bag} has no experiment.yaml beside it, which says what its world is")
    return world_of(run.experiment)


class WholeObjects:
    """The objects of a world in the images of a camera. Threads may share it."""

    def __init__(self, world: World, config: ImagingConfig) -> None:
        self.world, self.objects = world, named_objects(world)
        self.config, self._lens, self._table = config, intrinsics_of(config), ray_table(config)
        self._engine, self._meshes = Engine(), dict[tuple[str, Labels], RayScene]()
        self._hulls: dict[tuple[str, Labels], Array] = {}
        self._own = threading.local()

    def silhouette(self, object_id: int, world_from_optical: Array, labels: Labels = None) -> Silhouette:
        """Pixels of an object, or of its faces of some classes, alone in the image from a pose (4, 4)."""
        instance = self.objects[object_id]
        alone = RayScene(self._engine)
        alone.add_instance(self._mesh(instance, labels), instance.world_from_object)
        alone.commit()
        left, top, right, bottom = self._region(instance, world_from_optical, labels)
        u, v = (each.ravel() for each in np.meshgrid(np.arange(left, right), np.arange(top, bottom)))
        view = View(np.ascontiguousarray(world_from_optical, np.float64), self._lens, self.config.far, self._table)
        tops: IntArray = np.zeros(1, np.int32)
        packet, batch = self._buffers()
        seen = np.zeros(len(u), np.bool_)
        for first in range(0, len(u), BLOCK):
            count = min(BLOCK, len(u) - first)
            batch.image[0, :count], batch.image[1, :count] = u[first:][:count], v[first:][:count]
            trace(alone.alone, tops, packet, view, batch, count)
            seen[first : first + count] = batch.top[:count] >= 0
        if not seen.any():
            return Silhouette(0, [0, 0, 0, 0])
        x, y = u[seen], v[seen]
        corner = int(x.min()), int(y.min())
        return Silhouette(int(seen.sum()), [*corner, int(x.max()) + 1 - corner[0], int(y.max()) + 1 - corner[1]])

    def bounds(self, object_id: int, world_from_optical: Array, labels: Labels = None) -> Array | None:
        """Box (4,) [pixel] of a whole object, or of its faces of some classes, on the plane of a pinhole's image.

        It is left, top, right, bottom, also beyond the image, with the centre of the first pixel at 0; None for an
        object that is nowhere ``NEAR`` in front of the camera.
        """
        instance = self.objects[object_id]
        optical_from_object = transforms.inverse(world_from_optical) @ instance.world_from_object
        points = transforms.transform(optical_from_object, self._hull(instance, labels))
        if points[:, 2].min() < NEAR:
            mesh = self.world.meshes[instance.mesh]
            faces = mesh.faces[faces_of(self.world, mesh, labels)]
            points = _in_front(transforms.transform(optical_from_object, mesh.vertices), faces)
        if not len(points):
            return None
        lens = self._lens
        u, v = lens.fx * points[:, 0] / points[:, 2] + lens.cx, lens.fy * points[:, 1] / points[:, 2] + lens.cy
        return np.array([u.min(), v.min(), u.max(), v.max()])

    def _buffers(self) -> tuple[Packet, RayBatch]:
        """Buffers of this thread."""
        own = vars(self._own)
        if not own:
            own |= {"packet": new_packet(coherent=True), "batch": new_batch(BLOCK)}
        return own["packet"], own["batch"]

    def _mesh(self, instance: Instance, labels: Labels) -> RayScene:
        key = instance.mesh, labels
        if key not in self._meshes:
            mesh, scene = self.world.meshes[instance.mesh], RayScene(self._engine)
            faces = mesh.faces.astype(np.uint32)
            faces[~faces_of(self.world, mesh, labels)] = MISS
            scene.add_mesh(mesh.vertices, faces)
            self._meshes[key] = scene.commit()
        return self._meshes[key]

    def _hull(self, instance: Instance, labels: Labels) -> Array:
        key = instance.mesh, labels
        if key not in self._hulls:
            mesh = self.world.meshes[instance.mesh]
            self._hulls[key] = outermost(mesh, None if labels is None else faces_of(self.world, mesh, labels))
        return self._hulls[key]

    def _region(self, instance: Instance, world_from_optical: Array, labels: Labels) -> tuple[int, int, int, int]:
        """Columns and rows, from and to, outside which the object has no pixels."""
        width, height = self.config.width, self.config.height
        hull = self._hull(instance, labels)
        points = transforms.transform(transforms.inverse(world_from_optical) @ instance.world_from_object, hull)
        if not len(self._table):
            if points[:, 2].min() < NEAR:
                return 0, 0, width, height
            low = points[:, :2] / points[:, 2:] * [self._lens.fx, self._lens.fy] + [self._lens.cx, self._lens.cy]
            (x0, y0), (x1, y1) = np.floor(low.min(axis=0)), np.ceil(low.max(axis=0)) + 1
            return _within(x0, width), _within(y0, height), _within(x1, width), _within(y1, height)
        middle = points.mean(axis=0)
        distance, radius = float(np.linalg.norm(middle)), float(np.linalg.norm(points - middle, axis=1).max())
        if distance <= radius:
            return 0, 0, width, height
        near = (
            self._table[..., :3] @ (middle / distance).astype(np.float32)
            > np.sqrt(1.0 - (radius / distance) ** 2) - 1e-5
        )
        rows, columns = np.flatnonzero(near.any(axis=1)), np.flatnonzero(near.any(axis=0))
        if not len(rows):
            return 0, 0, 0, 0
        return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


def _within(value: float, most: int) -> int:
    return int(np.clip(value, 0, most))


def _in_front(points: Array, faces: IntArray) -> Array:
    """Corners (n, 3) of what of the triangles is at least NEAR in front of the camera."""
    used = np.unique(faces)
    ahead = points[used[points[used, 2] >= NEAR]]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    start, end = points[edges[:, 0]], points[edges[:, 1]]
    crosses = (start[:, 2] < NEAR) != (end[:, 2] < NEAR)
    start, end = start[crosses], end[crosses]
    share = ((NEAR - start[:, 2]) / (end[:, 2] - start[:, 2]))[:, None]
    return np.concatenate([ahead, start + share * (end - start)])


def clipped(bounds: Array, width: int, height: int) -> Array:
    """Part (4,) of a box [pixel] inside the outer borders of an image."""
    return np.asarray(np.clip(bounds, -0.5, np.array([width, height, width, height]) - 0.5))


def area(bounds: Array) -> float:
    """Area [pixel²] of a box (4,)."""
    return float((bounds[2] - bounds[0]) * (bounds[3] - bounds[1]))


def visible_pixels(instance: Counts, ids: Collection[int]) -> dict[int, int]:
    """Number of pixels in an image (h, w) of instance ids, of each of ``ids`` that has any."""
    numbers, counts = np.unique(instance, return_counts=True)
    return {int(n): int(c) for n, c in zip(numbers, counts, strict=True) if int(n) in ids}
