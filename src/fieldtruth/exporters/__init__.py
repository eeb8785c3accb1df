# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export runs to other formats: the table of formats, and what all of them share.

Each format is a module with one function ``write``. The output is written under a temporary name and renamed when it is
complete; existing files are never overwritten.
"""

import os
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Final, NamedTuple

from fieldtruth.bag.run import Run, open_run
from fieldtruth.core.errors import OutputError, UnknownNameError
from fieldtruth.core.files import output_errors, remove
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.ontology.label_map import LabelMap, label_map_of


class Format(NamedTuple):
    """A row of the table."""

    module: str
    """Module of this package with the function ``write(runs, target, options)``."""
    suffix: str
    """Added to the run's name for the default output path."""
    description: str
    relabels: bool = False
    """Whether it has labels, which can be mapped to another ontology."""
    joins: bool = False
    """Whether several runs can become one output, a sequence each."""


FORMATS: Final[dict[str, Format]] = {
    "files": Format(
        "files", "_files", "PNG, CSV, text files and class shares, as the paper publishes them", relabels=True
    ),
    "zip": Format("zipped", ".zip", "the bag, compressed, with its SHA-256"),
    "semantickitti": Format(
        "semantickitti", "_semantickitti", "clouds with labels, poses, calibration", relabels=True, joins=True
    ),
    "kitti": Format("kitti", "_kitti", "KITTI odometry: images, clouds, poses, calibration", joins=True),
    "tum": Format("tum", ".tum", "the true trajectory as a text file"),
    "mcap": Format("mcap", ".mcap", "ROS 2 messages (CDR), for ROS 2 and Foxglove"),
    "coco": Format("coco", "_coco", "COCO panoptic and detection JSON with images", relabels=True),
    "pcd": Format("pcd", "_pcd", "a PCD file per cloud with labels and colours", relabels=True),
}


class Options(NamedTuple):
    """What every ``write`` takes beside the runs and the target."""

    label_map: LabelMap | None
    """Labels to write; None keeps fieldtruth's classes."""
    workers: int
    progress: Progress


def export(
    path: Path | str | Sequence[Path | str],
    to: str,
    *,
    out: Path | str | None = None,
    label_map: str | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Path:
    """Export a run to another format.

    Args:
        path: folder of a run, or a bag; several for a format that joins them as sequences.
        to: the format, a key of ``FORMATS``.
        out: path of the output, by default beside the (first) bag and named after it.
        label_map: ontology of the labels; None keeps fieldtruth's classes.
        workers: threads; None uses all available cores. The output does not depend on it.
        progress: receives the progress.

    Returns:
        Path of the output.

    Raises:
        UnknownNameError: an unknown format or ontology.
        BagError: a bag cannot be read, or lacks what the format needs.
        OutputError: the output already exists or cannot be written, or the format does not support what is asked.
    """
    if to not in FORMATS:
        raise UnknownNameError("format", to, FORMATS)
    options = Options(
        None if label_map is None else _label_map_for(to, label_map),
        cpu_count() if workers is None else workers,
        Silent() if progress is None else progress,
    )
    runs = _runs_for(to, [path] if isinstance(path, Path | str) else path)
    target = runs[0].folder / (runs[0].name + FORMATS[to].suffix) if out is None else Path(out)
    part = target.with_name(f".{target.name}.part")
    write = _writer(to)
    with output_errors(target):
        if os.path.lexists(target):
            raise OutputError(f"{target} already exists; remove it, or choose another --out")
        target.parent.mkdir(parents=True, exist_ok=True)
        remove(part)
    try:
        with output_errors(target):
            write(runs, part, options)
            part.rename(target)
    finally:
        remove(part)
    return target


def _writer(to: str) -> Callable[[Sequence[Run], Path, Options], None]:
    try:
        write: Callable[[Sequence[Run], Path, Options], None]
        write = import_module(f"fieldtruth.exporters.{FORMATS[to].module}").write
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != to:
            raise
        raise OutputError(f"the {to} library is not installed; run: pip install 'fieldtruth[{to}]'") from error
    return write


def _label_map_for(to: str, name: str) -> LabelMap:
    found = label_map_of(name)
    if not FORMATS[to].relabels:
        able = ", ".join(name for name, row in FORMATS.items() if row.relabels)
        raise OutputError(f"format {to!r} has no labels to map; formats with labels: {able}")
    return found


def _runs_for(to: str, paths: Sequence[Path | str]) -> list[Run]:
    if len(paths) > 1 and not FORMATS[to].joins:
        able = ", ".join(name for name, row in FORMATS.items() if row.joins)
        raise OutputError(f"format {to!r} takes one run, got {len(paths)}; formats that join several: {able}")
    runs = [open_run(path) for path in paths]
    bags = [run.bag.resolve() for run in runs]
    if twice := next((run.bag for run, bag in zip(runs, bags, strict=True) if bags.count(bag) > 1), None):
        raise OutputError(f"{twice} is given twice; each run can be one sequence")
    return runs


__all__ = ["FORMATS", "Format", "LabelMap", "Options", "Run", "export"]
