# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What a view of a camera sees of the robot that carries it: the same in each image, as both move together."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from fieldtruth.core import frames
from fieldtruth.core.arrays import Array, Float32Array, Index
from fieldtruth.core.classes import Label
from fieldtruth.core.lenses import FLAT, directions
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_body import visible_parts
from fieldtruth.experiment.sensor_families import Imager
from fieldtruth.kernels.packets import LabelBuffers
from fieldtruth.kernels.robot import NO_FACE, RobotSamples
from fieldtruth.sense.robot_rays import material_of, meet, part_table
from fieldtruth.world.model import ROBOT_ID

EDGE_SAMPLES: Final = 4
"""Rays along each side of a pixel at an edge of the robot, for its photograph."""


class RobotView(NamedTuple):
    """What a view sees of the robot. Threads may share it."""

    table: Array  # of robot_rays.part_table
    optical_from_base: Array
    eye: Array  # (3,) [m], the camera in base_link
    pixel: Index  # (n,) numbers of the pixels whose ray through the centre meets it
    depth: Float32Array  # (n,) [m] there
    normal: Float32Array  # (n, 3) unit, in the optical frame
    samples: RobotSamples


def robot_views(rig: Rig) -> dict[str, RobotView]:
    """What the views of a rig's cameras see of its robot, by name of the view; empty unless ``rig.visible``."""
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
    return RobotView(table, frames.inverse(pose), pose[:3, 3].copy(), met, depth, normal, samples)


class _Points(NamedTuple):
    """What rays meet: face (n,), depth (n,) [m], point and normal (n, 3) in base_link."""

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
