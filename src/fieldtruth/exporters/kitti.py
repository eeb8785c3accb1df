# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export runs as KITTI odometry, and what the formats kitti-object and semantickitti share with it.

A sequence per run has clouds, photographs of a stereo pair, poses, times and calibration. A frame is a cloud, the
photographs with the same stamp, and the pose at that stamp (see ``paired``). Of a rig with several sensors these are of
the first sensor of clouds and the first stereo pair; without a pair image_2 is of the first camera.

Clouds are in the sensor's frame (x forward, y left, z up). cam0 is the left camera's optical frame; poses are those of
cam0 relative to its first. Tr takes points from the frame of the clouds to cam0.
"""

from collections.abc import Sequence
from functools import reduce
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import seconds
from fieldtruth.bag.readings import reflectivity
from fieldtruth.bag.run import Run
from fieldtruth.bag.stamps import nearest
from fieldtruth.bag.topics import Source
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.png import encode_png
from fieldtruth.core.readings import Cloud
from fieldtruth.core.yaml_io import package_data
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.exporters import Options
from fieldtruth.exporters.frames import chosen_of_many, first_of_clouds, first_views, noun_of, require_pinholes

CLOUDS: Final = "velodyne"
IMAGES: Final = ("image_2", "image_3")
"""Folders of the colour images, left and right; KITTI's image_0 and image_1 are grey."""
WINDOW_NS: Final = 500_000_000
"""Largest difference [ns] of the stamps of a cloud and its photographs."""
_EXACT_SHARE: Final = 0.1
"""Pairing is exact if at least this share of the clouds has photographs of its own stamp."""


class Geometry(NamedTuple):
    """Projections and sensor poses, for calib.txt and the poses."""

    projection: tuple[Array, Array]
    """P (3, 4) [pixel] of the left and right camera, from points in cam0; of a single camera twice the same."""
    base_from_cam0: Array
    base_from_cloud: Array

    @property
    def cam0_from_cloud(self) -> Array:
        """(4, 4), KITTI's Tr."""
        return transforms.inverse(self.base_from_cam0) @ self.base_from_cloud


def rectified_views(run: Run) -> list[Source]:
    """Return the views of a run whose frames have clouds, photographs and calibration, rectified, as KITTI's.

    Raises:
        BagError: it lacks one of them.
    """
    if not (views := first_views(run)):
        raise BagError(f"the rig of {run.bag} has no camera, and KITTI's frames have photographs")
    run.require(first_of_clouds(run).topic, *(view.info for view in views))
    require_pinholes(run, "KITTI")
    return views


def has_lens(run: Run) -> bool:
    """Return True if the run has the calibration of a view that ``first_views`` chooses."""
    return any(run.calibration.has_lens(view.name) for view in first_views(run))


def read_geometry(run: Run) -> Geometry:
    """Read the poses of the sensors; a run without cameras has cam0 where clouds are taken, and [1 | 0] as projections.

    So has a run with panoramas, which have no projection matrix.

    Raises:
        BagError: /tf_static or a camera's CameraInfo is missing or invalid, or the views differ in size.
    """
    views, calibration = first_views(run), run.calibration
    lenses = [calibration.lens(view.name) for view in views if calibration.has_lens(view.name)]
    if not lenses or any(lens.model == "equirectangular" for lens in lenses):
        base_from_sensor = calibration.base_from(first_of_clouds(run).name)
        return Geometry((np.eye(3, 4), np.eye(3, 4)), base_from_sensor @ OPTICAL, base_from_sensor)
    run.require(table.TF_STATIC, *(view.info for view in views))
    left, right = views[0].name, views[-1].name
    projection = calibration.projection(left), calibration.projection(right)
    sizes = [(lens.width, lens.height) for lens in lenses]
    if len({*sizes}) > 1:
        raise BagError(f"the cameras of {run.bag} differ in size: {sizes[0]} and {sizes[1]}")
    return Geometry(projection, calibration.base_from(left), calibration.base_from(first_of_clouds(run).name))


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
    rows = {"P0": left, "P1": right, "P2": left, "P3": right, "Tr": geometry.cam0_from_cloud}
    return "".join(f"{name}: {row_text(matrix)}\n" for name, matrix in rows.items())


def write_motion(run: Run, geometry: Geometry, stamps_ns: Sequence[int], folder: Path, poses: Path) -> Array:
    """Write times.txt and calib.txt of a sequence, and the file of its poses; return world_from_cam0 (4, 4) at first.

    Times are seconds after the first stamp [ns], poses relative to the first one, a row of 3 x 4 numbers each.
    """
    world_from_cam0 = np.array([run.trajectory.world_from_base(s) @ geometry.base_from_cam0 for s in stamps_ns])
    first_from_cam0 = transforms.inverse(world_from_cam0[0]) @ world_from_cam0
    texts = {
        poses: "".join(f"{row_text(pose)}\n" for pose in first_from_cam0),
        folder / "times.txt": "".join(f"{seconds(stamp - stamps_ns[0])}\n" for stamp in stamps_ns),
        folder / "calib.txt": calib_text(geometry),
    }
    for path, text in texts.items():
        path.write_text(text, encoding="ascii")
    return np.asarray(world_from_cam0[0])


def row_text(matrix: Array) -> str:
    """Twelve numbers of (3, 4) or (4, 4), row by row; below 1e-12 is rounding error and becomes 0."""
    return " ".join(f"{value:.12e}" for value in np.round(matrix[:3], 12).ravel() + 0.0)


# ---------------------------------------------------------------------------------------------------------------------
# Clouds


def write_cloud(path: Path, cloud: Cloud) -> None:
    """Write a cloud as ``xyz_and_reflectance``."""
    xyz_and_reflectance(cloud).tofile(path)


def xyz_and_reflectance(cloud: Cloud) -> NDArray[np.float32]:
    """(n, 4): x, y, z [m] and the reflectivity; 0 of a LiDAR without a signal.

    The bag's intensity is the class, which must not become an input of a network.
    """
    return np.concatenate([cloud.xyz, reflectivity(cloud)[:, None]], axis=1, dtype="<f4", casting="same_kind")


# ---------------------------------------------------------------------------------------------------------------------
# The format kitti

_TEXTS: Final = package_data("fieldtruth.exporters", "kitti.yaml")


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder ``target``: a sequence per run, the poses, and a README.

    Raises:
        BagError: a bag has no clouds, photographs, calibration or true poses, its cameras are no pinholes, or it is
            damaged.
    """
    for run in runs:
        run.require(*(view.topics["photo"] for view in rectified_views(run)))
    geometries = [read_geometry(run) for run in runs]
    (target / "poses").mkdir(parents=True)
    lines, choices = [], []
    for number, (run, geometry) in enumerate(zip(runs, geometries, strict=True)):
        name = f"{number:02d}"
        folder = target / "sequences" / name
        stamps_ns, apart_ns = _write_frames(run, folder, options)
        write_motion(run, geometry, stamps_ns, folder, target / "poses" / f"{name}.txt")
        lines.append(f"| {name} | {run.name} | {len(stamps_ns)} | {stamps_ns[0]} | {apart_ns / 1e6:g} ms |\n")
        if chosen := chosen_of_many(run):
            noun, views = noun_of([first_of_clouds(run)]), " and ".join(chosen.views)
            choices.append(f"\n{run.name}: {noun} {chosen.cloud}, photographs of {views}.\n")
    has_pair = any(len(first_views(run)) == 2 for run in runs)
    noun = noun_of(first_of_clouds(run) for run in runs)
    text = _TEXTS["readme"].format(noun=noun, **_TEXTS["pair" if has_pair else "single"])
    (target / "README.md").write_text(text + "".join(lines + choices), encoding="utf-8")


def _write_frames(run: Run, folder: Path, options: Options) -> tuple[list[int], int]:
    """Write the frames; return their stamps, and the largest difference [ns] of those of a cloud and its photographs.

    Raises:
        BagError: no cloud has photographs.
    """
    views = first_views(run)
    for name in (CLOUDS, *IMAGES[: len(views)]):
        (folder / name).mkdir(parents=True)
    clouds = run.readings(first_of_clouds(run).name, labelled=False)
    photos = [run.readings(view.name, ["photo"]) for view in views]

    def save(numbered: tuple[int, Pair]) -> tuple[int, int]:
        number, pair = numbered
        write_cloud(folder / CLOUDS / f"{number:06d}.bin", clouds.read(pair.cloud))
        for name, images, row in zip(IMAGES, photos, pair.images, strict=False):
            (folder / name / f"{number:06d}.png").write_bytes(encode_png(images.read(row).photo))
        return pair.stamp_ns, pair.apart_ns

    pairs = paired(clouds.stamps_ns, [images.stamps_ns for images in photos])
    if not pairs:
        what = "photographs of both cameras" if len(views) > 1 else "a photograph"
        raise BagError(f"{run.bag} has no cloud with {what} within {WINDOW_NS / 1e9} s")
    saved = list(options.each(f"{run.name}: frames", run, list(enumerate(pairs)), save))
    return [stamp for stamp, _ in saved], max(apart for _, apart in saved)
