# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot as its own sensors see it: the same in every scan and image, because they move with it.

Its boxes and cylinders are intersected exactly, in double precision and in base_link; see ``kernels.robot``.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Float32Array, Index
from fieldtruth.core.classes import Label
from fieldtruth.core.lenses import FLAT, directions
from fieldtruth.experiment.imaging_config import Imager
from fieldtruth.experiment.rig import Box, Cylinder, Rig, visible_parts
from fieldtruth.experiment.scanning_config import ScanningConfig
from fieldtruth.kernels.packets import LabelBuffers
from fieldtruth.kernels.robot import BOX, CYLINDER, FACES, HUB, NO_FACE, RobotSamples, Surface, meet_parts
from fieldtruth.world.model import ROBOT_ID

PAINT, RUBBER, METAL = range(3)
"""Materials."""
REFLECTANCE: Final = (0.05, 0.05, 0.20)
"""Of a LiDAR's light by material, all matt: paint and steel as ``iron`` and ``steel`` in reflectance.yaml, and rubber
as black as the paint (our choice)."""


def part_table(parts: Sequence[Box | Cylinder]) -> Array:
    """Rows (p, 7) as kernels take them: kind, centre and half the size along x, y and z [m]."""
    rows = []
    for part in parts:
        half = (part if isinstance(part, Box) else part.box).size / 2
        rows.append([BOX if isinstance(part, Box) else CYLINDER, *part.centre, *half])
    return np.array(rows, np.float64).reshape(-1, 7)


def meet(table: Array, origin: ArrayLike, directions: Array) -> Surface:
    """Trace rays from ``origin`` (3,) along unit ``directions`` (n, 3) in base_link; NaN directions meet nothing."""
    rays = np.ascontiguousarray(directions, np.float64)
    found = Surface(np.empty(len(rays)), np.empty(len(rays), np.int32), np.empty((len(rays), 3)))
    meet_parts(table, np.asarray(origin, np.float64), rays, found)
    return found


def material_of(table: Array, face: NDArray[np.int32]) -> NDArray[np.int32]:
    """Material (n,) of faces that were met."""
    part, own = np.divmod(face, FACES)
    wheel = np.where(own >= HUB, METAL, RUBBER)
    return np.where(table[part, 0] == BOX, PAINT, wheel).astype(np.int32)


class RobotScan:
    """The rays of a LiDAR, by ``column`` and ``ring`` (n,), that meet its robot, at ``range_m`` (n,) [m].

    ``material`` (n,) is PAINT, RUBBER or METAL, ``cosine`` (n,) that of the angle of incidence.
    """

    def __init__(self, parts: Sequence[Box | Cylinder], config: ScanningConfig, directions: Array) -> None:
        self._table, self._farthest = part_table(parts), config.max_range
        self._base_from_sensor = config.mount.base_from_sensor
        self.column: Index
        self.ring: Index
        self.aim(directions)

    def aim(self, directions: Array) -> None:
        """Trace rays in other unit ``directions`` (columns, rings, 3) in the LiDAR's frame."""
        rays = directions.reshape(-1, 3) @ self._base_from_sensor[:3, :3].T
        found = meet(self._table, self._base_from_sensor[:3, 3], rays)
        number = np.flatnonzero(found.range_m <= self._farthest)
        self.column, self.ring = np.divmod(number, directions.shape[1])
        self.range_m = found.range_m[number].astype(np.float32)
        self.material = material_of(self._table, found.face[number])
        self.cosine = np.abs((found.normal[number] * rays[number]).sum(axis=1))


EDGE_SAMPLES: Final = 4
"""Rays along each side of a pixel at an edge of the robot, for its photograph."""


class RobotView(NamedTuple):
    """The robot in a view. Threads may share it."""

    table: Array  # of part_table
    optical_from_base: Array
    eye: Array  # (3,) [m], the camera in base_link
    pixel: Index  # (n,) numbers of the pixels whose ray through the centre meets it
    depth: Float32Array  # (n,) [m] there
    normal: Float32Array  # (n, 3) unit, in the optical frame
    samples: RobotSamples


def robot_views(rig: Rig) -> dict[str, RobotView]:
    """The robot in the views of a rig's cameras, by name of the view; empty unless ``rig.visible``."""
    table = part_table(visible_parts(rig))
    return {imager.name: robot_view(table, imager) for imager in rig.imagers} if len(table) else {}


def robot_view(table: Array, imager: Imager) -> RobotView:
    """Trace the rays of all pixels, and more where neighbours see another face or none."""
    height, width = imager.config.height, imager.config.width
    centres = _points(table, imager, np.arange(width), np.arange(height)[:, None])
    face = centres.face.reshape(height, width)
    edge = maximum_filter(face, 3) != minimum_filter(face, 3)
    rows, columns = np.nonzero(edge)
    offsets = (np.arange(EDGE_SAMPLES) + 0.5) / EDGE_SAMPLES - 0.5
    right, down = (part.ravel() for part in np.meshgrid(offsets, offsets))
    finer = _points(table, imager, columns[:, None] + right, rows[:, None] + down)
    met, plain = np.flatnonzero(centres.face != NO_FACE), np.flatnonzero((face != NO_FACE) & ~edge)
    hit = np.flatnonzero(finer.face != NO_FACE)
    pixel = np.concatenate([plain, (rows * width + columns)[hit // len(right)]])
    order = np.argsort(pixel, kind="stable")

    def of_both(one: Array, more: Array) -> Float32Array:
        return np.concatenate([one[plain], more[hit]])[order].astype(np.float32)

    samples = RobotSamples(
        pixel[order].astype(np.int32),
        of_both(np.ones(len(face.flat)), np.full(len(finer.face), 1.0 / len(right))),
        of_both(centres.depth, finer.depth),
        of_both(centres.point, finer.point),
        of_both(centres.normal, finer.normal),
        material_of(table, np.concatenate([centres.face[plain], finer.face[hit]])[order]),
    )
    depth = centres.depth[met].astype(np.float32)
    pose = imager.base_from_optical
    normal = (centres.normal[met] @ pose[:3, :3]).astype(np.float32)
    return RobotView(table, transforms.inverse(pose), pose[:3, 3].copy(), met, depth, normal, samples)


class _Points(NamedTuple):
    """Hits of rays on the robot: face (n,), depth (n,) [m], point and normal (n, 3) in base_link."""

    face: NDArray[np.int32]
    depth: Array
    point: Array
    normal: Array


def _points(table: Array, imager: Imager, u: ArrayLike, v: ArrayLike) -> _Points:
    """Trace the rays through image points [pixel]; what is farther than the camera sees is nothing."""
    config, pose = imager.config, imager.base_from_optical
    lens = config.projection
    rays = directions(lens, u, v).reshape(-1, 3)
    along = rays @ pose[:3, :3].T
    range_m, face, normal = meet(table, pose[:3, 3], along)
    face[~(range_m <= config.far)] = NO_FACE
    with np.errstate(invalid="ignore"):
        depth = range_m * rays[:, 2] if lens.model in FLAT else range_m
        point = pose[:3, 3] + along * range_m[:, None]
    return _Points(face, depth, point, normal)


def hide_world(view: RobotView, labels: LabelBuffers) -> None:
    """Put the robot into label, instance, depth and normal images of the world, where it is in front."""
    world = labels.depth.reshape(-1)[view.pixel]
    seen = (world == 0.0) | (view.depth < world)
    pixel = view.pixel[seen]
    labels.label.reshape(-1)[pixel], labels.instance.reshape(-1)[pixel] = int(Label.ROBOT), ROBOT_ID
    labels.depth.reshape(-1)[pixel] = view.depth[seen]
    if labels.normal.image.size:
        labels.normal.image.reshape(-1, 3)[pixel] = view.normal[seen]
