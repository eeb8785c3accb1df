# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The cloud as the page's script takes it: seven bytes a point, the first view of it, and a still picture of that."""

import base64
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.bag.trajectory import Trajectory
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import CLASSES
from fieldtruth.report.drawing.style import class_colour
from fieldtruth.report.drawing.text import count_text, fixed
from fieldtruth.report.page.samples import jpeg_below
from fieldtruth.report.page.scan_cloud import ScanCloud

ROUTE: Final = len(CLASSES)
"""Label of the points that show the robot's way."""
ROUTE_POINTS: Final = 6000
POSTER_BYTES: Final = 330_000
_POSTER: Final = (1280, 640)  # [pixel]
_VERTICAL_FOV: Final = 40.0  # [deg]
_ELEVATION: Final = 33.0  # [deg] above the horizon, from where one looks
_DENSE: Final = 0.06  # [m] between two points of the way
_GRID: Final = 32_000  # steps from the middle to either side


class LegendRow(NamedTuple):
    """A class in the cloud."""

    label: int
    name: str
    colour: str
    number: str


@dataclass(frozen=True)
class Orbit:
    """A cloud that can be turned."""

    data: str
    """Base64 of n rows of three int16, little endian, and then n labels of one byte."""
    settings: dict[str, Any]
    """For the script: how the rows become metres, and where the eye is at first."""
    legend: tuple[LegendRow, ...]
    poster: str
    """JPEG in base64 of the first view."""
    points: str
    scans: int
    voxel_cm: str
    frame: str
    note: str
    has_route: bool
    lowest: str
    highest: str
    """Heights [m] at the ends of the ramp of colours."""


def pack(cloud: ScanCloud, trajectory: Trajectory | None) -> Orbit:
    """Pack a cloud of at least one point; the way is added to it if it is in the world's frame."""
    way = np.zeros((0, 3))
    if trajectory is not None and cloud.frame == "world":
        way = _way(trajectory.position)
    xyz = np.concatenate([cloud.xyz, way])
    label = np.concatenate([cloud.label, np.full(len(way), ROUTE, np.uint8)])
    middle = (xyz.min(axis=0) + xyz.max(axis=0)) / 2
    step = max(float(np.abs(xyz - middle).max()), 1e-3) / _GRID
    steps = np.rint((xyz - middle) / step).astype("<i2")
    data = steps.tobytes() + label.tobytes()
    target, azimuth, distance = _first_view(cloud, way)
    low, high = np.percentile(cloud.xyz[:, 2], (1, 99))
    counts = np.bincount(cloud.label, minlength=len(CLASSES))
    settings: dict[str, Any] = {
        "count": len(xyz), "step": step, "middle": middle.tolist(), "voxel": cloud.voxel, "route": ROUTE,
        "target": target.tolist(), "azimuth": azimuth, "elevation": _ELEVATION, "distance": distance,
        "fov": _VERTICAL_FOV, "low": float(low), "high": max(float(high), float(low) + 0.1),
        "colours": [class_colour(int(row.label)) for row in CLASSES],
    }  # fmt: skip
    return Orbit(
        data=base64.b64encode(data).decode(),
        settings=settings,
        legend=tuple(
            LegendRow(int(row.label), row.name if row.label else "no class", class_colour(int(row.label)),
                      count_text(int(counts[row.label])))
            for row in CLASSES if counts[row.label]
        ),
        poster=_poster(cloud, target, azimuth, distance),
        points=count_text(len(cloud.xyz)),
        scans=cloud.scans,
        voxel_cm=f"{100 * cloud.voxel:.0f}",
        frame=cloud.frame,
        note=cloud.note,
        has_route=len(way) > 1,
        lowest=fixed(settings["low"], 1),
        highest=fixed(settings["high"], 1),
    )  # fmt: skip


def _way(position: Array) -> Array:
    """Points along a way, evenly apart."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(position, axis=0), axis=1))])
    at = np.linspace(0.0, along[-1], int(np.clip(along[-1] / _DENSE, 1, ROUTE_POINTS)))
    return np.column_stack([np.interp(at, along, axis) for axis in position.T])


def _first_view(cloud: ScanCloud, way: Array) -> tuple[Array, float, float]:
    """Where one looks at [m], from where [deg, about z from x], and from how far [m]."""
    middle = np.median(cloud.xyz, axis=0) if len(way) < 2 else (way.min(axis=0) + way.max(axis=0)) / 2
    reach = float(np.percentile(np.linalg.norm(cloud.xyz[:, :2] - middle[:2], axis=1), 75))
    ahead = way[-1] - way[0] if len(way) > 1 else np.array([1.0, 0.0, 0.0])
    azimuth = float(np.degrees(np.arctan2(ahead[1], ahead[0])))
    # A way that is long is looked at from its side, so that it lies across the picture.
    side = 62.0 if np.linalg.norm(ahead) > reach / 2 else 25.0
    return middle, azimuth + side, max(reach, 1.0) / np.tan(np.radians(_VERTICAL_FOV) / 2) * 0.92


def _poster(cloud: ScanCloud, target: Array, azimuth: float, distance: float) -> str:
    from fieldtruth.report.drawing.cloud import Cloud, draw_cloud
    from fieldtruth.report.drawing.style import NIGHT

    width, height = _POSTER
    across, up = np.radians(azimuth), np.radians(_ELEVATION)
    forward = np.array([np.cos(up) * np.cos(across), np.cos(up) * np.sin(across), -np.sin(up)])
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    world_from_optical = np.eye(4)
    world_from_optical[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    world_from_optical[:3, 3] = target - distance * forward
    fov = np.degrees(2 * np.arctan(width / height * np.tan(np.radians(_VERTICAL_FOV) / 2)))
    drawn = Cloud(xyz=cloud.xyz, label=cloud.label, scans=cloud.scans)
    picture = draw_cloud(
        drawn, world_from_optical, width=width, height=height, fov_deg=float(fov), background=NIGHT,
        size=cloud.voxel * 1.2,
    )  # fmt: skip
    return base64.b64encode(jpeg_below(picture, POSTER_BYTES)).decode()
