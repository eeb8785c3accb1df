# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Whole objects in an image, whatever hides them: their boxes, and how much of them is visible.

The silhouette of an object is the set of pixels whose rays, through their centres, meet it when it is alone.
"""

import threading
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.bodies import moving_in
from fieldtruth.bag.run import Run
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.imaging_config import ImagingConfig
from fieldtruth.kernels.camera_rays import BLOCK, RayBatch, View, new_batch, trace
from fieldtruth.kernels.packets import MISS, IntArray, Packet, new_packet
from fieldtruth.local_maps import world_of_run
from fieldtruth.sense.embree import Engine, RayScene
from fieldtruth.sense.interval import STILL, Moving
from fieldtruth.sense.leaning import WHOLE, square
from fieldtruth.sense.lens import intrinsics_of, ray_table
from fieldtruth.sense.limbs import faces_of_piece
from fieldtruth.world.boxes import faces_of, named_objects, outermost
from fieldtruth.world.model import Mesh, World

NEAR: Final = 0.05
"""Distance [m] along the optical axis from which on an object counts for its box in the image: a camera may stand
among its branches."""

Labels = frozenset[int] | None
"""Classes of a part of an object; None for the whole."""
Part = tuple[Mesh, Array]
"""A rigid part of an object, and its world_from_mesh (4, 4)."""


class Silhouette(NamedTuple):
    """An object, or a part, without what hides it."""

    pixels: int
    """In the image."""
    bbox: list[int]
    """x, y of the upper left pixel, width, height: of these pixels."""


def moving_world_of_run(run: Run) -> tuple[World, Moving]:
    """Return the world of a run, and what moves in it; raises as ``world_of_run``."""
    world, made = world_of_run(run), run.experiment
    return (world, STILL) if made is None else moving_in(world, run, made)


class WholeObjects:
    """The objects of a world, and what moves in it, in the images of a camera. Threads may share it."""

    def __init__(self, world: World, config: ImagingConfig, moving: Moving = STILL) -> None:
        self._leaning, self._rows = (leaning := moving.leaning), dict[int, list[int]]()
        self._pieces: dict[tuple[str, int], Mesh] = {}
        if leaning is not None:
            plants, rows = leaning.plants, leaning.rows
            for row in rows[(plants.bunch[rows] < 0) | (plants.parent[rows] >= 0)].tolist():  # clumps are no objects
                self._rows.setdefault(int(plants.object_id[row]), []).append(row)
        self.world, self.objects, self._bodies = world, named_objects(world), moving.bodies
        self.config, self._lens, self._table = config, intrinsics_of(config), ray_table(config)
        self._engine, self._meshes = Engine(), dict[tuple[str, Labels], RayScene]()
        self._hulls: dict[tuple[str, Labels], Array] = {}
        self._own = threading.local()

    def parts(self, object_id: int, stamp_ns: int = 0) -> list[Part]:
        """Return the meshes of an object, each with its world_from_mesh (4, 4) at a stamp [ns]."""
        if object_id in self.objects:
            instance = self.objects[object_id]
            if self._leaning is None or object_id not in self._rows:
                return [(self.world.meshes[instance.mesh], instance.world_from_object)]
            rows = np.array(self._rows[object_id])
            poses = square(self._leaning.at(rows, np.array([stamp_ns])))[0]
            pieces = self._leaning.plants.bunch[rows].tolist()
            return [(self._piece(instance.mesh, own), pose) for own, pose in zip(pieces, poses, strict=True)]
        return [(each.mesh, each.at([stamp_ns])[0]) for each in self._bodies if each.object_id == object_id]

    def silhouette(
        self, object_id: int, world_from_optical: Array, labels: Labels = None, stamp_ns: int = 0
    ) -> Silhouette:
        """Pixels of an object, or of its faces of some classes, alone in the image from a pose (4, 4) at a stamp."""
        parts = self.parts(object_id, stamp_ns)
        alone = RayScene(self._engine)
        for mesh, world_from_mesh in parts:
            alone.add_instance(self._mesh(mesh, labels), world_from_mesh)
        alone.commit()
        left, top, right, bottom = self._region(parts, world_from_optical, labels)
        u, v = (each.ravel() for each in np.meshgrid(np.arange(left, right), np.arange(top, bottom)))
        view = View(np.ascontiguousarray(world_from_optical, np.float64), self._lens, self.config.far, self._table)
        tops: IntArray = np.zeros(len(parts), np.int32)
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

    def bounds(
        self, object_id: int, world_from_optical: Array, labels: Labels = None, stamp_ns: int = 0
    ) -> Array | None:
        """Box (4,) [pixel] of a whole object, or of its faces of some classes, on the plane of a pinhole's image.

        It is left, top, right, bottom, also beyond the image, with the centre of the first pixel at 0; None for an
        object that is nowhere ``NEAR`` in front of the camera.
        """
        seen, optical_from_world = [], transforms.inverse(world_from_optical)
        for mesh, world_from_mesh in self.parts(object_id, stamp_ns):
            points = transforms.transform(optical_from_world @ world_from_mesh, self._hull(mesh, labels))
            if points[:, 2].min(initial=np.inf) < NEAR:
                faces = mesh.faces[faces_of(self.world, mesh, labels)]
                points = _in_front(transforms.transform(optical_from_world @ world_from_mesh, mesh.vertices), faces)
            seen.append(points)
        points = np.concatenate(seen)
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

    def _piece(self, name: str, piece: int) -> Mesh:
        """Return a mesh, or only its trunk or some of its limbs."""
        mesh = self.world.meshes[name]
        if piece != WHOLE and (name, piece) not in self._pieces:
            own = faces_of_piece(mesh, piece)
            faces, material = mesh.faces[own], mesh.material[own]
            bare = replace(mesh, part=None, limb=None, joints=None)
            part = replace(bare, name=f"{name} {piece}", faces=faces, material=material)
            self._pieces[name, piece] = part
        return mesh if piece == WHOLE else self._pieces[name, piece]

    def _mesh(self, mesh: Mesh, labels: Labels) -> RayScene:
        key = mesh.name, labels
        if key not in self._meshes:
            scene, faces = RayScene(self._engine), mesh.faces.astype(np.uint32)
            faces[~faces_of(self.world, mesh, labels)] = MISS
            scene.add_mesh(mesh.vertices, faces)
            self._meshes[key] = scene.commit()
        return self._meshes[key]

    def _hull(self, mesh: Mesh, labels: Labels) -> Array:
        key = mesh.name, labels
        if key not in self._hulls:
            self._hulls[key] = outermost(mesh, None if labels is None else faces_of(self.world, mesh, labels))
        return self._hulls[key]

    def _region(self, parts: Sequence[Part], world_from_optical: Array, labels: Labels) -> tuple[int, int, int, int]:
        """Columns and rows, from and to, outside which the object has no pixels."""
        width, height = self.config.width, self.config.height
        hulls = [transforms.transform(world_from_mesh, self._hull(mesh, labels)) for mesh, world_from_mesh in parts]
        points = transforms.transform(transforms.inverse(world_from_optical), np.concatenate(hulls))
        if not len(points):
            return 0, 0, 0, 0
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


def visible_pixels(instance: NDArray[Any] | None, ids: Collection[int]) -> dict[int, int]:
    """Number of pixels in an image (h, w), or points, of instance ids, of each of ``ids`` that has any."""
    if instance is None:
        return {}
    numbers, counts = np.unique(instance, return_counts=True)
    return {int(n): int(c) for n, c in zip(numbers, counts, strict=True) if int(n) in ids}
