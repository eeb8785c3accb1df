# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One labelled cloud from many scans in the world frame (paper, Figure 12), small enough for a browser.

The page's script gets seven bytes per point, the first view, and a still image of that view.
"""

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.decode import points
from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import Trajectory
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import Source
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import ClassTable
from fieldtruth.core.readings import Cloud
from fieldtruth.report.drawing import cloud as drawing
from fieldtruth.report.drawing.cloud import draw_cloud, looking
from fieldtruth.report.drawing.images import jpeg_below
from fieldtruth.report.drawing.maps import distance_along
from fieldtruth.report.drawing.style import class_colour, sensor_nouns
from fieldtruth.report.page.bag_pass import UNEXPECTED, class_ids, usable_topics

SCANS: Final = 120
LARGEST: Final = 260_000
"""Maximum number of points."""
_MAX_RANGE: Final = 48.0  # [m]; farther away, rings are too far apart to show a shape
_FINEST: Final = 0.04  # [m]; first size of a voxel
_COARSENING: Final = 1.12
_BUFFER: Final = 6 * LARGEST  # points in memory while scans are added
PATH_POINTS: Final = 6000
POSTER_BYTES: Final = 330_000
_POSTER: Final = (1280, 640)  # [pixel]
_VERTICAL_FOV: Final = 40.0  # [deg]
_ELEVATION: Final = 33.0  # [deg] of the camera above the horizon
_PATH_SPACING: Final = 0.06  # [m]
_STEPS: Final = 32_000  # of the grid, from the middle to either side


@dataclass(frozen=True, kw_only=True)
class ScanCloud(drawing.Cloud):
    """Accumulated scans with one point per occupied voxel."""

    voxel: float
    """Side [m] of a voxel."""
    frame: str
    """Frame of the points: the world, or the sensor's own frame if its pose is not known."""
    parts: tuple[tuple[str, int], ...]
    """Names of the sensors and numbers of their points, which follow each other."""
    sensors: str
    """How many of which sensors they are from."""
    note: str = ""
    """Remark about the poses for the reader."""


def accumulate_scans(run: Run, trajectory: Trajectory | None) -> ScanCloud | None:
    """Accumulate up to 120 clouds of each sensor, evenly spread over the run; None if it has no cloud.

    Without a trajectory or the mount of the first sensor, the result is its middle scan in its own frame.

    Raises:
        BagError: the bag is damaged, or its clouds have no x, y, z.
    """
    sources = [each for each in run.of(Cloud) if each.topic in usable_topics(run)[0]]
    if not sources:
        return None
    found = [_accumulated(run, each, trajectory) for each in sources]
    same = [each for each in found if each.frame == found[0].frame]
    for each in same:
        each.reduce(LARGEST // len(same))
    voxel = max(each.voxel for each in same)
    for each in same:
        each.coarsen(voxel)
    names = [each.name for each in sources]
    notes = [each.note for each in same]
    notes += [f"The cloud of {name} is not shown." for name, e in zip(names, found, strict=True) if e not in same]
    return ScanCloud(
        xyz=np.concatenate([each.xyz for each in same]),
        label=np.concatenate([each.label for each in same]),
        scans=sum(each.scans for each in same),
        classes=run.classes,
        voxel=voxel,
        frame=found[0].frame,
        parts=tuple((name, len(e.xyz)) for name, e in zip(names, found, strict=True) if e in same),
        sensors=" and ".join(sensor_nouns(each.config for each in sources)),
        note=" ".join(dict.fromkeys(filter(None, notes))),
    )


def _accumulated(run: Run, source: Source, trajectory: Trajectory | None) -> "_Voxels":
    clouds, topic = run.readings(source.name, labelled=False), source.topic
    last = len(clouds) - 1
    middle = clouds.message((last + 1) // 2)
    base_from_sensor, note = _mount(run, middle.header.frame_id)
    if trajectory is None or base_from_sensor is None:
        voxels = _Voxels(middle.header.frame_id, note or "The bag has no true poses.")
        voxels.add(*_returns(topic, middle, run.classes))
        return voxels
    voxels = _Voxels("world", note)
    for row in np.unique(np.linspace(0, last, SCANS).round().astype(int)).tolist():
        cloud = clouds.message(row)
        try:
            world_from_sensor = trajectory.world_from_base(int(clouds.stamps_ns[row])) @ base_from_sensor
        except BagError:  # before the first pose or after the last
            continue
        xyz, label = _returns(topic, cloud, run.classes)
        voxels.add(transforms.transform(world_from_sensor, xyz), label)
    return voxels


def _mount(run: Run, frame: str) -> tuple[Array | None, str]:
    """``base_from_sensor`` (4, 4), and a remark if it is not from the bag."""
    try:
        return run.calibration.static.base_from(frame), ""
    except UNEXPECTED:  # no frames, not this one, or an invalid rotation
        mounts = run.rig.mounts()
    if frame in mounts:
        source = "the paper's Table 2" if run.experiment is None else "that of experiment.yaml"
        return mounts[frame].base_from_sensor, f"The bag has no pose of {frame}; {source} was used."
    return None, f"The bag has no pose of {frame} on the robot, so this is one scan in that frame."


def _returns(topic: str, cloud: Any, classes: ClassTable) -> tuple[Array, NDArray[np.uint8]]:
    """Finite points (n, 3) [m] of a message in its own frame, and their class ids (n,).

    Raises:
        BagError: it has no x, y, z.
    """
    try:
        rows = points(cloud)
        xyz = np.column_stack([rows[axis] for axis in "xyz"]).astype(np.float64)
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise BagError(f"{topic}: clouds must have x, y and z ({error})") from error
    with np.errstate(over="ignore", invalid="ignore"):
        good = np.isfinite(xyz).all(axis=1) & ((xyz**2).sum(axis=1) < _MAX_RANGE**2)
    return xyz[good], class_ids(rows, classes)[good]


class _Voxels:
    """Scans in a frame, of which the first point of each voxel is kept; voxels grow while there are too many."""

    def __init__(self, frame: str, note: str) -> None:
        self.frame, self.note, self.scans = frame, note, 0
        self.xyz, self.label, self.voxel = np.zeros((0, 3)), np.zeros(0, np.uint8), _FINEST
        self._new: list[tuple[Array, NDArray[np.uint8]]] = []
        self._count = 0

    def add(self, xyz: Array, label: NDArray[np.uint8]) -> None:
        self.scans += 1
        self._new.append((xyz, label))
        self._count += len(xyz)
        if self._count > _BUFFER:
            self.reduce(_BUFFER // 2)

    def coarsen(self, voxel: float) -> None:
        if voxel > self.voxel:
            self.voxel = voxel
            self.reduce(len(self.xyz))

    def reduce(self, most: int) -> None:
        xyz = np.concatenate([self.xyz, *(xyz for xyz, _ in self._new)])
        label = np.concatenate([self.label, *(label for _, label in self._new)])
        while True:
            x, y, z = (np.floor(xyz / self.voxel).astype(np.int64) & 0x1FFFFF).T
            first = np.sort(np.unique((x << 42) | (y << 21) | z, return_index=True)[1])
            xyz, label = xyz[first], label[first]
            if len(xyz) <= most:
                break
            self.voxel *= _COARSENING
        self.xyz, self.label, self._new, self._count = xyz, label, [], len(xyz)


class LegendRow(NamedTuple):
    """A class in the cloud and its number of points."""

    number: int
    """Of its points in the data."""
    name: str
    colour: str
    points: int


@dataclass(frozen=True)
class CloudView:
    """An interactive cloud."""

    cloud: ScanCloud
    data: bytes
    """n rows of three int16, little endian, followed by n numbers of classes of one byte."""
    settings: dict[str, Any]
    """For the script: scale of the rows, first view, colours;
    of several sensors, and of the path after them, the first row and the number of rows."""
    legend: tuple[LegendRow, ...]
    poster: bytes
    """JPEG of the first view."""
    has_path: bool

    @property
    def parts(self) -> tuple[tuple[str, int], ...]:
        """Names of the sensors with their numbers of points; empty if there is only one."""
        return self.cloud.parts if len(self.cloud.parts) > 1 else ()


def pack_cloud(cloud: ScanCloud, trajectory: Trajectory | None) -> CloudView:
    """Pack a cloud of at least one point, with the robot's path if it is in the world frame."""
    path = np.zeros((0, 3))
    if trajectory is not None and cloud.frame == "world":
        path = _evenly_spaced(trajectory.position)
    xyz = np.concatenate([cloud.xyz, path])
    shown = [cloud.classes[0], *cloud.classes.coloured]  # numbered without gaps
    number = np.zeros(len(cloud.classes), np.uint8)
    number[[row.label for row in shown]] = np.arange(len(shown))
    label = np.concatenate([number[cloud.label], np.full(len(path), len(shown), np.uint8)])
    middle = (xyz.min(axis=0) + xyz.max(axis=0)) / 2
    step = max(float(np.abs(xyz - middle).max()), 1e-3) / _STEPS
    data = np.rint((xyz - middle) / step).astype("<i2").tobytes() + label.tobytes()
    target, azimuth, distance = _first_view(cloud.xyz, path)
    low, high = np.percentile(cloud.xyz[:, 2], (1, 99))
    counts = np.bincount(label, minlength=len(shown))
    settings: dict[str, Any] = {
        "count": len(xyz), "step": step, "middle": middle.tolist(), "voxel": cloud.voxel, "path": len(shown),
        "target": target.tolist(), "azimuth": azimuth, "elevation": _ELEVATION, "distance": distance,
        "fov": _VERTICAL_FOV, "low": float(low), "high": max(float(high), float(low) + 0.1),
        "colours": [class_colour(row) for row in shown],
    }  # fmt: skip
    if len(cloud.parts) > 1:
        counts_of = [*(points for _, points in cloud.parts), len(path)]
        settings["sensors"] = [[sum(counts_of[:k]), count] for k, count in enumerate(counts_of)]
    legend = tuple(
        LegendRow(k, row.name if row.label else "no class", class_colour(row), int(points))
        for k, (row, points) in enumerate(zip(shown, counts, strict=False))
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
