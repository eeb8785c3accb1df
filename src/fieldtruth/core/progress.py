# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""How a long run tells where it is: stages, each with a share that is done and an honest time to its end."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from threading import Lock
from time import monotonic
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress as Bars

Advance = Callable[[float], None]


class Progress(Protocol):
    """Whoever wants to know."""

    def stage(self, name: str, total: float | None = None, done: float = 0.0) -> AbstractContextManager[Advance]:
        """Enter a stage; it ends with the context. The context's value is called, from any thread, with what was done.

        Args:
            name: what happens, in words.
            total: size of the work in seconds of simulated time; None if it is short or unknown.
            done: what an earlier run has done of it; it does not count as speed.
        """
        ...


class Silent:
    """Tells nobody."""

    @contextmanager
    def stage(self, name: str, total: float | None = None, done: float = 0.0) -> Iterator[Advance]:
        """Enter a stage."""
        yield lambda amount: None


@contextmanager
def show_progress(console: "Console | None" = None) -> Iterator[Progress]:
    """Show a bar per stage, by default on stderr; where that is no terminal, a line of text now and then.

    The time that is left follows from the speed of the last five minutes, so that a resumed run is told truly.
    """
    from rich.console import Console
    from rich.progress import BarColumn, SpinnerColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    console = Console(stderr=True) if console is None else console
    if not console.is_terminal:
        yield _Lines(console)
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
        yield _Bars(bars)


class _Bars:
    def __init__(self, bars: "Bars") -> None:
        self._bars = bars

    @contextmanager
    def stage(self, name: str, total: float | None = None, done: float = 0.0) -> Iterator[Advance]:
        share = "" if total is None else f"of {total:.1f} s simulated"
        task = self._bars.add_task(name, total=total, share=share)
        self._bars.update(task, completed=done)
        yield lambda amount: self._bars.advance(task, amount)
        self._bars.update(task, total=total or 1.0, completed=total or 1.0)


class _Lines:
    """A line at each tenth of a stage, for log files."""

    def __init__(self, console: "Console") -> None:
        self._console = console

    @contextmanager
    def stage(self, name: str, total: float | None = None, done: float = 0.0) -> Iterator[Advance]:
        start, lock, made = monotonic(), Lock(), 0.0
        told = int(10 * done / total) if total else 0

        def advance(amount: float) -> None:
            nonlocal made, told
            with lock:
                made += amount
                tenths = int(10 * (done + made) / total) if total else 0
                if total is None or not told < tenths < 10:
                    return
                told = tenths
                left = (monotonic() - start) * max(0.0, total - done - made) / made
                self._console.print(f"{name}: {10 * told} %, {left:.0f} s left", highlight=False)

        yield advance
        self._console.print(f"{name}: done in {monotonic() - start:.1f} s", highlight=False)
