# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One run of a campaign, and runs side by side: each job is a process that makes one run after the other.

A process that is killed, for lack of memory for example, costs its run only. Jobs end with their parent, however that
ends, and stop at their next message when it is interrupted.
"""

import multiprocessing
import signal
from collections import deque
from collections.abc import Callable, Generator, Sequence
from multiprocessing.connection import Connection, wait
from pathlib import Path
from time import monotonic
from typing import Any, Final

import fieldtruth
from fieldtruth.bag.decode import count_messages
from fieldtruth.bag.file import EXPERIMENT
from fieldtruth.bag.provenance import fits_checksums, read_checksums
from fieldtruth.bag.run import open_run
from fieldtruth.campaign.draw import PlannedRun
from fieldtruth.campaign.estimate import CACHED, Stages, end_with_parent
from fieldtruth.campaign.state import FAILURE, MANIFEST, Failure, Manifest, digest_of, failure_of, state_of
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
    warnings_in_one_line,
)
from fieldtruth.core.progress import Progress
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment
from fieldtruth.pipeline import generate
from fieldtruth.record.folder import clean_finished
from fieldtruth.simulation.motion import without_wheels

STOPPING: Final = (ClusterError, EngineError, OutputError)
"""Errors that other runs would meet, too."""
FINAL: Final = (ConfigurationError, DriveError, RouteError, TrackError, UnknownNameError)
"""Errors that the same version repeats."""
Generate = Callable[..., Path]
"""A function with the arguments of ``fieldtruth.generate``."""
Outcome = Manifest | Failure | FieldtruthError
"""An error: the folder is in use, or one that other runs would meet, too."""
_END_S: Final = 30.0
"""Time [s] in which interrupted jobs end by themselves."""


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
    """Return whether the folder has a bag of this experiment."""
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
    """Return whether the bag is the one of SHA256SUMS."""
    try:
        return fits_checksums(folder, f"{experiment.name}.bag")
    except FieldtruthError:
        return False


def make_runs(
    runs: Sequence[PlannedRun], out: Path, *, jobs: int, workers: int, overwrite: bool = False
) -> Generator[tuple[PlannedRun, Outcome], None, None]:
    """Make runs in ``jobs`` processes of ``workers`` threads each, and yield each run when it has ended."""
    waiting = deque(runs)
    pool = {job.channel: job for job in (_Job(out, workers, overwrite) for _ in range(min(jobs, len(runs))))}
    try:
        for job in pool.values():
            job.begin(waiting.popleft())
        while pool:
            for ready in wait(list(pool)):
                assert isinstance(ready, Connection)
                job = pool.pop(ready)
                run, outcome = job.result()
                if waiting:
                    job = job if job.process.is_alive() else _Job(out, workers, overwrite)
                    job.begin(waiting.popleft())
                    pool[job.channel] = job
                else:
                    job.channel.close()  # it ends
                yield run, outcome
    finally:
        _stop(list(pool.values()))


class _Job:
    """A process and the run that it makes."""

    def __init__(self, out: Path, workers: int, overwrite: bool) -> None:
        context = multiprocessing.get_context("spawn")
        self.out = out
        self.run: PlannedRun | None = None
        self.channel, theirs = context.Pipe()
        self.process = context.Process(target=_work, args=(theirs, out, workers, overwrite))
        self.process.start()
        theirs.close()

    def begin(self, run: PlannedRun) -> None:
        """Begin a run."""
        self.run = run
        self.channel.send(run)

    def result(self) -> tuple[PlannedRun, Outcome]:
        """Return the run that has ended; that of a process that was killed is a failure."""
        assert self.run is not None
        try:
            return self.run, self.channel.recv()
        except (EOFError, ConnectionResetError):
            self.process.join()
            return self.run, _killed(self.run, self.out, self.process.exitcode)


def _killed(run: PlannedRun, out: Path, code: int | None) -> Failure:
    cause = (
        f"signal {-code}, perhaps for lack of memory; use fewer --jobs" if code and code < 0 else f"exit code {code}"
    )
    failure = failure_of(run.experiment, f"its process ended early ({cause})", final=False)
    failure.write(run.folder(out) / FAILURE)
    return failure


def _work(channel: Connection, out: Path, workers: int, overwrite: bool) -> None:
    """Make runs until the parent closes the channel."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent passes Ctrl-C on
    signal.signal(signal.SIGTERM, _interrupt)
    end_with_parent()
    try:
        while True:
            run: PlannedRun = channel.recv()
            try:
                with warnings_in_one_line(run.name):
                    ended = run_one(run, out, workers=workers, overwrite=overwrite)
                channel.send(ended)
            except STOPPING as error:
                channel.send(error)
    except (EOFError, BrokenPipeError, KeyboardInterrupt):
        return


def _interrupt(*_: Any) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # once
    raise KeyboardInterrupt


def _stop(jobs: Sequence[_Job]) -> None:
    """End processes that still work: first by interrupting their runs, which keeps what is finished."""
    for job in jobs:
        job.process.terminate()
    try:
        for job in jobs:
            job.process.join(_END_S)
    finally:  # also at a second Ctrl-C
        for job in jobs:
            job.process.kill()
