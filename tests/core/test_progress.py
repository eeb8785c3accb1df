# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
import io
import re
import threading
from itertools import count
from types import SimpleNamespace

import pytest
from rich.console import Console

from fieldtruth.core.progress import show_progress, timed


@pytest.mark.parametrize(("step_s", "shown"), [(1.0, ["60", "70", "80", "90"]), (0.06, ["70", "90"]), (0.0, [])])
def test_lines_for_a_log_file(step_s: float, shown: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """At each tenth, but not more often than once a second."""
    clock = count(0.0, step_s)
    monkeypatch.setattr("fieldtruth.core.progress.monotonic", lambda: next(clock))
    out = io.StringIO()
    with show_progress(Console(file=out)) as progress:
        with progress.stage("drive"):
            pass
        with progress.stage("sense", total=10.0, done=5.0) as advance:
            for _ in range(50):
                advance(0.1)
    lines = out.getvalue().splitlines()
    assert re.fullmatch(r"drive: done in \d+\.\d s", lines[0])
    shares = [re.fullmatch(r"sense: (\d+) %, \d s left", line) for line in lines[1:-1]]
    assert [share and share[1] for share in shares] == shown
    assert re.fullmatch(r"sense: done in \d+\.\d s", lines[-1])
    assert "\x1b" not in out.getvalue()


def test_time_left_does_not_count_what_comes_before_the_first_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """A minute of compiling before ten parts of a second each."""
    clock = iter([0.0, 60.0, 60.0, *(60.0 + k for k in range(1, 10)), 70.0])
    monkeypatch.setattr("fieldtruth.core.progress.monotonic", lambda: next(clock))
    out = io.StringIO()
    with (
        show_progress(Console(file=out), title="park_1: 10 s") as progress,
        progress.stage("sense", total=10.0) as advance,
    ):
        for _ in range(10):
            advance(1.0)
    lines = out.getvalue().splitlines()
    assert lines[:3] == ["park_1: 10 s", "sense: 10 %", "sense: 20 %, 8 s left"]
    assert lines[9] == "sense: 90 %, 1 s left"


def test_bars_on_a_terminal_from_several_threads() -> None:
    out = io.StringIO()
    with show_progress(Console(file=out, force_terminal=True, width=100)) as progress:
        with progress.stage("drive"):
            pass
        with progress.stage("sense", total=8.0) as advance:
            workers = [threading.Thread(target=lambda: [advance(0.5) for _ in range(8)]) for _ in range(2)]
            for worker in workers:
                worker.start()
            for worker in workers:
                worker.join()
    text = out.getvalue()
    assert "drive" in text
    assert "of 8.0 s simulated" in text
    assert text.count("✓") >= 2


def test_time_between_items_is_reported_a_few_times_per_second() -> None:
    items = [SimpleNamespace(stamp_ns=10**9 + k * 50_000_000) for k in range(21)]
    reported: list[float] = []
    assert list(timed(items, reported.append, 10**9)) == items
    assert reported == [0.2] * 5
