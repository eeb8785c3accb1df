# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One run of a campaign: made, or the rest of it, and recorded."""

from collections.abc import Callable
from pathlib import Path
from time import monotonic
from typing import Final

import fieldtruth
from fieldtruth.bag.decode import count_messages
from fieldtruth.bag.provenance import CHECKSUMS, read_checksums, sha256_of
from fieldtruth.bag.run import EXPERIMENT, open_run
from fieldtruth.campaign.draw import PlannedRun
from fieldtruth.campaign.manifest import FAILURE, MANIFEST, Failure, Manifest, digest_of, failure_of
from fieldtruth.campaign.stages import CACHED, Stages
from fieldtruth.campaign.state import state_of
from fieldtruth.core.errors import (
    ClusterError,
    ConfigurationError,
    DriveError,
    EngineError,
    FieldtruthError,
    OutputError,
    RouteError,
    TrackError,
    UnknownNameError,
)
from fieldtruth.core.progress import Progress
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment
from fieldtruth.pipeline import generate
from fieldtruth.record.folder import clean_finished
from fieldtruth.record.following import without_wheels

STOPPING: Final = (ClusterError, EngineError, OutputError)
"""Errors that other runs would meet, too."""
FINAL: Final = (ConfigurationError, DriveError, RouteError, TrackError, UnknownNameError)
"""Errors that the same version repeats."""

Generate = Callable[..., Path]
"""A function with the arguments of ``fieldtruth.generate``."""


def run_one(
    run: PlannedRun,
    out: Path,
    *,
    workers: int | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
    generate: Generate = generate,
) -> Manifest | Failure:
    """Make one run in OUT/SPLIT/NAME, or what is missing of it, and record its manifest or its failure there.

    A finished bag of this experiment whose checksum fits gets its manifest; one whose checksum does not is replaced,
    and with ``overwrite`` every earlier one.

    Raises:
        OutputError: the folder is in use, holds another experiment, or cannot be written; nothing is recorded.
        ClusterError, EngineError: no run can be made with this cluster or this machine's Embree.
        KeyboardInterrupt: finished slices are kept.
    """
    start, stages = monotonic(), Stages(progress)
    folder = run.folder(out)
    try:
        done = None if overwrite else state_of(run, out).manifest
        if done is not None:  # another process has been faster
            return done
        if not overwrite and _holds(folder, run.experiment):
            if _is_sound(folder, run.experiment):
                clean_finished(folder)
                return write_manifest(run, out, monotonic() - start, 0.0)
            overwrite = True
        (folder / MANIFEST).unlink(missing_ok=True)
        generate(run.experiment, folder.parent, workers=workers, overwrite=overwrite, progress=stages)
    except STOPPING:
        raise
    except Exception as error:  # one run must not stop the others
        own = isinstance(error, FieldtruthError)
        reason = str(error) if own else f"{type(error).__name__}: {error}"
        failure = failure_of(run.experiment, reason, final=isinstance(error, FINAL))
        failure.write(folder / FAILURE)
        return failure
    return write_manifest(run, out, monotonic() - start, sum(stages.took_s.get(name, 0.0) for name in CACHED))


def write_manifest(run: PlannedRun, out: Path, took_s: float, world_s: float) -> Manifest:
    """Record a finished run, and remove an earlier failure.

    Raises:
        BagError: the bag cannot be read.
        OutputError: the folder cannot be written.
    """
    folder = run.folder(out)
    found = open_run(folder)
    manifest = Manifest(
        fieldtruth=fieldtruth.__version__,
        experiment=digest_of(run.experiment),
        bag=found.bag.name,
        bytes=found.bag.stat().st_size,
        sha256=read_checksums(folder)[found.bag.name],
        messages=count_messages(found.bag),
        simulated_s=found.end_ns / 1e9,
        took_s=round(took_s, 3),
        world_s=round(world_s, 3),
    )
    manifest.write(folder / MANIFEST)
    (folder / FAILURE).unlink(missing_ok=True)
    return manifest


def _holds(folder: Path, experiment: Experiment) -> bool:
    """Whether the folder has a bag of this experiment."""
    if not (folder / f"{experiment.name}.bag").exists() or not (folder / EXPERIMENT).exists():
        return False
    try:
        stored = load_experiment(folder / EXPERIMENT)
    except FieldtruthError:
        return False
    if experiment.drive is not None and stored.drive is not None:  # its track file is stored under another name
        stored = stored.model_copy(update={"drive": experiment.drive})
        experiment = experiment.model_copy(update={"rig": stored.rig})
    if experiment.frames is not None:
        experiment = without_wheels(experiment)
    return stored == experiment


def _is_sound(folder: Path, experiment: Experiment) -> bool:
    """Whether the bag is the one of SHA256SUMS."""
    name = f"{experiment.name}.bag"
    try:
        return (folder / CHECKSUMS).exists() and read_checksums(folder).get(name) == sha256_of(folder / name)
    except FieldtruthError:
        return False
