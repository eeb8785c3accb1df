# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Work in several processes. Apart from ``parallel``, whose importers must not load ``multiprocessing``.

Not ``concurrent.futures``: if Ctrl-C comes while one of its processes is replaced by another, it waits for ever.
"""

import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, NamedTuple, TypeVar

from fieldtruth.core.errors import OutputError

R = TypeVar("R")


class _Failed(NamedTuple):
    """What a process sends in place of a result."""

    error: Exception


class _Worker(NamedTuple):
    process: BaseProcess
    begun: int
    """Items that it was given."""


def as_done(
    work: Callable[..., R],
    items: Iterable[tuple[object, ...]],
    workers: int,
    begin: Callable[[], object] | None = None,
    tasks_per_process: int | None = None,
) -> Iterator[R]:
    """Yield the results of ``work``, called in processes with the values of each item, as each is done.

    The processes end with the iteration, however it ends. What ``work`` raises is raised here.

    Args:
        work: a function of a module.
        items: its arguments.
        workers: number of processes.
        begin: called first in every process.
        tasks_per_process: after which a process ends, and its memory with it.

    Raises:
        OutputError: a process was ended.
    """
    waiting, busy, started = deque(items), dict[Connection, _Worker](), list[BaseProcess]()
    try:
        while waiting or busy:
            while waiting and len(busy) < workers:
                channel, process = _start(work, begin)
                started.append(process)
                channel.send(waiting.popleft())
                busy[channel] = _Worker(process, 1)
            for ready in wait(list(busy)):
                assert isinstance(ready, Connection)
                process, begun = busy.pop(ready)
                result = _received(ready)
                if waiting and begun != tasks_per_process:
                    ready.send(waiting.popleft())
                    busy[ready] = _Worker(process, begun + 1)
                else:
                    ready.close()  # it ends
                yield result
    finally:
        for process in started:
            process.terminate()
        for process in started:
            process.join()


def _start(work: Callable[..., Any], begin: Callable[[], object] | None) -> tuple[Connection, BaseProcess]:
    """Start a process, which never sees the Ctrl-C that a terminal sends to all: not while it begins, either."""
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, work, begin), daemon=True)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        process.start()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    theirs.close()
    return ours, process


def _received(channel: Connection) -> Any:
    try:
        result = channel.recv()
    except (EOFError, ConnectionResetError):
        raise OutputError("a process was ended, perhaps for lack of memory; take fewer --workers") from None
    if isinstance(result, _Failed):
        raise result.error
    return result


def _serve(channel: Connection, work: Callable[..., Any], begin: Callable[[], object] | None) -> None:
    """Work in a process, until the other end of its channel is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        if begin is not None:
            begin()
        while True:
            channel.send(work(*channel.recv()))
    except (EOFError, BrokenPipeError):
        return
    except Exception as error:
        channel.send(_Failed(error))
