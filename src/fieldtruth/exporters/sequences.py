# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What the formats kitti and semantickitti share: choice of sensors, geometry, poses, times, clouds.

These formats have one LiDAR and one pair of colour cameras: of a rig with several sensors they take the first LiDAR and
the first stereo pair. A rig without a pair has its first camera as the left one.

Clouds are in the LiDAR's frame (x forward, y left, z up). cam0 is the left camera's optical frame; poses are those of
cam0 relative to its first. Tr takes points from the LiDAR's frame to cam0.
"""

from collections.abc import Sequence
from functools import reduce
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import seconds
from fieldtruth.bag.readings import nearest, reflectivity
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import Source
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.readings import Cloud, Image

CLOUDS: Final = "velodyne"
IMAGES: Final = ("image_2", "image_3")
"""Folders of the colour images, left and right; KITTI's image_0 and image_1 are grey."""
WINDOW_NS: Final = 500_000_000
"""Largest difference [ns] of the stamps of a cloud and its photographs."""
_EXACT_SHARE: Final = 0.1
"""Pairing is exact if at least this share of the clouds has photographs of its own stamp."""
OPTICAL: Final = transforms.pose((0.0, 0.0, 0.0), (-90.0, 0.0, -90.0))
"""The LiDAR's frame from an optical frame that looks along its x."""


class Geometry(NamedTuple):
    """Projections and sensor poses, for calib.txt and the poses."""

    projection: tuple[Array, Array]
    """P (3, 4) [pixel] of the left and right camera, from points in cam0; of a single camera twice the same."""
    base_from_cam0: Array
    base_from_lidar: Array

    @property
    def cam0_from_lidar(self) -> Array:
        """(4, 4), KITTI's Tr."""
        return transforms.inverse(self.base_from_cam0) @ self.base_from_lidar


def first_lidar(run: Run) -> Source:
    """Return the first LiDAR of the rig.

    Raises:
        BagError: the rig has none, or it has no clouds.
    """
    lidars = run.of(Cloud, recorded=False)
    if not lidars:
        raise BagError(f"the rig of {run.bag} has no LiDAR, and this format is made of clouds")
    run.require(lidars[0].topic)
    return lidars[0]


def first_views(run: Run) -> list[Source]:
    """Return the views of the first stereo pair of the rig, without a pair that of its first camera, if any."""
    views = run.of(Image, recorded=False)
    device = next((view.device for view in [view for view in views if view.side] or views), None)
    return [view for view in views if view.device == device]


def chosen_of_many(run: Run) -> dict[str, Any]:
    """Names of LiDAR and cameras of a sequence; empty for a rig with one LiDAR, and one pair or no camera."""
    views, lidars = [view.label for view in first_views(run)], run.of(Cloud, recorded=False)
    devices = {view.device for view in run.of(Image, recorded=False)}
    if len(lidars) <= 1 and len(devices) <= 1 and len(views) != 1:
        return {}
    return {"lidar": first_lidar(run).name, "cameras": views}


def has_cameras(run: Run) -> bool:
    """Whether the run has the calibration of a camera."""
    return any(run.calibration.has_lens(view.name) for view in first_views(run))


def read_geometry(run: Run) -> Geometry:
    """Read the poses of the sensors; a run without cameras has cam0 in the LiDAR's centre, and [1 | 0] as projections.

    So has a run with panoramas, which have no projection matrix.

    Raises:
        BagError: /tf_static or a camera's CameraInfo is missing or invalid, or the views differ in size.
    """
    views, calibration = first_views(run), run.calibration
    if not has_cameras(run) or _are_panoramas(run):
        base_from_sensor = calibration.base_from(first_lidar(run).name)
        return Geometry((np.eye(3, 4), np.eye(3, 4)), base_from_sensor @ OPTICAL, base_from_sensor)
    run.require(table.TF_STATIC, *(view.info for view in views))
    left, right = views[0].name, views[-1].name
    projection = calibration.projection(left), calibration.projection(right)
    sizes = [(lens.width, lens.height) for lens in (calibration.lens(view.name) for view in views)]
    if len({*sizes}) > 1:
        raise BagError(f"the cameras of {run.bag} differ in size: {sizes[0]} and {sizes[1]}")
    return Geometry(projection, calibration.base_from(left), calibration.base_from(first_lidar(run).name))


def require_pinholes(run: Run, form: str) -> None:
    """Check that the photographs are rectified, as ``form`` has them.

    Raises:
        BagError: the cameras have another lens.
    """
    for view in first_views(run):
        lens = run.calibration.lens(view.name)
        if not lens.is_pinhole:
            raise BagError(
                f"{form} has rectified photographs, and those of {run.bag} have the lens {lens.model!r}; "
                f"rectify them with {view.info}, or export as coco, webdataset or files, which keep the lens"
            )


def _are_panoramas(run: Run) -> bool:
    known = [view.name for view in first_views(run) if run.calibration.has_lens(view.name)]
    return any(run.calibration.lens(name).model == "equirectangular" for name in known)


class Pair(NamedTuple):
    """Rows of a cloud and of the photographs that belong to it, in the order of their cameras."""

    cloud: int
    images: tuple[int, ...]
    stamp_ns: int
    """Of the first photograph (cam0)."""
    apart_ns: int
    """Largest difference between the stamps."""


def paired(clouds: Counts, images: Sequence[Counts]) -> list[Pair]:
    """Pair clouds with photographs of one or several cameras, by their stamps [ns], which rise.

    At 10 and 25 Hz every second cloud has photographs with its stamp. With the nearest ones instead, every second pair
    would be 20 ms apart, 9 pixels for a robot that turns at 0.5 rad/s. So clouds without photographs of their own stamp
    are left out, unless a bag has (nearly) no others: then the nearest photographs are used, each once.
    """
    if not all(map(len, images)):
        return []
    common = reduce(np.intersect1d, [clouds, *images])
    if len(common) >= _EXACT_SHARE * len(clouds):
        rows = np.array([np.searchsorted(stamps, common) for stamps in (clouds, *images)])
        return [
            Pair(first, tuple(rest), stamp, 0)
            for stamp, (first, *rest) in zip(common.tolist(), rows.T.tolist(), strict=True)
        ]
    found: list[Pair] = []
    left = nearest(clouds, images[0])
    for row, first in enumerate(left.tolist()):
        stamp = images[0][first : first + 1]
        chosen = [first, *(int(nearest(stamp, others)[0]) for others in images[1:])]
        stamps = [int(clouds[row]), *(int(each[k]) for each, k in zip(images, chosen, strict=True))]
        apart = max(stamps) - min(stamps)
        if apart <= WINDOW_NS and not (found and found[-1].stamp_ns == stamps[1]):
            found.append(Pair(row, tuple(chosen), stamps[1], apart))
    return found


# ---------------------------------------------------------------------------------------------------------------------
# Text files


def calib_text(geometry: Geometry) -> str:
    """``calib.txt``; the grey cameras P0 and P1 of KITTI are those of the colour cameras P2 and P3."""
    left, right = geometry.projection
    rows = {"P0": left, "P1": right, "P2": left, "P3": right, "Tr": geometry.cam0_from_lidar}
    return "".join(f"{name}: {_row(matrix)}\n" for name, matrix in rows.items())


def poses_text(world_from_cam0: Array) -> str:
    """Poses (n, 4, 4) relative to the first, one row of 3 x 4 numbers each."""
    first_from_cam0 = transforms.inverse(world_from_cam0[0]) @ world_from_cam0
    return "".join(f"{_row(pose)}\n" for pose in first_from_cam0)


def times_text(stamps_ns: Sequence[int]) -> str:
    """Stamps [ns] as seconds after the first, one line each."""
    return "".join(f"{seconds(stamp - stamps_ns[0])}\n" for stamp in stamps_ns)


def _row(matrix: Array) -> str:
    """Twelve numbers of (3, 4) or (4, 4), row by row; below 1e-12 is rounding error and becomes 0."""
    return " ".join(f"{value:.12e}" for value in np.round(matrix[:3], 12).ravel() + 0.0)


# ---------------------------------------------------------------------------------------------------------------------
# Clouds


def xyz_and_reflectance(cloud: Cloud) -> NDArray[np.float32]:
    """(n, 4): x, y, z [m] and the reflectivity; 0 of a LiDAR without a signal.

    The bag's intensity is the class, which must not become an input of a network.
    """
    return np.concatenate([cloud.xyz, reflectivity(cloud)[:, None]], axis=1, dtype="<f4", casting="same_kind")
