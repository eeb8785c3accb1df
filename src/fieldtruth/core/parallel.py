# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Cores and memory that a process may use, and work on a stream with threads while few of its items are in memory."""

import contextlib
import os
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Final, TypeVar

from fieldtruth.core.errors import OutputError

T = TypeVar("T")
R = TypeVar("R")
_AHEAD: Final = 4
"""Items per worker that are in memory at once."""


def cpu_count() -> int:
    """Cores that this process may use; elsewhere than on Linux, all cores of the machine."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_order(items: Iterable[T], work: Callable[[T], R], workers: int) -> Iterator[R]:
    """Yield the results of ``work`` in the order of the items; the first exception ends it."""
    with ThreadPoolExecutor(workers) as pool:
        waiting: deque[Future[R]] = deque()
        try:
            for item in items:
                waiting.append(pool.submit(work, item))
                if len(waiting) >= _AHEAD * workers:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()


_SYSTEM, _OWN = Path("/proc/meminfo"), Path("/proc/self/status")
_LIMIT, _USED = Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory.current")


def available_memory() -> int | None:
    """Memory [byte] that the system, or the container's limit, still grants; None where neither can be read."""
    found = []
    with contextlib.suppress(OSError, KeyError, ValueError):
        lines = dict(line.split(":", 1) for line in _SYSTEM.read_text().splitlines())
        found.append(int(lines["MemAvailable"].split()[0]) * 1024)
    with contextlib.suppress(OSError, ValueError):  # "max": no limit
        found.append(int(_LIMIT.read_text()) - int(_USED.read_text()))
    return min(found, default=None)


def peak_memory() -> int | None:
    """Largest memory [byte] that this process has held so far; None on Windows.

    Linux counts ``ru_maxrss`` of a new process from the memory of the process that started it, ``VmHWM`` from its own.
    """
    with contextlib.suppress(OSError, KeyError, ValueError):
        lines = dict(line.split(":", 1) for line in _OWN.read_text().splitlines())
        return int(lines["VmHWM"].split()[0]) * 1024
    try:
        import resource
    except ImportError:
        return None
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


def check_memory(needed: int, task: str, remedy: str) -> None:
    """Check that about ``needed`` bytes of memory are available for a task.

    Raises:
        OutputError: both figures and what can be done instead.
    """
    available = available_memory()
    if available is not None and needed > available:
        raise OutputError(
            f"{task} needs about {needed / 1e9:.1f} GB of memory, but {available / 1e9:.1f} GB are available; {remedy}"
        )
