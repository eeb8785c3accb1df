# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Progress of long work: stages, each with the share that is done and an estimate of the time left."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from threading import Lock
from time import monotonic
from typing import TYPE_CHECKING, Final, Protocol, TypeVar

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress as Bars

Advance = Callable[[float], None]
_STEP_NS: Final = 200_000_000
_LINES_APART_S: Final = 1.0


class Stamped(Protocol):
    """An item of a stream in time order."""

    @property
    def stamp_ns(self) -> int:
        """Time of the item [ns]."""
        ...


T = TypeVar("T")
S = TypeVar("S", bound=Stamped)


class Progress(Protocol):
    """Receiver of progress: any object with this method."""

    def stage(self, name: str, total: float | None = None, done: float = 0.0) -> AbstractContextManager[Advance]:
        """Enter a stage, which ends with the context. The context's value is called, from any thread, with work done.

        Args:
            name: what is being done.
            total: size of the work in seconds of simulated time; None if it is short or unknown.
            done: part of it that an earlier run has done; it does not count as speed.
        """
        ...


class Silent:
    """Progress that is not shown."""

    @contextmanager
    def stage(self, name: str, total: float | None = None, done: float = 0.0) -> Iterator[Advance]:
        """Enter a stage."""
        yield lambda amount: None


def timed(items: Iterable[S], advance: Advance, start_ns: int) -> Iterator[S]:
    """Yield items of a stream and report the simulated time [s] between them, a few times per simulated second."""
    reported_ns = start_ns
    for item in items:
        if item.stamp_ns - reported_ns >= _STEP_NS:
            advance((item.stamp_ns - reported_ns) / 1e9)
            reported_ns = item.stamp_ns
        yield item


@contextmanager
def show_progress(console: "Console | None" = None, *, title: str = "") -> Iterator[Progress]:
    """Show a bar per stage, by default on stderr; in a log file, where there is no terminal, print a line now and then.

    The time left follows from the speed of the last five minutes and since the first part was done, before which
    kernels may compile: so it is right for a first run, and for one that is resumed. ``title`` is the line
    before the first stage.
    """
    from rich.console import Console
    from rich.progress import BarColumn, SpinnerColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    console = Console(stderr=True) if console is None else console
    if not console.is_terminal:
        yield _Lines(console, title)
        return
    columns = (
        SpinnerColumn(finished_text="✓"),
        TextColumn("{task.description:<20}"),
        BarColumn(),
        TextColumn("{task.fields[share]}"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Bars(*columns, console=console, speed_estimate_period=300.0) as bars:
        yield _Bars(bars, title)


class _Titled:
    """Prints a title before the first stage: of work that is refused, the error is the only line."""

    def __init__(self, console: "Console", title: str) -> None:
        self._console, self._title = console, title

    def _begin(self) -> None:
        if self._title:
            self._console.print(self._title, highlight=False, soft_wrap=True)
            self._title = ""


class _Bars(_Titled):
    def __init__(self, bars: "Bars", title: str) -> None:
        super().__init__(bars.console, title)
        self._bars = bars

    @contextmanager
    def stage(self, name: str, total: float | None = None, done: float = 0.0) -> Iterator[Advance]:
        self._begin()
        share = "" if total is None else f"of {total:.1f} s simulated"
        task = self._bars.add_task(name, total=total, share=share)
        self._bars.update(task, completed=done)
        yield lambda amount: self._bars.advance(task, amount)
        self._bars.update(task, total=total or 1.0, completed=total or 1.0)


class _Lines(_Titled):
    """A line at each tenth of a stage, at most one a second, for log files."""

    @contextmanager
    def stage(self, name: str, total: float | None = None, done: float = 0.0) -> Iterator[Advance]:
        self._begin()
        start, lock, made = monotonic(), Lock(), 0.0
        last, first = start, (start, 0.0)
        printed = int(10 * done / total) if total else 0

        def advance(amount: float) -> None:
            nonlocal made, printed, last, first
            with lock:
                made += amount
                if made == amount:
                    first = monotonic(), made
                tenths = int(10 * (done + made) / total) if total else 0
                if total is None or not printed < tenths < 10:
                    return
                now = monotonic()
                if now - last < _LINES_APART_S:
                    return
                printed, last = tenths, now
                since = made - first[1]
                left = (now - first[0]) * max(0.0, total - done - made) / since if since else 0.0
                self._console.print(f"{name}: {10 * printed} %" + f", {left:.0f} s left" * (since > 0), highlight=False)

        yield advance
        self._console.print(f"{name}: done in {monotonic() - start:.1f} s", highlight=False)


def counted(items: Iterable[T], advance: Advance, total: float, count: int) -> Iterator[T]:
    """Yield items, of which there are ``count``, and advance by an equal share of the total for each."""
    for item in items:
        yield item
        advance(total / count)
