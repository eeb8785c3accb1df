# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One labelled cloud of many scans in the world frame (paper, Figure 12), thinned to what a browser turns with ease."""

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
from fieldtruth.report.page.bag_pass import FOREIGN, stamp_of, usable
from fieldtruth.report.page.class_counts import class_ids

SCANS: Final = 120
LARGEST: Final = 260_000
"""At most so many points."""
_REACH: Final = 48.0  # [m] from the sensor; beyond it rings are too far apart to show a shape
_FINEST: Final = 0.04  # [m]; side of a voxel
_COARSER: Final = 1.12  # from one try to the next
_WORKING: Final = 6 * LARGEST  # points that are held while scans are added

U1 = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class ScanCloud:
    """Points of several scans: ``xyz`` (n, 3) [m] and ``label`` (n,), one point for each voxel that was hit."""

    xyz: Array
    label: U1
    scans: int
    voxel: float
    """Side [m] of a voxel."""
    frame: str
    """Frame of the points: the world, or the sensor's own where its pose is not known."""
    note: str = ""
    """What the reader should know about the poses."""


def gather_scans(run: Run, trajectory: Trajectory | None) -> ScanCloud | None:
    """Gather up to 120 scans, evenly spread over the run; None if it has no cloud.

    Without a trajectory, or a way from the sensor to base_link, it is the run's middle scan in the sensor's frame.

    Raises:
        BagError: the bag is damaged, or its clouds are none.
    """
    if table.POINTS not in usable(run)[0]:
        return None
    with open_bag(run.bag) as bag:
        places, decode = bag.places(table.POINTS), decoder(bag)

        def scan(row: int) -> tuple[Any, int]:
            raw = bag.message(bag.chunk(int(places.chunk[row])), int(places.offset[row]))
            cloud = decode(raw)
            return cloud, stamp_of(cloud, raw)

        middle = len(places.stamps_ns) // 2
        cloud, _ = scan(middle)
        frame = cloud.header.frame_id
        base_from_sensor, note = _mount(run, frame)
        if trajectory is None or base_from_sensor is None:
            xyz, label = _returns(cloud)
            thin = _Thin()
            thin.add(xyz, label)
            return thin.cloud(1, frame, note or "The bag has no true poses.")
        rows = np.unique(np.linspace(0, len(places.stamps_ns) - 1, SCANS).round().astype(int))
        thin, taken = _Thin(), 0
        for row in rows.tolist():
            cloud, stamp = scan(row)
            try:
                world_from_sensor = trajectory.world_from_base(stamp) @ base_from_sensor
            except BagError:  # before the first pose, or after the last
                continue
            xyz, label = _returns(cloud)
            thin.add(frames.transform(world_from_sensor, xyz), label)
            taken += 1
        return thin.cloud(taken, "world", note)


def _mount(run: Run, frame: str) -> tuple[Array | None, str]:
    """``base_from_sensor`` (4, 4), and where it comes from if not from the bag."""
    try:
        return read_static_frames(run).base_from(frame), ""
    except FOREIGN:  # there are none, or not this one, or what they say is no rotation
        mounts = (run.experiment.rig if run.experiment else Rig()).mounts()
    if frame in mounts:
        return mounts[frame].base_from_sensor, f"The bag does not say where {frame} sits; the paper's Table 2 does."
    return None, f"The bag does not say where {frame} sits on the robot, so this is one scan in that frame."


def _returns(cloud: Any) -> tuple[Array, U1]:
    """Points (n, 3) [m] of a message in its own frame, and their class ids (n,); those that are no place are left out.

    Raises:
        BagError: it has no x, y, z.
    """
    try:
        rows = points(cloud)
        xyz = np.column_stack([rows[axis] for axis in "xyz"]).astype(np.float64)
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise BagError(f"{table.POINTS}: no cloud with x, y and z ({error})") from error
    with np.errstate(over="ignore", invalid="ignore"):
        good = np.isfinite(xyz).all(axis=1) & ((xyz**2).sum(axis=1) < _REACH**2)
    return xyz[good], class_ids(rows)[good]


class _Thin:
    """Keeps the first point of each voxel; the voxels grow while there are too many of them."""

    def __init__(self) -> None:
        self._xyz, self._label = [np.zeros((0, 3))], [np.zeros(0, np.uint8)]
        self._voxel, self._held = _FINEST, 0

    def add(self, xyz: Array, label: U1) -> None:
        self._xyz.append(xyz)
        self._label.append(label)
        self._held += len(xyz)
        if self._held > _WORKING:
            self._thin(_WORKING // 2)

    def cloud(self, scans: int, frame: str, note: str) -> ScanCloud:
        self._thin(LARGEST)
        return ScanCloud(xyz=self._xyz[0], label=self._label[0], scans=scans, voxel=self._voxel, frame=frame, note=note)

    def _thin(self, most: int) -> None:
        xyz, label = np.concatenate(self._xyz), np.concatenate(self._label)
        while True:
            x, y, z = (np.floor(xyz / self._voxel).astype(np.int64) & 0x1FFFFF).T
            first = np.sort(np.unique((x << 42) | (y << 21) | z, return_index=True)[1])
            xyz, label = xyz[first], label[first]
            if len(xyz) <= most:
                break
            self._voxel *= _COARSER
        self._xyz, self._label, self._held = [xyz], [label], len(xyz)
