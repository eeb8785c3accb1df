# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export runs as KITTI's tracking: photographs, clouds, calibration, and boxes with track ids of what can move.

A sequence per run; frames, sensors and boxes are those of the format ``kitti-object``. Lines are those of KITTI's
devkit for tracking, which TrackEval reads.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.bag.file import BagError
from fieldtruth.bag.run import Run
from fieldtruth.core.arrays import Array
from fieldtruth.core.png import encode_png
from fieldtruth.core.yaml_io import package_data
from fieldtruth.exporters import Options
from fieldtruth.exporters.frames import first_of_clouds
from fieldtruth.exporters.kitti import (
    CLOUDS,
    Geometry,
    Pair,
    paired,
    read_geometry,
    rectified_views,
    row_text,
    write_cloud,
)
from fieldtruth.exporters.kitti_object import KittiObjects, KittiRow

_TEXTS: Final = package_data("fieldtruth.exporters", "kitti_tracking.yaml")
TYPES: Final[dict[str, str]] = _TEXTS["types"]
"""KITTI's types by kind of an object."""
_SLIGHTLY, _HALF = 0.15, 0.5
"""Shares of a box outside the image up to which an object is not (0) or partly (1) truncated."""
_IMAGES: Final = "image_02"


class _Frame(NamedTuple):
    """Rows of a frame in the text files of a sequence."""

    stamp_ns: int
    world_from_cam0: Array
    labels: str
    extras: str


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder ``target``: a sequence per run, and a README.

    Raises:
        BagError: a bag lacks clouds, photographs, instance images, calibration or poses, its cameras are no pinholes,
            its world is not known, or nothing moves in any run.
    """
    for run in runs:
        view = rectified_views(run)[0]
        run.require(view.topics["photo"])
        run.require_instances(view.topics["instance"])
    require_movers(runs)
    folder, lines, sequences = target / "training", [], []
    for number, run in enumerate(runs):
        name = f"{number:04d}"
        frames = _write_frames(run, folder, name, options)
        texts = {
            "calib": _calib(read_geometry(run)),
            "label_02": "".join(frame.labels for frame in frames),
            "visibility": "".join(frame.extras for frame in frames),
            "poses": "".join(f"{row_text(frame.world_from_cam0)}\n" for frame in frames),
            "stamps": "".join(f"{frame.stamp_ns}\n" for frame in frames),
        }
        for part, text in texts.items():
            (folder / part).mkdir(exist_ok=True)
            (folder / part / f"{name}.txt").write_text(text, encoding="utf-8")
        sequences.append(f"{name} empty 000000 {len(frames):06d}\n")
        lines.append(f"| {name} | {run.name} | {len(frames)} |\n")
    (folder / "evaluate_tracking.seqmap.training").write_text("".join(sequences), encoding="ascii")
    types = ", ".join(f"{kind} is {name}" for kind, name in TYPES.items())
    readme = _TEXTS["readme"].replace("{types}", types)
    (target / "README.md").write_text(readme + "".join(lines), encoding="utf-8")


def require_movers(runs: Sequence[Run]) -> None:
    """Check that it is known what moves in runs beside their robots, and that something does.

    Raises:
        BagError: a bag has no experiment beside it, which says that, or nothing moves in any run.
    """
    if unknown := next((run for run in runs if run.experiment is None), None):
        raise BagError(f"{unknown.bag} has no experiment.yaml beside it, which says what moves")
    if not any(len(run.movers) for run in runs):
        raise BagError(f"nothing moves in {runs[0].bag} beside its robot, and tracks are those of what moves")


def _write_frames(run: Run, folder: Path, name: str, options: Options) -> list[_Frame]:
    """Write images and clouds of a sequence, and return its frames."""
    view = rectified_views(run)[0]
    with options.progress.stage("build the world"):
        objects = KittiObjects(run, view)
    clouds = run.readings(first_of_clouds(run).name, labelled=False)
    images = run.readings(view.name, ["photo", "instance"])
    geometry, trajectory = read_geometry(run), run.trajectory
    for part in (_IMAGES, CLOUDS):
        (folder / part / name).mkdir(parents=True)
    if not (pairs := paired(clouds.stamps_ns, [images.stamps_ns])):
        raise BagError(f"{run.bag} has no cloud with a photograph and an instance image")

    def save(numbered: tuple[int, Pair]) -> _Frame:
        number, pair = numbered
        image, cloud = images.read(pair.images[0]), clouds.read(pair.cloud)
        (folder / _IMAGES / name / f"{number:06d}.png").write_bytes(encode_png(image.photo))
        write_cloud(folder / CLOUDS / name / f"{number:06d}.bin", cloud)
        world_from_cam0 = trajectory.world_from_base(pair.stamp_ns) @ geometry.base_from_cam0
        rows = list(objects.rows(image, cloud, world_from_cam0, moving=True))
        labels = "".join(f"{number} {row.object_id} {_label(row)}" for row in rows)
        extras = "".join(f"{number} {row.extra()}" for row in rows)
        return _Frame(pair.stamp_ns, world_from_cam0, labels, extras)

    return list(options.each(f"{run.name}: frames and boxes", run, list(enumerate(pairs)), save))


def _label(row: KittiRow) -> str:
    level = 0 if row.truncated <= _SLIGHTLY else 1 if row.truncated <= _HALF else 2
    return row.label(TYPES.get(row.kind, "Misc"), str(level))


def _calib(geometry: Geometry) -> str:
    """Calibration of a sequence: names without a colon behind the projections, as KITTI's files of tracking have it."""
    left, right = geometry.projection
    rows = {
        "P0:": left,
        "P1:": right,
        "P2:": left,
        "P3:": right,
        "R_rect": np.eye(3),
        "Tr_velo_cam": geometry.cam0_from_cloud,
    }
    own = "".join(f"{name} {row_text(matrix)}\n" for name, matrix in rows.items())
    return f"{own}Tr_imu_velo {row_text(np.eye(3, 4))}\n"
