# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Work in several processes. Apart from ``parallel``, whose importers must not load ``multiprocessing``."""

import signal
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import active_children, get_context
from typing import TypeVar

from fieldtruth.core.errors import OutputError

R = TypeVar("R")


def as_done(
    work: Callable[..., R],
    items: Iterable[tuple[object, ...]],
    workers: int,
    begin: Callable[[], object] | None = None,
    tasks_per_process: int | None = None,
) -> Iterator[R]:
    """Yield the results of ``work``, called in processes with the values of each item, as each is done.

    Args:
        work: a function of a module.
        items: its arguments.
        workers: number of processes.
        begin: called first in every process.
        tasks_per_process: after which a process ends, and its memory with it.

    Raises:
        OutputError: a process was ended.
    """
    others = {*active_children()}
    setup = _begin_process, (begin,)
    with ProcessPoolExecutor(workers, get_context("spawn"), *setup, max_tasks_per_child=tasks_per_process) as pool:
        try:
            for job in as_completed([pool.submit(work, *item) for item in items]):
                yield job.result()
        except BrokenProcessPool as error:
            raise OutputError("a process was ended, perhaps for lack of memory; take fewer --workers") from error
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            for child in {*active_children()} - others:
                child.terminate()


def _begin_process(begin: Callable[[], object] | None) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends Ctrl-C to all processes
    if begin is not None:
        begin()
