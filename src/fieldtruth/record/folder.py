# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The folder of a run: what may be written there, and how an interrupted run is resumed.

OUT/NAME/experiment.yaml is written as soon as the robot has reached its goal, and track.csv beside it if the robot
followed a track file; OUT/NAME/.slices holds the finished time slices; OUT/NAME/NAME.bag appears last, after the data
card, made_by.json and the checksums. No other file is touched, except temporary ones, which are hidden and end in
.part. A run that fails before it senses anything (its route leads through a tree) leaves the folder as it was.
"""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final, NamedTuple

from fieldtruth.bag.file import CARD, EXPERIMENT, MADE_BY, TRACK
from fieldtruth.bag.provenance import CHECKSUMS, checksum_lines, sha256_of
from fieldtruth.core.errors import FieldtruthError, OutputError
from fieldtruth.core.files import output_errors, remove, replace_synced, write_atomically
from fieldtruth.core.locks import locked
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment, parse_experiment

_SLICES: Final = ".slices"
_PARTS: Final = ".*.part"
"""Temporary files, which a killed run leaves behind."""


class RunFolder(NamedTuple):
    """The files of one run."""

    path: Path
    bag: Path

    def begin(self, experiment: Experiment, *, overwrite: bool, track: str | None = None) -> None:
        """Write experiment.yaml and remove the outputs of an earlier run; with ``overwrite`` also its slices.

        ``track`` is the text of track.csv, in an experiment with a track file.
        """
        with output_errors(self.path, resumes=True):
            if overwrite:
                self.clean()
            for path in (self.bag, *map(self.path.joinpath, (CARD, MADE_BY, CHECKSUMS)), *self.path.glob(_PARTS)):
                remove(path)
            if track is not None:
                write_atomically(self.path / TRACK, track)
            write_atomically(self.path / EXPERIMENT, dump_experiment(experiment))

    def slices(self, key: str) -> Path:
        """Create the folder for the slices of one input, named by its key; slices of other inputs are removed."""
        folder = self.path / _SLICES / key
        with output_errors(folder, resumes=True):
            folder.mkdir(parents=True, exist_ok=True)
            for other in folder.parent.iterdir():
                if other != folder:
                    shutil.rmtree(other)
        return folder

    def finish(self, bag: Path, card: str, made_by: str) -> None:
        """Write data card, made_by.json and checksums, move the bag to its name, and remove the slices."""
        with output_errors(self.path, resumes=True):
            write_atomically(self.path / CARD, card)
            write_atomically(self.path / MADE_BY, made_by)
            stored = [TRACK] * (self.path / TRACK).exists()
            sums = checksum_lines(self.path, [EXPERIMENT, *stored, CARD, MADE_BY])
            write_atomically(self.path / CHECKSUMS, f"{sha256_of(bag)}  {self.bag.name}\n{sums}")
            replace_synced(bag, self.bag)
        self.clean()

    def clean(self) -> None:
        """Remove the slices and temporary files."""
        shutil.rmtree(self.path / _SLICES, ignore_errors=True)
        for part in self.path.glob(_PARTS):
            remove(part)


@contextmanager
def run_folder(
    experiment: Experiment, path: Path, *, overwrite: bool = False, track: str | None = None
) -> Iterator[RunFolder]:
    """Open the folder of a run, OUT/NAME, and lock it against other processes; ``track`` is the text of its track.csv.

    Raises:
        OutputError: the folder holds a finished bag or another experiment and ``overwrite`` is off, is in use, lies
            outside OUT through a link, or cannot be written.
    """
    out = path.parent
    with new_folder(path):
        if not path.resolve().is_relative_to(out.resolve()) or (path / _SLICES).is_symlink():
            raise OutputError(f"{path} leads out of {out} through a link; remove the link or choose another folder")
        run = RunFolder(path, path / f"{experiment.name}.bag")
        with locked(path):
            if not overwrite:
                _refuse_occupied(run, experiment, track)
            yield run


def clean_finished(path: Path) -> None:
    """Remove what is left beside a finished bag by a process that was killed just then.

    Raises:
        OutputError: the folder is in use, or cannot be written.
    """
    with locked(path), output_errors(path):
        RunFolder(path, path).clean()


def is_in_use(path: Path) -> bool:
    """Return whether a process has locked the folder of a run."""
    if not any(path.glob(".lock*")):
        return False
    try:
        with locked(path):
            return False
    except OutputError:
        return True


@contextmanager
def new_folder(path: Path, output: Path | None = None) -> Iterator[None]:
    """Make a folder and its parents; if the block raises, those that are new and still empty are removed.

    Errors name ``output``, the file for which the folder is needed, or the folder itself.

    Raises:
        OutputError: the folder cannot be made.
    """
    new = [folder for folder in (path, *path.parents) if not folder.exists()]
    with output_errors(path if output is None else output):
        path.mkdir(parents=True, exist_ok=True)
    try:
        yield
    except BaseException:
        for folder in new:
            with suppress(OSError):
                folder.rmdir()
        raise


def _refuse_occupied(run: RunFolder, experiment: Experiment, track: str | None) -> None:
    differences = _differences(run.path / EXPERIMENT, experiment)
    stored = run.path / TRACK
    if not differences and track is not None and stored.exists() and stored.read_bytes() != track.encode():
        differences = f"different: {TRACK}"
    if differences:
        raise OutputError(
            f"{run.path} holds another experiment ({differences}); choose another --out, or replace it with --overwrite"
        )
    if run.bag.exists():
        run.clean()
        raise OutputError(f"{run.bag} is already finished; choose another --out, or replace it with --overwrite")


def _differences(path: Path, experiment: Experiment) -> str:
    """Keys in which the experiment in a file differs from this one; empty without a difference, or without a file."""
    if not path.exists():
        return ""
    try:
        stored = parse_experiment(path.read_text(encoding="utf-8")).model_dump()
    except (FieldtruthError, OSError, ValueError):
        return f"its {path.name} cannot be read"
    keys = [key for key, value in experiment.model_dump().items() if stored[key] != value]
    return f"different: {', '.join(keys)}" if keys else ""
