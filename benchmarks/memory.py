# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Memory, disk space and the share of joining of whole runs, each in a process of its own.

Run: python benchmarks/memory.py [ROW ...]     without names: all rows of the table in docs/scale.md

- peak memory: largest resident set of the process, worlds, light and kernels cached by a run of one second before.
- peak disk: largest size of the run's folder over that of the finished bag.
- joining: time for checking, copying, syncing, the index and the SHA-256 over that of the run; in CPU time, and as time
  on the clock in the thread that joins, which overlaps with the work of the others.
- seals: CPU time for sealing and syncing slices over that of the run.
"""

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Event, Thread
from typing import Any, Final, NamedTuple

LONG: Final = {"random": {"length_m": 240.0, "seed": 1}}
"""A route that takes more than 700 s at the robot's 0.3 m/s."""

COLUMNS: Final = (
    "run", "s simulated", "workers", "peak memory GB", "bag MB", "peak disk over the bag MB", "joining % of CPU",
    "joining % of the clock", "seals % of CPU", "CPU s", "clock s",
)  # fmt: skip


class Row(NamedTuple):
    """One run: experiment, simulated time [s], sensors and threads."""

    experiment: str
    seconds: float
    cameras: bool
    workers: int
    long: bool = False


ROWS: Final = {
    "park": Row("park_1", 3, True, 2),
    "lake": Row("lake_1", 3, True, 2),
    "forest": Row("forest_1", 3, True, 2),
    "hillside": Row("hillside_1", 3, True, 2),
    "workers_1": Row("park_1", 5, True, 1),
    "workers_2": Row("park_1", 5, True, 2),
    "workers_8": Row("park_1", 5, True, 8),
    "clouds_5": Row("park_1", 5, False, 2),
    "clouds_60": Row("park_1", 60, False, 2),
    "images_20": Row("park_1", 20, True, 2),
    "images_60": Row("park_1", 60, True, 2),
    "long_5": Row("park_1", 5, False, 2, long=True),
    "long_700": Row("park_1", 700, False, 2, long=True),
}


class Stopwatch:
    """Adds up the time in functions, by name: CPU time of the thread, and time on the clock."""

    def __init__(self) -> None:
        self.cpu: dict[str, float] = {}
        self.clock: dict[str, float] = {}

    def wrap(self, owner: Any, function: str, name: str) -> None:
        """Time a function or method in the object that holds it."""
        timed: Callable[..., Any] = getattr(owner, function)

        def run(*args: Any, **kwargs: Any) -> Any:
            cpu, clock = time.thread_time(), time.perf_counter()
            try:
                return timed(*args, **kwargs)
            finally:
                self.cpu[name] = self.cpu.get(name, 0.0) + time.thread_time() - cpu
                self.clock[name] = self.clock.get(name, 0.0) + time.perf_counter() - clock

        setattr(owner, function, run)


def measure(row: Row, out: Path) -> dict[str, float]:
    """Run one row in this process, with the joining timed."""
    from fieldtruth.bag import writer
    from fieldtruth.bag.writer import GrowingBag
    from fieldtruth.experiment.config import Experiment
    from fieldtruth.experiment.files import load_experiment
    from fieldtruth.pipeline import generate
    from fieldtruth.record import folder
    from fieldtruth.record.slices import SliceFolder

    values = load_experiment(row.experiment).model_dump()
    values["seconds"] = row.seconds
    values["rig"]["cameras"]["enabled"] = row.cameras
    if row.long:  # a small LiDAR: what grows with time is the track, the index and the messages at 1 kHz
        values["route"] = LONG
        values["rig"]["lidar"] |= {"columns": 128, "rings": 16}
    watch = Stopwatch()
    for owner, function in ((SliceFolder, "_join"), (GrowingBag, "__exit__"), (folder, "sha256_of")):
        watch.wrap(owner, function, "join")
    for function in ("add_seal", "replace_synced"):
        watch.wrap(writer, function, "seal")
    cpu, clock = time.process_time(), time.perf_counter()
    bag = generate(Experiment.model_validate(values), out, workers=row.workers)
    cpu, clock = time.process_time() - cpu, time.perf_counter() - clock
    return {
        "cpu_s": cpu,
        "clock_s": clock,
        "bag_mb": bag.stat().st_size / 1e6,
        "join_cpu": 100 * watch.cpu["join"] / cpu,
        "join_clock": 100 * watch.clock["join"] / clock,
        "seal_cpu": 100 * watch.cpu["seal"] / cpu,
    }


def in_child(row: Row, out: Path) -> tuple[dict[str, float], float, float]:
    """Figures of a run in a new process, its peak memory [GB] and the peak of its disk space [MB]."""
    result = out / "result.json"
    command = [sys.executable, __file__, "--child", json.dumps(row), str(out)]
    pid = os.posix_spawn(sys.executable, command, os.environ)
    done, peak = Event(), [0]
    watcher = Thread(target=_watch, args=(out, done, peak))
    watcher.start()
    _, status, usage = os.wait4(pid, 0)
    done.set()
    watcher.join()
    if status:
        raise SystemExit(f"the run of {row} failed")
    return json.loads(result.read_text()), usage.ru_maxrss * 1024 / 1e9, peak[0] / 1e6


def _watch(folder: Path, done: Event, peak: list[int]) -> None:
    while not done.wait(0.02):
        with suppress(OSError):  # something was joined and removed just now: look again
            peak[0] = max(peak[0], sum(path.stat().st_size for path in folder.rglob("*.bag*")))


def main() -> None:
    if sys.argv[1:2] == ["--child"]:
        row, out = Row(*json.loads(sys.argv[2])), Path(sys.argv[3])
        figures = measure(row, out)
        (out / "result.json").write_text(json.dumps(figures))
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", nargs="*", default=list(ROWS))
    names = parser.parse_args().rows
    print(f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}")
    for name in names:
        row = ROWS[name]
        with tempfile.TemporaryDirectory() as warm, tempfile.TemporaryDirectory() as folder:
            in_child(row._replace(seconds=1.0), Path(warm))
            f, memory, disk = in_child(row, Path(folder))
        cells = [name, f"{row.seconds:g}", f"{row.workers}", f"{memory:.2f}", f"{f['bag_mb']:.0f}"]
        cells += [f"{disk - f['bag_mb']:.0f}", *(f"{f[key]:.2f}" for key in ("join_cpu", "join_clock", "seal_cpu"))]
        cells += [f"{f[key]:.0f}" for key in ("cpu_s", "clock_s")]
        print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
