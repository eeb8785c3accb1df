# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The cloud for the page's script: seven bytes per point, the first view, and a still image of that view."""

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.bag.geometry import Trajectory
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import CLASSES
from fieldtruth.report.drawing.cloud import draw_cloud, looking
from fieldtruth.report.drawing.geometry import distance_along
from fieldtruth.report.drawing.images import jpeg_below
from fieldtruth.report.drawing.style import class_colour
from fieldtruth.report.page.scan_cloud import ScanCloud

PATH: Final = len(CLASSES)
"""Label of the points on the robot's path."""
PATH_POINTS: Final = 6000
POSTER_BYTES: Final = 330_000
_POSTER: Final = (1280, 640)  # [pixel]
_VERTICAL_FOV: Final = 40.0  # [deg]
_ELEVATION: Final = 33.0  # [deg] of the camera above the horizon
_PATH_SPACING: Final = 0.06  # [m]
_STEPS: Final = 32_000  # of the grid, from the middle to either side


class LegendRow(NamedTuple):
    """A class in the cloud and its number of points."""

    label: int
    name: str
    colour: str
    points: int


@dataclass(frozen=True)
class CloudView:
    """An interactive cloud."""

    cloud: ScanCloud
    data: bytes
    """n rows of three int16, little endian, followed by n labels of one byte."""
    settings: dict[str, Any]
    """For the script: scale of the rows, first view, colours;
    of several LiDARs, and of the path after them, the first row and the number of rows."""
    legend: tuple[LegendRow, ...]
    poster: bytes
    """JPEG of the first view."""
    has_path: bool

    @property
    def lidars(self) -> tuple[tuple[str, int], ...]:
        """Names of the LiDARs with their numbers of points; empty if there is only one."""
        return self.cloud.parts if len(self.cloud.parts) > 1 else ()


def pack_cloud(cloud: ScanCloud, trajectory: Trajectory | None) -> CloudView:
    """Pack a cloud of at least one point, with the robot's path if it is in the world frame."""
    path = np.zeros((0, 3))
    if trajectory is not None and cloud.frame == "world":
        path = _evenly_spaced(trajectory.position)
    xyz = np.concatenate([cloud.xyz, path])
    label = np.concatenate([cloud.label, np.full(len(path), PATH, np.uint8)])
    middle = (xyz.min(axis=0) + xyz.max(axis=0)) / 2
    step = max(float(np.abs(xyz - middle).max()), 1e-3) / _STEPS
    data = np.rint((xyz - middle) / step).astype("<i2").tobytes() + label.tobytes()
    target, azimuth, distance = _first_view(cloud.xyz, path)
    low, high = np.percentile(cloud.xyz[:, 2], (1, 99))
    counts = np.bincount(cloud.label, minlength=len(CLASSES))
    settings: dict[str, Any] = {
        "count": len(xyz), "step": step, "middle": middle.tolist(), "voxel": cloud.voxel, "path": PATH,
        "target": target.tolist(), "azimuth": azimuth, "elevation": _ELEVATION, "distance": distance,
        "fov": _VERTICAL_FOV, "low": float(low), "high": max(float(high), float(low) + 0.1),
        "colours": [class_colour(row.label) for row in CLASSES],
    }  # fmt: skip
    if len(cloud.parts) > 1:
        counts_of = [*(points for _, points in cloud.parts), len(path)]
        settings["lidars"] = [[sum(counts_of[:k]), count] for k, count in enumerate(counts_of)]
    legend = tuple(
        LegendRow(int(row.label), row.name if row.label else "no class", class_colour(row.label), int(points))
        for row, points in zip(CLASSES, counts, strict=True)
        if points
    )
    return CloudView(cloud, data, settings, legend, _poster(cloud, target, azimuth, distance), len(path) > 1)


def _evenly_spaced(position: Array) -> Array:
    distance = distance_along(position)
    count = int(np.clip(distance[-1] / _PATH_SPACING, 1, PATH_POINTS))
    at = np.linspace(0.0, distance[-1], count)
    return np.column_stack([np.interp(at, distance, axis) for axis in position.T])


def _first_view(xyz: Array, path: Array) -> tuple[Array, float, float]:
    """Target [m], azimuth of the view [deg] about z from x, and distance [m] from the target."""
    target = np.median(xyz, axis=0) if len(path) < 2 else (path.min(axis=0) + path.max(axis=0)) / 2
    extent = float(np.percentile(np.linalg.norm(xyz[:, :2] - target[:2], axis=1), 75))
    ahead = path[-1] - path[0] if len(path) > 1 else np.array([1.0, 0.0, 0.0])
    azimuth = float(np.degrees(np.arctan2(ahead[1], ahead[0])))
    # A long path is seen from its side, so that it crosses the image.
    side = 62.0 if np.linalg.norm(ahead) > extent / 2 else 25.0
    return target, azimuth + side, max(extent, 1.0) / np.tan(np.radians(_VERTICAL_FOV) / 2) * 0.92


def _poster(cloud: ScanCloud, target: Array, azimuth: float, distance: float) -> bytes:
    width, height = _POSTER
    across, up = np.radians(azimuth), np.radians(_ELEVATION)
    pose = looking((np.cos(up) * np.cos(across), np.cos(up) * np.sin(across), -np.sin(up)))
    pose[:3, 3] = target - distance * pose[:3, 2]
    fov = float(np.degrees(2 * np.arctan(width / height * np.tan(np.radians(_VERTICAL_FOV) / 2))))
    image = draw_cloud(cloud, pose, width=width, height=height, fov_deg=fov, size=cloud.voxel * 1.2)
    return jpeg_below(image, POSTER_BYTES)
