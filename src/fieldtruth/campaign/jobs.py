# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs side by side: each job is a process that makes one run after the other.

A process that is killed, for lack of memory for example, costs its run only. Jobs end with their parent, however that
ends, and stop at their next message when it is interrupted.
"""

import multiprocessing
import signal
from collections import deque
from collections.abc import Generator, Sequence
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, Final

from fieldtruth.campaign.draw import PlannedRun
from fieldtruth.campaign.ends import end_with_parent
from fieldtruth.campaign.manifest import FAILURE, Failure, Manifest, failure_of
from fieldtruth.campaign.run import STOPPING, run_one
from fieldtruth.core.errors import FieldtruthError

Outcome = Manifest | Failure | FieldtruthError
"""An error: the folder is in use, or one that other runs would meet, too."""

_END_S: Final = 30.0
"""Time [s] in which interrupted jobs end by themselves."""


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
                channel.send(run_one(run, out, workers=workers, overwrite=overwrite))
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
