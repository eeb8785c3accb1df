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
from fieldtruth.sense.scene import Scene

RANGE: Final = 0.005
"""Largest difference [m] of two ranges that are equal."""
NEARBY: Final = 5e-5
"""Angle [rad] within which a beam that has an edge beside it grazes that edge: 0.5 mm at 10 m."""
SUBPIXELS: Final = 3
"""Rays along each side of a pixel that look for silhouettes in it."""


class Beams(NamedTuple):
    """A scan of every beam, both (columns, rings): range [m], infinite without a return, and class id, 0 without."""

    range_m: Array
    label: Array

    def differ(self, other: "Beams") -> Mask:
        """Beams whose ranges differ by more than ``RANGE``, or whose classes differ."""
        both = np.isfinite(self.range_m) & np.isfinite(other.range_m)
        apart = np.isfinite(self.range_m) != np.isfinite(other.range_m)
        apart[both] = np.abs(self.range_m - other.range_m, where=both, out=np.zeros(both.shape))[both] > RANGE
        return np.asarray(apart | (both & (self.label != other.label)))


class ScanComparison(NamedTuple):
    """A scan of Gazebo beside ours: beams that differ, and beams of ours that graze an edge, (columns, rings)."""

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
        grazing |= ours.differ(_beams(lidar, turned))
    return ScanComparison(ours, gazebo, ours.differ(gazebo), grazing)


def _beams(lidar: Lidar, pose: Array) -> Beams:
    scan, shape = lidar.scan(pose), (lidar.config.columns, lidar.config.rings)
    beams = Beams(np.full(shape, np.inf), np.zeros(shape))
    beams.range_m[scan.column, scan.ring], beams.label[scan.column, scan.ring] = scan.range_m, scan.label
    return beams


def _nearby_poses(config: LidarConfig, world_from_lidar: Array) -> list[Array]:
    """Poses by column (columns, 4, 4) that turn each beam by ``NEARBY`` to its eight neighbours."""
    azimuth = np.arctan2(*ray_directions(config)[:, 0, 1::-1].T)
    poses = []
    for up, left in ((u, v) for u in (-1, 0, 1) for v in (-1, 0, 1) if u or v):
        lift = [frames.pose((0, 0, 0), (0, -np.degrees(up * NEARBY), 0))] * len(azimuth)
        turn = [frames.pose((0, 0, 0), (0, 0, np.degrees(a))) for a in azimuth]
        swing = frames.pose((0, 0, 0), (0, 0, np.degrees(left * NEARBY)))
        poses.append(
            world_from_lidar @ np.array([swing @ a @ b @ frames.inverse(a) for a, b in zip(turn, lift, strict=True)])
        )
    return poses


class ImageComparison(NamedTuple):
    """A plain image of Gazebo beside our tag image: pixels that differ, and those 2 pixels or less from a silhouette."""

    ours: NDArray[np.uint8]
    gazebo: NDArray[np.uint8]
    differ: Mask
    near_silhouette: Mask


def compare_image(
    scene: Scene, config: CameraConfig, world_from_camera: Array, gazebo: NDArray[np.uint8]
) -> ImageComparison:
    """Compare Gazebo's plain image with our tag image; the pose is that of the rig's camera frame.

    A pixel has a silhouette if rays through ``SUBPIXELS`` x ``SUBPIXELS`` points of it meet different classes.
    """
    world_from_optical = world_from_camera @ CAMERA_FROM_OPTICAL
    ours = PALETTE[LabelCamera(config, scene).label(world_from_optical).label]
    fine = config.model_copy(update={"width": config.width * SUBPIXELS, "height": config.height * SUBPIXELS})
    label = LabelCamera(fine, scene).label(world_from_optical).label
    parts = label.reshape(config.height, SUBPIXELS, config.width, SUBPIXELS).transpose(0, 2, 1, 3)
    parts = parts.reshape(config.height, config.width, -1)
    mixed = (parts != parts[..., :1]).any(axis=-1) | _changes(label, config)
    return ImageComparison(
        ours, gazebo, (ours != gazebo).any(axis=-1), binary_dilation(mixed, np.ones((3, 3), np.bool_), iterations=2)
    )


def _changes(label: NDArray[np.uint8], config: CameraConfig) -> Mask:
    """Pixels on whose border to the right or below the class changes between two subpixels."""
    edge = np.zeros(label.shape, np.bool_)
    edge[:, :-1] |= label[:, :-1] != label[:, 1:]
    edge[:-1] |= label[:-1] != label[1:]
    return edge.reshape(config.height, SUBPIXELS, config.width, SUBPIXELS).any(axis=(1, 3))


