# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One labelled cloud from many scans in the world frame (paper, Figure 12), small enough for a browser."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.decode import points
from fieldtruth.bag.errors import BagError
from fieldtruth.bag.run import Run
from fieldtruth.bag.sources import Source
from fieldtruth.bag.trajectory import Trajectory
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.readings import Cloud
from fieldtruth.report.drawing import cloud as drawing
from fieldtruth.report.page.bag_pass import UNEXPECTED, usable_topics
from fieldtruth.report.page.class_counts import class_ids

SCANS: Final = 120
LARGEST: Final = 260_000
"""Maximum number of points."""
_MAX_RANGE: Final = 48.0  # [m]; farther away, rings are too far apart to show a shape
_FINEST: Final = 0.04  # [m]; first size of a voxel
_COARSENING: Final = 1.12
_BUFFER: Final = 6 * LARGEST  # points in memory while scans are added


@dataclass(frozen=True, kw_only=True)
class ScanCloud(drawing.Cloud):
    """Accumulated scans with one point per occupied voxel."""

    voxel: float
    """Side [m] of a voxel."""
    frame: str
    """Frame of the points: the world, or the sensor's own frame if its pose is not known."""
    parts: tuple[tuple[str, int], ...]
    """Names of the LiDARs and numbers of their points, which follow each other."""
    note: str = ""
    """Remark about the poses for the reader."""


def accumulate_scans(run: Run, trajectory: Trajectory | None) -> ScanCloud | None:
    """Accumulate up to 120 scans of each LiDAR, evenly spread over the run; None if it has no cloud.

    Without a trajectory or the mount of the first LiDAR, the result is its middle scan in its own frame.

    Raises:
        BagError: the bag is damaged, or its clouds have no x, y, z.
    """
    lidars = [lidar for lidar in run.of(Cloud) if lidar.topic in usable_topics(run)[0]]
    if not lidars:
        return None
    found = [_accumulated(run, lidar, trajectory) for lidar in lidars]
    same = [each for each in found if each.frame == found[0].frame]
    for each in same:
        each.reduce(LARGEST // len(same))
    voxel = max(each.voxel for each in same)
    for each in same:
        each.coarsen(voxel)
    names = [lidar.name for lidar in lidars]
    notes = [each.note for each in same]
    notes += [f"The cloud of {name} is not shown." for name, e in zip(names, found, strict=True) if e not in same]
    return ScanCloud(
        xyz=np.concatenate([each.xyz for each in same]),
        label=np.concatenate([each.label for each in same]),
        scans=sum(each.scans for each in same),
        voxel=voxel,
        frame=found[0].frame,
        parts=tuple((name, len(e.xyz)) for name, e in zip(names, found, strict=True) if e in same),
        note=" ".join(dict.fromkeys(filter(None, notes))),
    )


def _accumulated(run: Run, lidar: Source, trajectory: Trajectory | None) -> "_Voxels":
    clouds, topic = run.readings(lidar.name, labelled=False), lidar.topic
    last = len(clouds) - 1
    middle = clouds.message((last + 1) // 2)
    base_from_sensor, note = _mount(run, middle.header.frame_id)
    if trajectory is None or base_from_sensor is None:
        voxels = _Voxels(middle.header.frame_id, note or "The bag has no true poses.")
        voxels.add(*_returns(topic, middle))
        return voxels
    voxels = _Voxels("world", note)
    for row in np.unique(np.linspace(0, last, SCANS).round().astype(int)).tolist():
        cloud = clouds.message(row)
        try:
            world_from_sensor = trajectory.world_from_base(int(clouds.stamps_ns[row])) @ base_from_sensor
        except BagError:  # before the first pose or after the last
            continue
        xyz, label = _returns(topic, cloud)
        voxels.add(transforms.transform(world_from_sensor, xyz), label)
    return voxels


def _mount(run: Run, frame: str) -> tuple[Array | None, str]:
    """``base_from_sensor`` (4, 4), and a remark if it is not from the bag."""
    try:
        return run.static.base_from(frame), ""
    except UNEXPECTED:  # no frames, not this one, or an invalid rotation
        mounts = run.rig.mounts()
    if frame in mounts:
        source = "the paper's Table 2" if run.experiment is None else "that of experiment.yaml"
        return mounts[frame].base_from_sensor, f"The bag has no pose of {frame}; {source} was used."
    return None, f"The bag has no pose of {frame} on the robot, so this is one scan in that frame."


def _returns(topic: str, cloud: Any) -> tuple[Array, NDArray[np.uint8]]:
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
    return xyz[good], class_ids(rows)[good]


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
