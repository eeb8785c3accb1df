# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Where Gazebo's scans and images differ from ours, and which of these beams and pixels lie on an edge of our world."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from fieldtruth.core import frames
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.classes import PALETTE
from fieldtruth.experiment.rig import CAMERA_FROM_OPTICAL, CameraConfig, LidarConfig
from fieldtruth.sense.label_camera import LabelCamera
from fieldtruth.sense.lidar import Lidar, ray_directions
from fieldtruth.sense.pinhole import Pinhole, pinhole
from fieldtruth.sense.scene import Scene

RANGE: Final = 0.005
"""Largest difference [m] of two ranges that are equal."""
NEARBY: Final = 5e-5
"""Angle [rad] within which a beam that has an edge beside it grazes that edge: 0.5 mm at 10 m."""
SUBPIXELS: Final = 3
"""Rays along each side of every pixel that look for silhouettes in it."""
FINE: Final = 32
"""Rays along each side of the pixels about one that differs, where the others have met no silhouette: the tip of a
blade or a twig between leaves may be thinner."""

MOST: Final = 1000
"""Pixels of an image that are looked at so closely."""


class Beams(NamedTuple):
    """A scan of every beam, both (columns, rings): range [m], infinite without a return, and class id, 0 without."""

    range_m: Array
    label: Array

    def errors(self, other: "Beams") -> Array:
        """Differences of range [m], 0 where both have no return, infinite where one has none."""
        both = np.isfinite(self.range_m) & np.isfinite(other.range_m)
        apart = np.isfinite(self.range_m) != np.isfinite(other.range_m)
        mine, others = (np.where(both, beams.range_m, 0.0) for beams in (self, other))
        return np.where(apart, np.inf, mine - others)

    def differ(self, other: "Beams") -> Mask:
        """Beams whose ranges differ by more than ``RANGE``, or whose classes differ."""
        return np.asarray((np.abs(self.errors(other)) > RANGE) | (self.label != other.label))


class ScanComparison(NamedTuple):
    """A scan of Gazebo beside ours: beams that differ, and beams of ours that graze an edge, (columns, rings).

    A beam grazes an edge if two beams that are turned from it by ``NEARBY`` in opposite directions differ in class, or
    if the mean of their ranges differs from its own by more than ``RANGE``, as it does not on a plane.
    """

    ours: Beams
    gazebo: Beams
    differ: Mask
    grazing: Mask


def compare_scan(scene: Scene, config: LidarConfig, world_from_lidar: Array, gazebo: Beams) -> ScanComparison:
    """Compare Gazebo's beams with ours from the same pose."""
    lidar = Lidar(config, scene)
    ours = _beams(lidar, world_from_lidar)
    grazing = np.zeros(ours.label.shape, np.bool_)
    for turned in _nearby_poses(config, world_from_lidar):
        first, second = (_beams(lidar, poses) for poses in turned)
        grazing |= (first.label != ours.label) | (second.label != ours.label)
        to_first, to_second = first.errors(ours), second.errors(ours)
        grazing |= ~(np.abs(to_first + to_second) <= 2 * RANGE)
    return ScanComparison(ours, gazebo, ours.differ(gazebo), grazing)


def _beams(lidar: Lidar, pose: Array) -> Beams:
    scan, shape = lidar.scan(pose), (lidar.config.columns, lidar.config.rings)
    beams = Beams(np.full(shape, np.inf), np.zeros(shape))
    beams.range_m[scan.column, scan.ring], beams.label[scan.column, scan.ring] = scan.range_m, scan.label
    return beams


def _nearby_poses(config: LidarConfig, world_from_lidar: Array) -> list[tuple[Array, Array]]:
    """Pairs of poses by column (columns, 4, 4) that turn each beam by ``NEARBY`` in opposite directions."""
    angle = np.degrees(NEARBY)
    azimuths = np.degrees(np.arctan2(*ray_directions(config)[:, 0, 1::-1].T))
    turns = [frames.pose((0, 0, 0), (0, 0, azimuth)) for azimuth in azimuths]

    def turned(up: int, left: int) -> Array:
        small = frames.pose((0, 0, 0), (0, -up * angle, left * angle))
        return np.array([world_from_lidar @ turn @ small @ frames.inverse(turn) for turn in turns])

    return [(turned(up, left), turned(-up, -left)) for up, left in ((1, 0), (0, 1), (1, 1), (1, -1))]


class ImageComparison(NamedTuple):
    """A plain image of Gazebo beside our tag image: pixels that differ, those at most 2 pixels from a silhouette."""

    ours: NDArray[np.uint8]
    gazebo: NDArray[np.uint8]
    differ: Mask
    near_silhouette: Mask


def compare_image(
    scene: Scene, config: CameraConfig, world_from_camera: Array, gazebo: NDArray[np.uint8]
) -> ImageComparison:
    """Compare Gazebo's plain image with our tag image; the pose is that of the rig's camera frame.

    A silhouette runs between two of a pixel's ``SUBPIXELS`` x ``SUBPIXELS`` rays that meet different classes.
    """
    world_from_optical = world_from_camera @ CAMERA_FROM_OPTICAL
    ours = PALETTE[LabelCamera(config, scene).label(world_from_optical).label]
    fine = config.model_copy(update={"width": config.width * SUBPIXELS, "height": config.height * SUBPIXELS})
    label = LabelCamera(fine, scene).label(world_from_optical).label
    edge = np.zeros(label.shape, np.bool_)
    edge[:, :-1] |= label[:, :-1] != label[:, 1:]
    edge[:-1] |= label[:-1] != label[1:]
    silhouette: Mask = np.any(edge.reshape(config.height, SUBPIXELS, config.width, SUBPIXELS), axis=(1, 3))
    near: Mask = binary_dilation(silhouette, np.ones((3, 3), np.bool_), iterations=2)
    differ: Mask = np.any(ours != gazebo, axis=-1)
    for row, column in np.argwhere(differ & ~near)[:MOST].tolist():
        near[row, column] = _has_silhouette(scene, config, world_from_optical, row, column)
    return ImageComparison(ours, gazebo, differ, near)


def _has_silhouette(scene: Scene, config: CameraConfig, world_from_optical: Array, row: int, column: int) -> bool:
    """Whether rays through the 5 x 5 pixels about a pixel, ``FINE`` x ``FINE`` through each, meet two classes."""
    side = 5 * FINE
    camera = LabelCamera(config.model_copy(update={"width": side, "height": side}), scene)
    fx, fy, cx, cy = pinhole(config)
    to_row, to_column = ((at - 2.5) * FINE + 0.5 for at in (row, column))
    camera.pinhole = Pinhole(fx * FINE, fy * FINE, cx * FINE - to_column, cy * FINE - to_row)
    return len(np.unique(camera.label(world_from_optical).label)) > 1
