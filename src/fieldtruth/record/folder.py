# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The folder of a run: what may be written there, what is there already, and what a run that was stopped left behind.

OUT/NAME/NAME.bag appears when the run is complete, after its card and its checksums; OUT/NAME/experiment.yaml says what
the folder is for as soon as the robot has reached its goal; OUT/NAME/.slices holds the finished slices until then.
Nothing else is ever touched, and a run that ends before it begins to sense (a route that leads into a tree) leaves
everything as it was.
"""

import contextlib
import dataclasses
import fcntl
import hashlib
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

import fieldtruth
from fieldtruth.bag.checksums import CHECKSUMS, checksum_lines, sha256_of
from fieldtruth.bag.run import CARD
from fieldtruth.core.errors import FieldtruthError, OutputError
from fieldtruth.core.files import output_errors
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment, parse_experiment

_WORK: Final = ".slices"
_EXPERIMENT: Final = "experiment.yaml"


class RunFolder(NamedTuple):
    """The files of one run."""

    path: Path
    bag: Path

    def begin(self, experiment: Experiment, *, overwrite: bool) -> None:
        """Write down what the folder is for; with ``overwrite`` what it holds of an earlier run goes now."""
        with output_errors(self.path):
            if overwrite:
                self.clean()
            for path in (self.bag, self.path / CARD, self.path / CHECKSUMS):
                path.unlink(missing_ok=True)
            _write_whole(self.path / _EXPERIMENT, dump_experiment(experiment))

    def work(self, fingerprint: str) -> Path:
        """Make the folder for slices of exactly this input; those of any other input are stale and go."""
        work = self.path / _WORK / fingerprint[:16]
        with output_errors(work):
            work.mkdir(parents=True, exist_ok=True)
            for other in work.parent.iterdir():
                if other != work:
                    shutil.rmtree(other)
        return work

    def finish(self, bag: Path, card: str) -> None:
        """Write card and checksums, and give a bag that was made in the work folder its name; then the work is done."""
        with output_errors(self.path):
            _write_whole(self.path / CARD, card)
            sums = f"{sha256_of(bag)}  {self.bag.name}\n" + checksum_lines(self.path, [_EXPERIMENT, CARD])
            _write_whole(self.path / CHECKSUMS, sums)
            bag.replace(self.bag)
        self.clean()

    def clean(self) -> None:
        """Remove the slices; the bag holds them all."""
        shutil.rmtree(self.path / _WORK, ignore_errors=True)


@contextmanager
def run_folder(experiment: Experiment, out: Path, *, overwrite: bool = False) -> Iterator[RunFolder]:
    """Open OUT/NAME for a run; no other process gets it until this one is done. An unfinished run is taken up again.

    Raises:
        OutputError: the folder holds a finished bag or another experiment and ``overwrite`` is off, is in use, lies
            outside ``out`` through a link, or cannot be written.
    """
    path = out / experiment.name
    new = [folder for folder in (path, *path.parents) if not folder.exists()]
    with output_errors(path):
        path.mkdir(parents=True, exist_ok=True)
    if not path.resolve().is_relative_to(out.resolve()) or (path / _WORK).is_symlink():
        raise OutputError(f"{path} leads out of {out} through a link; remove the link or choose another folder")
    run = RunFolder(path, path / f"{experiment.name}.bag")
    with locked(path):
        if not overwrite:
            _refuse_occupied(run, experiment)
        try:
            yield run
        except BaseException:
            with contextlib.suppress(OSError):  # those that are not empty stay
                for folder in new:
                    folder.rmdir()
            raise


def fingerprint(*parts: object) -> str:
    """SHA-256 of this package's code and of dataclasses, mappings, sequences and arrays, value by value.

    Equal inputs to equal code have equal fingerprints; so slices are never joined with those of another version.
    """
    digest = hashlib.sha256()
    package = Path(fieldtruth.__file__).parent
    _feed(digest, [(str(path.relative_to(package)), path.read_bytes()) for path in sorted(package.rglob("*.py"))])
    _feed(digest, parts)
    return digest.hexdigest()


def _feed(digest: "hashlib._Hash", value: object) -> None:
    if isinstance(value, np.ndarray):
        digest.update(f"{value.dtype}{value.shape}".encode())
        digest.update(np.ascontiguousarray(value).data)
    elif dataclasses.is_dataclass(value):
        _feed(digest, [(field.name, getattr(value, field.name)) for field in dataclasses.fields(value)])
    elif isinstance(value, Mapping):
        _feed(digest, list(value.items()))
    elif isinstance(value, bytes):
        digest.update(f"{len(value)}:".encode() + value)
    elif isinstance(value, Sequence) and not isinstance(value, str):
        digest.update(f"{len(value)}:".encode())
        for item in value:
            _feed(digest, item)
    else:
        digest.update(repr(value).encode())


def _refuse_occupied(run: RunFolder, experiment: Experiment) -> None:
    differences = _differences(run.path / _EXPERIMENT, experiment)
    if differences:
        raise OutputError(
            f"{run.path} holds another experiment ({differences}); choose another --out, or --overwrite replaces it"
        )
    if run.bag.exists():
        run.clean()
        raise OutputError(f"{run.bag} is finished already; choose another --out, or --overwrite makes it again")


def _differences(path: Path, experiment: Experiment) -> str:
    """In which keys the experiment in a file differs from this one; empty if in none, or if there is no file."""
    if not path.exists():
        return ""
    try:
        theirs = parse_experiment(path.read_text(encoding="utf-8")).model_dump()
    except (FieldtruthError, OSError, ValueError):
        return f"its {path.name} cannot be read"
    keys = [key for key, value in experiment.model_dump().items() if theirs[key] != value]
    return f"other: {', '.join(keys)}" if keys else ""


def _write_whole(path: Path, text: str) -> None:
    part = path.with_name(path.name + ".part")
    part.write_text(text, encoding="utf-8")
    part.replace(path)


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the folder; the system lets go of it when the process ends, however it ends."""
    handle = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        raise OutputError(f"{path} is in use: another run is writing there; wait for it or stop it") from None
    try:
        yield
    finally:
        os.close(handle)
