# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Differences of Gazebo's scans and images from ours, and which of these beams and pixels are on an edge of our world.

Both ask our own scene alone: a dense bundle of rays around the beam or the pixel meets another class or range, or not.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.classes import NO_RETURN, PALETTE, Label
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.kernels.camera_rays import Intrinsics
from fieldtruth.sense.lens import intrinsics_of
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CAMERA_FROM_OPTICAL, CameraConfig, StereoConfig
from fieldtruth.sensors.camera.labels import LabelCamera, LabelImages
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import IdealLidar, ray_directions
from fieldtruth.validation.tracer import ReferenceTracer

RANGE: Final = 0.005
"""Largest difference [m] of two ranges that are equal."""
NEARBY: Final = 5e-5
"""Angle [rad] within which a beam that has an edge beside it grazes that edge: 0.5 mm at 10 m."""
TRAIL_EDGE: Final = 0.01
"""Distance [m] from a trail's edge within which a point may be ground or trail: the exported edge is a polyline."""
SEAM: Final = 1e-4
"""Distance [m] from the common edge of two triangles within which Gazebo's rays may pass between them: the rounding of
the exported positions, and ODE's single precision."""
SUBPIXELS: Final = 3
"""Rays along each side of every pixel that look for silhouettes in it."""
BUNDLE: Final = 160
"""Rays along each side of a bundle about one beam or pixel. The tip of a blade or a twig between leaves is thin."""
MOST: Final = 1000
"""Beams of a scan and pixels of an image that are looked at so closely."""


class Beams(NamedTuple):
    """A scan of every beam, both (columns, rings): range [m], infinite without a return, and class id, 0 without."""

    range_m: Array
    label: Array

    @classmethod
    def of_gazebo(cls, range_m: Array, retro: Array) -> "Beams":
        """Beams of Gazebo, whose water is a surface with its own class, while ours returns nothing."""
        lost = np.isin(retro, [int(label) for label in NO_RETURN]) | ~np.isfinite(range_m)
        return cls(np.where(lost, np.inf, range_m), np.where(lost, 0.0, retro))

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
    """A scan of Gazebo beside ours: the beams that differ, and those of them that graze an edge, (columns, rings)."""

    ours: Beams
    gazebo: Beams
    differ: Mask
    grazing: Mask


def compare_scan(scene: Scene, config: LidarConfig, world_from_lidar: Array, gazebo: Beams) -> ScanComparison:
    """Compare Gazebo's beams with ours from the same pose: range within ``RANGE``, and the same class.

    A beam grazes an edge if rays within ``NEARBY`` of it meet another class or a step in range, if it meets the ground
    within ``TRAIL_EDGE`` of a trail's edge, or if Gazebo's has passed between two triangles that meet within ``SEAM``
    of it and hit what is behind.
    """
    scan = IdealLidar(config, scene).scan(world_from_lidar)
    ours = Beams(np.full(gazebo.range_m.shape, np.inf), np.zeros(gazebo.label.shape))
    ours.range_m[scan.column, scan.ring], ours.label[scan.column, scan.ring] = scan.range_m, scan.label
    differ = ours.differ(gazebo)
    grazing = np.zeros(differ.shape, np.bool_)
    directions = ray_directions(config) @ world_from_lidar[:3, :3].T
    for column, ring in np.argwhere(differ)[:MOST].tolist():
        direction, range_m = directions[column, ring], float(ours.range_m[column, ring])
        on_ground = ours.label[column, ring] in (Label.GROUND, Label.TRAIL)
        point = world_from_lidar[:3, 3] + (range_m if on_ground else 0.0) * direction
        at_trail = on_ground and bool(abs(scene.world.terrain.trail_distance.at(*point[:2])) < TRAIL_EDGE)
        grazing[column, ring] = at_trail or _meets_edge(scene, world_from_lidar[:3, 3], direction)
    if (differ & ~grazing).any():
        # Below grass and litter Gazebo has the soil, which bears the wheels.
        soil = replace(scene.world, terrain=replace(scene.world.terrain, layer=None))
        tracers = ReferenceTracer(scene.world), ReferenceTracer(soil)
        for column, ring in np.argwhere(differ & ~grazing).tolist():
            behind = _behind_seam(tracers, world_from_lidar[:3, 3], directions[column, ring], config.max_range)
            grazing[column, ring] = np.isclose(behind, gazebo.range_m[column, ring], rtol=0.0, atol=RANGE).any()
    return ScanComparison(ours, gazebo, differ, grazing)


def _behind_seam(tracers: Iterable[ReferenceTracer], origin: Array, direction: Array, limit: float) -> list[float]:
    """Ranges [m] of the first surfaces that a ray through all seams meets, infinite without one; NaN without a seam."""
    found, seams = list[float](), list[bool]()
    for tracer in tracers:
        hits = tracer.hits(origin[None], direction[None], np.array([limit]))
        inside = np.flatnonzero(hits.margin > SEAM)
        first = inside[0] if len(inside) else len(hits.margin)
        seams.append(bool((hits.margin[:first] > -SEAM).any()))
        found.append(float(hits.range_m[first]) if len(inside) else float("inf"))
    return found if seams[0] else [float("nan")]


def _meets_edge(scene: Scene, origin: Array, direction: Array) -> bool:
    """Return whether rays within ``NEARBY`` of a direction (3,) meet two classes, or a step between their ranges."""
    x, y, z = direction
    world_from_body = transforms.pose(origin.tolist(), (0.0, -np.degrees(np.arcsin(z)), np.degrees(np.arctan2(y, x))))
    focal, centre = BUNDLE / 2 / NEARBY, BUNDLE / 2 - 0.5
    images = _bundle(scene, world_from_body @ OPTICAL, Intrinsics(focal, focal, centre, centre))
    depth = images.depth.astype(np.float64)
    bends = [np.abs(np.diff(depth, n=2, axis=axis)).max() for axis in (0, 1)]
    return len(np.unique(images.label)) > 1 or max(bends) > RANGE


def _bundle(scene: Scene, world_from_optical: Array, lens: Intrinsics) -> LabelImages:
    camera = LabelCamera(StereoConfig(width=BUNDLE, height=BUNDLE), scene)
    camera.intrinsics = lens
    return camera.label(world_from_optical)


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
        images = _bundle(scene, world_from_optical, _five_pixels(intrinsics_of(config), row, column))
        near[row, column] = len(np.unique(images.label)) > 1
    return ImageComparison(ours, gazebo, differ, near)


def _five_pixels(lens: Intrinsics, row: int, column: int) -> Intrinsics:
    """Intrinsics of a bundle through the 5 x 5 pixels about a pixel."""
    scale = BUNDLE / 5
    cx, cy = ((at - pixel + 2.5) * scale - 0.5 for at, pixel in ((lens.cx, column), (lens.cy, row)))
    return Intrinsics(lens.fx * scale, lens.fy * scale, cx, cy)
