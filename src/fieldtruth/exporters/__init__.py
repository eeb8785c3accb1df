# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A bag in other forms. Each form is a module with one function ``write``; here is the table and what all share.

A form is written under a temporary name and gets its own when it is whole; what is there already is never touched.
"""

import os
import shutil
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Final, NamedTuple

from fieldtruth.bag.run import Run, open_run
from fieldtruth.core.errors import OutputError, UnknownNameError
from fieldtruth.core.files import output_errors
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.ontology.label_map import LabelMap, label_map_of


class Format(NamedTuple):
    """A row of the table."""

    module: str
    """Where its ``write`` is, below this package."""
    ending: str
    """What follows the run's name in the output's name."""
    description: str
    relabels: bool = False
    """Whether it holds labels, which can be those of another ontology."""
    joins: bool = False
    """Whether several runs make one output, a sequence each."""


FORMATS: Final[dict[str, Format]] = {
    "files": Format(
        "files", "_files", "PNG, CSV, text files and class shares, as the paper publishes them", relabels=True
    ),
    "zip": Format("zipped", ".zip", "the bag, packed without loss, with its SHA-256"),
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
    """What a form's writer is told beside the runs and the target."""

    label_map: LabelMap | None
    """Labels to write; None keeps this package's classes."""
    workers: int
    progress: Progress


def export(
    path: Path | Sequence[Path],
    to: str,
    *,
    out: Path | None = None,
    label_map: str | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Path:
    """Write a run in another form.

    Args:
        path: folder of a run, or a bag; several of them for a form that joins them as sequences.
        to: the form, a key of ``FORMATS``.
        out: what to make; by default it stands beside the (first) bag, named after it.
        label_map: ontology of the labels; None keeps this package's classes.
        workers: threads; None takes every core that the process may use. The output does not depend on it.
        progress: is told how far the work has come.

    Returns:
        Path of what was made, ``out``.

    Raises:
        UnknownNameError: no such form or ontology.
        BagError: a bag that cannot be read, or that lacks what the form needs.
        OutputError: the output is there already or cannot be written, or the form cannot do what is asked.
    """
    form = _form_of(to)
    options = Options(
        None if label_map is None else _label_map_for(to, label_map),
        cpu_count() if workers is None else workers,
        Silent() if progress is None else progress,
    )
    runs = _runs_for(to, [path] if isinstance(path, Path) else list(path))
    target = runs[0].folder / (runs[0].name + form.ending) if out is None else out
    part = target.with_name(f".{target.name}.part")
    with output_errors(target):
        if os.path.lexists(target):
            raise OutputError(f"{target} is there already; remove it, or choose another --out")
        target.parent.mkdir(parents=True, exist_ok=True)
        _remove(part)
    write = import_module(f"fieldtruth.exporters.{form.module}").write
    try:
        with output_errors(target):
            write(runs, part, options)
            part.rename(target)
    finally:
        _remove(part)
    return target


def _form_of(to: str) -> Format:
    if to not in FORMATS:
        raise UnknownNameError("format", to, FORMATS)
    return FORMATS[to]


def _label_map_for(to: str, name: str) -> LabelMap:
    found = label_map_of(name)
    if not FORMATS[to].relabels:
        able = ", ".join(name for name, form in FORMATS.items() if form.relabels)
        raise OutputError(f"form {to!r} holds no labels that could be mapped; those that do: {able}")
    return found


def _runs_for(to: str, paths: Sequence[Path]) -> list[Run]:
    if len(paths) > 1 and not FORMATS[to].joins:
        able = ", ".join(name for name, form in FORMATS.items() if form.joins)
        raise OutputError(f"form {to!r} is made of one run, not of {len(paths)}; forms that join several: {able}")
    runs = [open_run(path) for path in paths]
    places = [run.bag.resolve() for run in runs]
    if twice := next((run.bag for run, place in zip(runs, places, strict=True) if places.count(place) > 1), None):
        raise OutputError(f"{twice} is given twice; each run can be one sequence")
    return runs


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


__all__ = ["FORMATS", "Format", "LabelMap", "Options", "Run", "export"]
