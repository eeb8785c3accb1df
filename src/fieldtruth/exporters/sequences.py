# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What the formats kitti and semantickitti share: choice of sensors, geometry, poses, times, clouds.

These formats have one LiDAR and one pair of colour cameras: of a rig with several sensors they take the first LiDAR and
the first stereo pair. A rig without a pair has its first camera as the left one.

Clouds are in the LiDAR's frame (x forward, y left, z up). cam0 is the left camera's optical frame; poses are those of
cam0 relative to its first. Tr takes points from the LiDAR's frame to cam0.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.calibration import base_from_lidar, first_message, read_calibration, read_static_frames
from fieldtruth.bag.decode import points, reflectivity, stamp_ns
from fieldtruth.bag.reader import BagError
from fieldtruth.bag.run import Run
from fieldtruth.bag.trajectory import seconds
from fieldtruth.core import frames
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import CLASSES
from fieldtruth.sensors.camera.config import OPTICAL, Imager
from fieldtruth.sensors.camera.stereo_config import StereoConfig
from fieldtruth.sensors.lidar.config import LidarConfig

CLOUDS: Final = "velodyne"
IMAGES: Final = ("image_2", "image_3")
"""Folders of the colour images, left and right; KITTI's image_0 and image_1 are grey."""

_XYZ: Final = frozenset("xyz")


class Geometry(NamedTuple):
    """Projections and sensor poses, for calib.txt and the poses."""

    projection: tuple[Array, Array]
    """P (3, 4) [pixel] of the left and right camera, from points in cam0; of a single camera twice the same."""
    base_from_cam0: Array
    base_from_lidar: Array

    @property
    def cam0_from_lidar(self) -> Array:
        """(4, 4), KITTI's Tr."""
        return frames.inverse(self.base_from_cam0) @ self.base_from_lidar


def first_lidar(run: Run) -> LidarConfig:
    """Return the first LiDAR of the rig.

    Raises:
        BagError: the rig has none, or it has no clouds.
    """
    lidars = run.rig.lidars
    if not lidars:
        raise BagError(f"the rig of {run.bag} has no LiDAR, and this format is made of clouds")
    run.require(lidars[0].topic)
    return lidars[0]


def first_views(run: Run) -> list[Imager]:
    """Return the views of the first stereo pair of the rig, without a pair that of its first camera, if any."""
    cameras = run.rig.enabled(StereoConfig) or run.rig.cameras
    return [imager for camera in cameras[:1] for imager in camera.imagers()]


def chosen_of_many(run: Run) -> dict[str, Any]:
    """Names of LiDAR and cameras of a sequence; empty for a rig with one LiDAR, and one pair or no camera."""
    views = [imager.name for imager in first_views(run)]
    if len(run.rig.lidars) <= 1 and len(run.rig.cameras) <= 1 and len(views) != 1:
        return {}
    return {"lidar": run.rig.lidar.name, "cameras": views}


def has_cameras(run: Run) -> bool:
    """Whether the run has the calibration of a camera."""
    return any(imager.topic_of("camera_info") in run.counts for imager in first_views(run))


def read_geometry(run: Run) -> Geometry:
    """Read the poses of the sensors; a run without cameras has cam0 in the LiDAR's centre, and [1 | 0] as projections.

    So has a run with panoramas, which have no projection matrix.

    Raises:
        BagError: /tf_static or a camera's CameraInfo is missing or invalid.
    """
    views, lidar = first_views(run), first_lidar(run)
    if has_cameras(run) and not _are_panoramas(run):
        calibration = read_calibration(run, views, lidar)
        left, right = views[0].name, views[-1].name
        projection = calibration.projection[left], calibration.projection[right]
        return Geometry(projection, calibration.base_from_optical[left], calibration.base_from_lidar)
    base_from_sensor = base_from_lidar(run, read_static_frames(run), lidar)
    return Geometry((np.eye(3, 4), np.eye(3, 4)), base_from_sensor @ OPTICAL, base_from_sensor)


def require_pinholes(run: Run, form: str) -> None:
    """Check that the photographs are rectified, as ``form`` has them.

    Raises:
        BagError: the cameras have another lens.
    """
    for topic in (imager.topic_of("camera_info") for imager in first_views(run)):
        info = first_message(run, topic)
        if info.distortion_model not in ("", "plumb_bob") or np.any(info.D):
            raise BagError(
                f"{form} has rectified photographs, and those of {run.bag} have the lens {info.distortion_model!r}; "
                f"rectify them with {topic}, or export as coco, webdataset or files, which keep the lens"
            )


def _are_panoramas(run: Run) -> bool:
    topics = [imager.topic_of("camera_info") for imager in first_views(run)]
    return any(first_message(run, t).distortion_model == "equirectangular" for t in topics if t in run.counts)


# ---------------------------------------------------------------------------------------------------------------------
# Text files


def calib_text(geometry: Geometry) -> str:
    """``calib.txt``; the grey cameras P0 and P1 of KITTI are those of the colour cameras P2 and P3."""
    left, right = geometry.projection
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


def xyz_and_reflectance(rows: NDArray[np.void]) -> NDArray[np.float32]:
    """(n, 4): x, y, z [m] and the reflectivity; 0 of a LiDAR without a signal.

    The bag's intensity is the class, which must not become an input of a network.
    """
    values: NDArray[np.float32] = np.zeros((len(rows), 4), "<f4")
    for column, axis in enumerate("xyz"):
        values[:, column] = rows[axis]
    values[:, 3] = reflectivity(rows)
    return values


def _where(cloud: Any, run: Run) -> str:
    return f"the cloud at {stamp_ns(cloud.header)} ns in {run.bag}"
