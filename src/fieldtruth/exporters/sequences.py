# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What the formats kitti and semantickitti share: geometry, poses, times, clouds.

Clouds are in the LiDAR's frame (x forward, y left, z up). cam0 is the left camera's optical frame; poses are those of
cam0 relative to its first. Tr takes points from the LiDAR's frame to cam0.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.calibration import base_from_lidar, first_message, read_calibration, read_static_frames
from fieldtruth.bag.decode import points, stamp_ns
from fieldtruth.bag.reader import BagError
from fieldtruth.bag.run import Run
from fieldtruth.bag.trajectory import seconds
from fieldtruth.core import frames
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import CLASSES
from fieldtruth.experiment.camera_config import OPTICAL

CLOUDS: Final = "velodyne"
IMAGES: Final = {"left": "image_2", "right": "image_3"}
"""Folders of the colour images by side; KITTI's image_0 and image_1 are grey."""

_XYZ: Final = frozenset("xyz")


class Geometry(NamedTuple):
    """Projections and sensor poses, for calib.txt and the poses."""

    projection: Mapping[str, Array]
    """P (3, 4) [pixel] by side, from points in cam0."""
    base_from_cam0: Array
    base_from_lidar: Array

    @property
    def cam0_from_lidar(self) -> Array:
        """(4, 4), KITTI's Tr."""
        return frames.inverse(self.base_from_cam0) @ self.base_from_lidar


def has_cameras(run: Run) -> bool:
    """Whether the run has the calibration of a camera."""
    return any(table.camera_info(side) in run.counts for side in table.SIDES)


def read_geometry(run: Run) -> Geometry:
    """Read the poses of the sensors; a run without cameras has cam0 in the LiDAR's centre, and [1 | 0] as projections.

    So has a run with panoramas, which have no projection matrix.

    Raises:
        BagError: /tf_static or a camera's CameraInfo is missing or invalid.
    """
    if has_cameras(run) and not _are_panoramas(run):
        calibration = read_calibration(run)
        return Geometry(calibration.projection, calibration.base_from_optical["left"], calibration.base_from_lidar)
    base_from_sensor = base_from_lidar(run, read_static_frames(run))
    return Geometry(dict.fromkeys(table.SIDES, np.eye(3, 4)), base_from_sensor @ OPTICAL, base_from_sensor)


def require_pinholes(run: Run, form: str) -> None:
    """Check that the photographs are rectified, as ``form`` has them.

    Raises:
        BagError: the cameras have another lens.
    """
    for topic in map(table.camera_info, table.SIDES):
        info = first_message(run, topic)
        if info.distortion_model not in ("", "plumb_bob") or np.any(info.D):
            raise BagError(
                f"{form} has rectified photographs, and those of {run.bag} have the lens {info.distortion_model!r}; "
                f"rectify them with {topic}, or export as coco, webdataset or files, which keep the lens"
            )


def _are_panoramas(run: Run) -> bool:
    topics = [topic for topic in map(table.camera_info, table.SIDES) if topic in run.counts]
    return any(first_message(run, topic).distortion_model == "equirectangular" for topic in topics)


# ---------------------------------------------------------------------------------------------------------------------
# Text files


def calib_text(geometry: Geometry) -> str:
    """``calib.txt``; the grey cameras P0 and P1 of KITTI are those of the colour cameras P2 and P3."""
    left, right = (geometry.projection[side] for side in table.SIDES)
    rows = {"P0": left, "P1": right, "P2": left, "P3": right, "Tr": geometry.cam0_from_lidar}
    return "".join(f"{name}: {_row(matrix)}\n" for name, matrix in rows.items())


def poses_text(world_from_cam0: Array) -> str:
    """Poses (n, 4, 4) relative to the first, one row of 3 x 4 numbers each."""
    first_from_cam0 = frames.inverse(world_from_cam0[0]) @ world_from_cam0
    return "".join(f"{_row(pose)}\n" for pose in first_from_cam0)


def times_text(stamps_ns: Sequence[int]) -> str:
    """Stamps [ns] as seconds after the first, one line each."""
    return "".join(f"{seconds(stamp - stamps_ns[0])}\n" for stamp in stamps_ns)


def _row(matrix: Array) -> str:
    """Twelve numbers of (3, 4) or (4, 4), row by row; below 1e-12 is rounding error and becomes 0."""
    return " ".join(f"{value:.12e}" for value in np.round(matrix[:3], 12).ravel() + 0.0)


# ---------------------------------------------------------------------------------------------------------------------
# Clouds


class Returns(NamedTuple):
    """The LiDAR returns of a cloud (n): points with finite coordinates."""

    rows: NDArray[np.void]
    """Structured, with the cloud's own fields."""
    label: NDArray[np.uint8]
    """Class ids."""


def returns(cloud: Any, run: Run) -> Returns:
    """LiDAR returns of a sensor_msgs/PointCloud2; without ``label`` the intensity is the class, as in the paper.

    Raises:
        BagError: x, y, z or both label and intensity are missing, or a label is not a class id.
    """
    names = [field.name for field in cloud.fields]
    source = next((name for name in ("label", "intensity") if name in names), None)
    if source is None or not _XYZ.issubset(names):
        raise BagError(f"{_where(cloud, run)} must have x, y, z and label or intensity, got {', '.join(names)}")
    rows = returned(cloud, run)
    label = rows[source]
    if (odd := label[~np.isin(label, np.arange(len(CLASSES)))]).size:
        raise BagError(f"{_where(cloud, run)}: {source} must be a class from 0 to {len(CLASSES) - 1}, got {odd[0]}")
    return Returns(rows, label.astype(np.uint8))


def returned(cloud: Any, run: Run) -> NDArray[np.void]:
    """Structured array (n) of the points with finite coordinates, with the cloud's own fields.

    Raises:
        BagError: x, y or z is missing.
    """
    rows = points(cloud)
    if not _XYZ.issubset(names := rows.dtype.names or ()):
        raise BagError(f"{_where(cloud, run)} must have x, y and z, got {', '.join(names)}")
    finite = np.logical_and.reduce([np.isfinite(rows[axis]) for axis in "xyz"])
    return rows if finite.all() else rows[finite]


def xyz_and_zero(rows: NDArray[np.void]) -> NDArray[np.float32]:
    """(n, 4): x, y, z [m] and 0 as reflectance.

    Reflectance is not simulated; the bag's intensity is the class, which must not become an input of a network.
    """
    values: NDArray[np.float32] = np.zeros((len(rows), 4), "<f4")
    for column, axis in enumerate("xyz"):
        values[:, column] = rows[axis]
    return values


def _where(cloud: Any, run: Run) -> str:
    return f"the cloud at {stamp_ns(cloud.header)} ns in {run.bag}"
