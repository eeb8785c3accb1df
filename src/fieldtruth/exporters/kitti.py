# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export runs as KITTI odometry: stereo photographs, clouds, poses, times and calibration, one sequence per run.

A frame is a cloud, both photographs with the same stamp, and the pose at that stamp (see ``sequences.paired``). In a
rig with several sensors these are of the first LiDAR and the first stereo pair; without a pair image_2 is of the first
camera.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.bag.file import BagError
from fieldtruth.bag.run import Run
from fieldtruth.core.parallel import in_order
from fieldtruth.core.png import encode_png
from fieldtruth.core.progress import counted
from fieldtruth.exporters import Options
from fieldtruth.exporters.sequences import (
    CLOUDS,
    IMAGES,
    WINDOW_NS,
    Geometry,
    Pair,
    calib_text,
    chosen_of_many,
    first_lidar,
    first_views,
    paired,
    poses_text,
    read_geometry,
    require_pinholes,
    times_text,
    xyz_and_reflectance,
)

_README: Final = """\
# Runs as KITTI odometry sequences

- `sequences/NN/image_2`, `image_3`: photographs of the left and right camera (PNG), rectified.
- `sequences/NN/velodyne`: clouds, float32 x, y, z [m] (x forward, y left, z up) and reflectivity, 0 of a LiDAR
  without a signal.
- `sequences/NN/times.txt`: seconds after the sequence's first frame.
- `sequences/NN/calib.txt`: projections P0 to P3 (P0 = P2 left, P1 = P3 right); Tr, from the LiDAR to the left camera.
- `poses/NN.txt`: true pose of the left camera (x right, y down, z forward) relative to its first, 3 x 4 numbers a row.

A frame is a cloud and the photographs with the same stamp; other clouds are left out (the format semantickitti has
them all). Only if (nearly) no stamps agree, the nearest photographs are used; times and poses are then those of the
left photograph.

| sequence | run | frames | first stamp [ns] | most between cloud and photographs |
|---|---|---|---|---|
"""


class _Written(NamedTuple):
    """The frames written of a run."""

    stamps_ns: list[int]
    apart_ns: int
    """Largest difference between the stamps of a cloud and its photographs."""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder ``target``: a sequence per run, the poses, and a README.

    Raises:
        BagError: a bag has no clouds, photographs, calibration or true poses, its cameras are no pinholes, or it is
            damaged.
    """
    for run in runs:
        if not (views := first_views(run)):
            raise BagError(f"the rig of {run.bag} has no camera, and KITTI's frames have photographs")
        run.require(first_lidar(run).topic, *(view.topics["photo"] for view in views), *(view.info for view in views))
        require_pinholes(run, "KITTI")
    geometries = [read_geometry(run) for run in runs]
    (target / "poses").mkdir(parents=True)
    lines, choices = [], []
    for number, (run, geometry) in enumerate(zip(runs, geometries, strict=True)):
        done = _write_sequence(run, geometry, target, f"{number:02d}", options)
        cells = f"{run.name} | {len(done.stamps_ns)} | {done.stamps_ns[0]} | {done.apart_ns / 1e6:g} ms"
        lines.append(f"| {number:02d} | {cells} |\n")
        if chosen := chosen_of_many(run):
            choices.append(
                f"\n{run.name}: LiDAR {chosen['lidar']}, photographs of {' and '.join(chosen['cameras'])}.\n"
            )
    (target / "README.md").write_text(_README + "".join(lines + choices), encoding="utf-8")


def _write_sequence(run: Run, geometry: Geometry, target: Path, name: str, options: Options) -> _Written:
    trajectory, folder = run.trajectory, target / "sequences" / name
    done = _write_frames(run, folder, options)
    world_from_cam0 = [trajectory.world_from_base(stamp) @ geometry.base_from_cam0 for stamp in done.stamps_ns]
    (target / "poses" / f"{name}.txt").write_text(poses_text(np.array(world_from_cam0)), encoding="ascii")
    (folder / "times.txt").write_text(times_text(done.stamps_ns), encoding="ascii")
    (folder / "calib.txt").write_text(calib_text(geometry), encoding="ascii")
    return done


def _write_frames(run: Run, folder: Path, options: Options) -> _Written:
    views = first_views(run)
    for name in (CLOUDS, *IMAGES[: len(views)]):
        (folder / name).mkdir(parents=True)
    clouds = run.readings(first_lidar(run).name, labelled=False)
    photos = [run.readings(view.name, ["photo"]) for view in views]

    def save(numbered: tuple[int, Pair]) -> tuple[int, int]:
        number, pair = numbered
        xyz_and_reflectance(clouds.read(pair.cloud)).tofile(folder / CLOUDS / f"{number:06d}.bin")
        for name, images, row in zip(IMAGES, photos, pair.images, strict=False):
            (folder / name / f"{number:06d}.png").write_bytes(encode_png(images.read(row).photo))
        return pair.stamp_ns, pair.apart_ns

    pairs = paired(clouds.stamps_ns, [images.stamps_ns for images in photos])
    with options.progress.stage(f"{run.name}: frames", run.duration_s) as advance:
        work = in_order(enumerate(pairs), save, options.workers)
        saved = list(counted(work, advance, run.duration_s, len(pairs)))
    if not saved:
        what = "photographs of both cameras" if len(views) > 1 else "a photograph"
        raise BagError(f"{run.bag} has no cloud with {what} within {WINDOW_NS / 1e9} s")
    return _Written([stamp for stamp, _ in saved], max(apart for _, apart in saved))
