# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One labelled cloud from many scans in the world frame (paper, Figure 12), small enough for a browser."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.calibration import read_static_frames
from fieldtruth.bag.decode import points
from fieldtruth.bag.reader import BagError, decoder, open_bag
from fieldtruth.bag.run import Run
from fieldtruth.bag.trajectory import Trajectory
from fieldtruth.core import frames
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.rig import Rig
from fieldtruth.report.drawing.cloud import Cloud
from fieldtruth.report.page.bag_pass import UNEXPECTED, stamp_of, usable_topics
from fieldtruth.report.page.class_counts import class_ids

SCANS: Final = 120
LARGEST: Final = 260_000
"""Maximum number of points."""
_MAX_RANGE: Final = 48.0  # [m]; farther away, rings are too far apart to show a shape
_FINEST: Final = 0.04  # [m]; first size of a voxel
_COARSENING: Final = 1.12
_BUFFER: Final = 6 * LARGEST  # points in memory while scans are added


@dataclass(frozen=True, kw_only=True)
class ScanCloud(Cloud):
    """Accumulated scans with one point per occupied voxel."""

    voxel: float
    """Side [m] of a voxel."""
    frame: str
    """Frame of the points: the world, or the sensor's own frame if its pose is not known."""
    note: str = ""
    """Remark about the poses for the reader."""


def accumulate_scans(run: Run, trajectory: Trajectory | None) -> ScanCloud | None:
    """Accumulate up to 120 scans, evenly spread over the run; None if it has no cloud.

    Without a trajectory or the sensor's mount, the result is the middle scan of the run in the sensor's frame.

    Raises:
        BagError: the bag is damaged, or its clouds have no x, y, z.
    """
    if table.POINTS not in usable_topics(run)[0]:
        return None
    with open_bag(run.bag) as bag:
        index, decode = bag.index([table.POINTS])[table.POINTS], decoder(bag)
        voxels, last = _Voxels(), len(index.stamps_ns) - 1

        def scan(row: int) -> tuple[Any, int]:
            raw = bag.message(bag.chunk(int(index.chunk[row])), int(index.offset[row]))
            cloud = decode(raw)
            return cloud, stamp_of(cloud, raw)

        middle, _ = scan((last + 1) // 2)
        base_from_sensor, note = _mount(run, middle.header.frame_id)
        if trajectory is None or base_from_sensor is None:
            voxels.add(*_returns(middle))
            return voxels.cloud(1, middle.header.frame_id, note or "The bag has no true poses.")
        scans = 0
        for row in np.unique(np.linspace(0, last, SCANS).round().astype(int)).tolist():
            cloud, stamp = scan(row)
            try:
                world_from_sensor = trajectory.world_from_base(stamp) @ base_from_sensor
            except BagError:  # before the first pose or after the last
                continue
            xyz, label = _returns(cloud)
            voxels.add(frames.transform(world_from_sensor, xyz), label)
            scans += 1
        return voxels.cloud(scans, "world", note)


def _mount(run: Run, frame: str) -> tuple[Array | None, str]:
    """``base_from_sensor`` (4, 4), and a remark if it is not from the bag."""
    try:
        return read_static_frames(run).base_from(frame), ""
    except UNEXPECTED:  # no frames, not this one, or an invalid rotation
        mounts = (run.experiment.rig if run.experiment else Rig()).mounts()
    if frame in mounts:
        return mounts[frame].base_from_sensor, f"The bag has no pose of {frame}; the paper's Table 2 was used."
    return None, f"The bag has no pose of {frame} on the robot, so this is one scan in that frame."


def _returns(cloud: Any) -> tuple[Array, NDArray[np.uint8]]:
    """Finite points (n, 3) [m] of a message in its own frame, and their class ids (n,).

    Raises:
        BagError: it has no x, y, z.
    """
    try:
        rows = points(cloud)
        xyz = np.column_stack([rows[axis] for axis in "xyz"]).astype(np.float64)
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise BagError(f"{table.POINTS}: clouds must have x, y and z ({error})") from error
    with np.errstate(over="ignore", invalid="ignore"):
        good = np.isfinite(xyz).all(axis=1) & ((xyz**2).sum(axis=1) < _MAX_RANGE**2)
    return xyz[good], class_ids(rows)[good]


class _Voxels:
    """Keeps the first point of each voxel; voxels grow while there are too many."""

    def __init__(self) -> None:
        self._xyz, self._label = [np.zeros((0, 3))], [np.zeros(0, np.uint8)]
        self._voxel, self._count = _FINEST, 0

    def add(self, xyz: Array, label: NDArray[np.uint8]) -> None:
        self._xyz.append(xyz)
        self._label.append(label)
        self._count += len(xyz)
        if self._count > _BUFFER:
            self._reduce(_BUFFER // 2)

    def cloud(self, scans: int, frame: str, note: str) -> ScanCloud:
        self._reduce(LARGEST)
        return ScanCloud(xyz=self._xyz[0], label=self._label[0], scans=scans, voxel=self._voxel, frame=frame, note=note)

    def _reduce(self, most: int) -> None:
        xyz, label = np.concatenate(self._xyz), np.concatenate(self._label)
        while True:
            x, y, z = (np.floor(xyz / self._voxel).astype(np.int64) & 0x1FFFFF).T
            first = np.sort(np.unique((x << 42) | (y << 21) | z, return_index=True)[1])
            xyz, label = xyz[first], label[first]
            if len(xyz) <= most:
                break
            self._voxel *= _COARSENING
        self._xyz, self._label, self._count = [xyz], [label], len(xyz)
