# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export runs in the form of the MOT Challenge: photographs, and boxes in them with track ids of what can move.

A sequence per run, of the first camera of the rig, whatever its lens. Columns are those of MOT16 (Milan et al., "MOT16:
A Benchmark for Multi-Object Tracking", 2016), which TrackEval and py-motmetrics read.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from fieldtruth.bag.file import BagError
from fieldtruth.bag.readings import stored_photo
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import Source
from fieldtruth.core.arrays import Counts
from fieldtruth.core.readings import Image
from fieldtruth.core.yaml_io import package_data
from fieldtruth.exporters import Options
from fieldtruth.exporters.amodal import WholeObjects, moving_world_of_run, visible_pixels
from fieldtruth.exporters.frames import first_views, unique_names
from fieldtruth.exporters.kitti_tracking import require_movers

_TEXTS: Final = package_data("fieldtruth.exporters", "mot.yaml")
CLASSES: Final[dict[str, int]] = _TEXTS["classes"]
"""Classes by kind of an object."""


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the folder ``target``: a sequence per run, and a README.

    Raises:
        BagError: a bag lacks photographs, instance images, calibration or poses, its world is not known, or nothing
            moves in any run.
    """
    for run in runs:
        if not (views := first_views(run)):
            raise BagError(f"the rig of {run.bag} has no camera, and frames of the MOT Challenge are photographs")
        run.require(views[0].topics["photo"])
        run.require_instances(views[0].topics["instance"])
    require_movers(runs)
    names = unique_names(runs)
    for run, name in zip(runs, names, strict=True):
        _write_sequence(run, first_views(run)[0], target / "train" / name, options)
    (target / "seqmaps").mkdir()
    (target / "seqmaps" / "train.txt").write_text("".join(f"{name}\n" for name in ("name", *names)), encoding="ascii")
    classes = ", ".join(f"{kind} is {number}" for kind, number in CLASSES.items())
    (target / "README.md").write_text(_TEXTS["readme"].replace("{classes}", classes), encoding="utf-8")


def _write_sequence(run: Run, view: Source, folder: Path, options: Options) -> None:
    with options.progress.stage("build the world"):
        world, moving = moving_world_of_run(run)
        whole = WholeObjects(world, view.config, moving)
    images, movers = run.readings(view.name, ["photo", "instance"]), run.movers
    base_from_optical, trajectory = run.calibration.base_from(view.name), run.trajectory
    for part in ("img1", "gt"):
        (folder / part).mkdir(parents=True)

    def save(row: int) -> tuple[str, str]:
        image: Image = images.read(row, ["instance"])
        assert image.instance is not None
        photo, suffix = stored_photo(images.message(row, "photo"), image.instance.shape)
        (folder / "img1" / f"{row + 1:06d}{suffix}").write_bytes(photo)
        world_from_optical = trajectory.world_from_base(image.stamp_ns) @ base_from_optical
        visible, lines = visible_pixels(image.instance, movers.by_id), []
        for mover in movers:
            alone = whole.silhouette(mover.object_id, world_from_optical, stamp_ns=image.stamp_ns)
            if alone.pixels:
                left, top, width, height = alone.bbox
                box, number = f"{left + 1},{top + 1},{width},{height}", CLASSES.get(mover.kind, _TEXTS["other"])
                share = min(1.0, visible.get(mover.object_id, 0) / alone.pixels)
                lines.append(f"{row + 1},{mover.object_id},{box},1,{number},{share:.4f}\n")
        return "".join(lines), suffix

    texts, suffixes = zip(*options.each(f"{run.name}: frames", run, range(len(images)), save), strict=True)
    (folder / "gt" / "gt.txt").write_text("".join(texts), encoding="ascii")
    (folder / "stamps.txt").write_text("".join(f"{stamp}\n" for stamp in images.stamps_ns), encoding="ascii")
    (folder / "seqinfo.ini").write_text(_seqinfo(folder.name, view, images.stamps_ns, suffixes[0]), encoding="ascii")


def _seqinfo(name: str, view: Source, stamps_ns: Counts, suffix: str) -> str:
    count, span = len(stamps_ns), int(stamps_ns[-1] - stamps_ns[0])
    rate = round((count - 1) * 1e9 / span) if span else 1
    rows = {"name": name, "imDir": "img1", "frameRate": max(1, rate), "seqLength": count}
    rows |= {"imWidth": view.config.width, "imHeight": view.config.height, "imExt": suffix}
    return "[Sequence]\n" + "".join(f"{key}={value}\n" for key, value in rows.items())
