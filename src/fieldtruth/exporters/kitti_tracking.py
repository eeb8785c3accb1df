# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export runs as KITTI's tracking: photographs, clouds, calibration, and boxes with track ids of what can move.

A sequence per run; frames, sensors and boxes are those of the format ``kitti-object``. Lines are those of KITTI's
devkit for tracking, which TrackEval reads.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from fieldtruth.bag.file import BagError
from fieldtruth.bag.run import Run
from fieldtruth.core.yaml_io import package_data
from fieldtruth.exporters import Options
from fieldtruth.exporters.kitti import CLOUDS, Geometry, calib_text, read_geometry, row_text
from fieldtruth.exporters.kitti_object import KittiRow, require_instances, write_frames

_TEXTS: Final = package_data("fieldtruth.exporters", "kitti_tracking.yaml")
TYPES: Final[dict[str, str]] = _TEXTS["types"]
"""KITTI's types by kind of an object."""
_SLIGHTLY, _HALF = 0.15, 0.5
"""Shares of a box outside the image up to which an object is not (0) or partly (1) truncated."""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder ``target``: a sequence per run, and a README.

    Raises:
        BagError: a bag lacks clouds, photographs, instance images, calibration or poses, its cameras are no pinholes,
            its world is not known, or nothing moves in any run.
    """
    for run in runs:
        require_instances(run)
    require_movers(runs)
    folder, lines, sequences = target / "training", [], []
    for number, run in enumerate(runs):
        name = f"{number:04d}"
        frames = write_frames(run, (folder / "image_02" / name, folder / CLOUDS / name), options, _lines, moving=True)
        texts = {
            "calib": _calib(read_geometry(run)),
            "label_02": "".join(frame.text[0] for frame in frames),
            "visibility": "".join(frame.text[1] for frame in frames),
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


def _lines(number: int, rows: list[KittiRow]) -> tuple[str, str]:
    """Lines of a frame in ``label_02`` and in ``visibility``."""
    labels = "".join(f"{number} {row.object_id} {_label(row)}" for row in rows)
    return labels, "".join(f"{number} {row.extra()}" for row in rows)


def _label(row: KittiRow) -> str:
    level = 0 if row.truncated <= _SLIGHTLY else 1 if row.truncated <= _HALF else 2
    return row.label(TYPES.get(row.kind, "Misc"), str(level))


def _calib(geometry: Geometry) -> str:
    """Calibration of a sequence: names without a colon behind the projections, as KITTI's files of tracking have it."""
    own = calib_text(geometry).replace("Tr:", "Tr_velo_cam")
    return f"{own}R_rect {row_text(np.eye(3))}\nTr_imu_velo {row_text(np.eye(3, 4))}\n"
