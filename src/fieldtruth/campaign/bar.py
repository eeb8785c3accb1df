# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Progress of a run of a campaign: a bar of its longest stage, with the name of the run."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

from fieldtruth.core.progress import Advance, Progress, Silent

Shows = Callable[[], AbstractContextManager[Progress]]
"""Opens a display of progress, as ``fieldtruth.show_progress`` does."""


@contextmanager
def silent() -> Iterator[Progress]:
    """Show nothing."""
    yield Silent()


@contextmanager
def run_bar(shows: Shows, name: str) -> Iterator[Progress]:
    """Show the stages of a run that count simulated time, each as a bar with the name of the run."""
    with shows() as progress:
        yield _Named(progress, name)


class _Named:
    def __init__(self, progress: Progress, name: str) -> None:
        self._progress = progress
        self._name = name

    @contextmanager
    def stage(self, name: str, total: float | None = None, done: float = 0.0) -> Iterator[Advance]:
        inner = Silent() if total is None else self._progress
        with inner.stage(f"{self._name}: {name}", total, done) as advance:
            yield advance
