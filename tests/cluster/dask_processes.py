# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A real scheduler and real workers, as processes on the loopback interface."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

Process = subprocess.Popen[bytes]


class Processes:
    """Starts a scheduler and workers; their output goes to files in ``folder``."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.file = folder / "scheduler.json"
        self.started: list[Process] = []

    def scheduler(self) -> Process:
        """Start a scheduler and wait for its file."""
        self.file.unlink(missing_ok=True)
        options = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(self.file)]
        process = self._start(["scheduler", *options], {}, [])
        wait_until(self.file.exists)
        return process

    def worker(self, environment: Mapping[str, str] | None = None, prefix: Sequence[str] = ()) -> Process:
        """Start a worker with one thread; ``prefix`` is a command that runs it."""
        fakes = str(Path(__file__).with_name("fake_worker.py"))
        options = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--scheduler-file", str(self.file)]
        options += ["--memory-limit", "0", "--local-directory", str(self.folder), "--preload", fakes]
        return self._start(["worker", *options], environment or {}, prefix)

    def _start(self, words: Sequence[str], environment: Mapping[str, str], prefix: Sequence[str]) -> Process:
        with (self.folder / f"{len(self.started)}.log").open("wb") as log:
            process = subprocess.Popen(
                [*prefix, sys.executable, "-m", "dask", *words],
                stdout=log,
                stderr=log,
                cwd=self.folder,
                env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), **environment},
            )
        self.started.append(process)
        return process


@contextmanager
def processes(folder: Path) -> Iterator[Processes]:
    """Yield the starter of processes in a new folder, and end all that it started."""
    folder.mkdir()
    started = Processes(folder)
    try:
        yield started
    finally:
        for process in started.started:
            process.kill()
        for process in started.started:
            process.wait()


def wait_until(condition: Callable[[], object], seconds: float = 60.0) -> None:
    """Wait for a condition."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.02)
