# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Time, bytes and memory of a campaign before it starts, and whether the machine has them.

Two simulated seconds of a run are measured in a process of their own, so that its peak memory is known.
"""

import json
import multiprocessing
import os
import shutil
import signal
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Thread
from time import monotonic
from typing import Final, NamedTuple

from fieldtruth.bag.reader import open_bag
from fieldtruth.bag.topics import topics_of
from fieldtruth.bag.writer import compressed
from fieldtruth.campaign.draw import PlannedRun, motion_of, simulated_s
from fieldtruth.campaign.state import size
from fieldtruth.core.cache import SEAL_SIZE, cache_folder, cache_key
from fieldtruth.core.cache_folder import load_or_make
from fieldtruth.core.errors import FieldtruthWarning, OutputError
from fieldtruth.core.files import output_errors, remove
from fieldtruth.core.parallel import check_memory, cpu_count, peak_memory
from fieldtruth.core.progress import Advance, Progress, Silent
from fieldtruth.drive.simulate import drive
from fieldtruth.experiment.config import FRAME_RATE, Experiment, RandomRouteConfig
from fieldtruth.experiment.environment_file import CENTRE
from fieldtruth.experiment.fields import Frozen
from fieldtruth.experiment.files import with_overrides
from fieldtruth.experiment.rig import Rig
from fieldtruth.pipeline import generate
from fieldtruth.world.build import world_key, world_of

WORLD: Final = "build the world"
DRIVE: Final = "drive"
CACHED: Final = (WORLD, "prepare the scene", "wait for workers", "world and drive")
"""Stages of the world and its light, which later runs find in the cache; the last two are those on a cluster."""
MEASURED_S: Final = 2.0
"""Simulated time [s] of a measurement."""
_TRIES: Final = 3
"""Experiments that are tried; in some, no route may be found."""
_DRIVES_S: Final = (1.0, 5.0)
_MOST_RIGS: Final = 4
"""With more rigs, as from a distribution, runs of the first one stand for all."""


class Stages:
    """Progress that keeps the time [s] of each stage, and which of them, other than the drive, count simulated time."""

    def __init__(self, shown: Progress | None = None) -> None:
        self.took_s: dict[str, float] = {}
        self.timed: set[str] = set()
        self._shown = Silent() if shown is None else shown

    @contextmanager
    def stage(self, name: str, total: float | None = None, done: float = 0.0) -> Iterator[Advance]:
        """Enter a stage, and show it."""
        start = monotonic()
        if total is not None and name != DRIVE:
            self.timed.add(name)
        with self._shown.stage(name, total, done) as advance:
            yield advance
        self.took_s[name] = self.took_s.get(name, 0.0) + monotonic() - start


def end_with_parent() -> None:
    """End this process as soon as its parent has ended, however; finished slices stay, others are temporary files."""
    Thread(target=_wait, daemon=True).start()


def _wait() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


class _NotMeasuredError(Exception):
    """No experiment could be measured."""


class Figures(Frozen):
    """Cost of runs in one environment with one rig; times [s] are those of this machine as busy as it was."""

    world_s: float
    """Time for a world that is used for the first time."""
    fixed_s: float
    """Time of each run apart from the rest: loading the world, planning, scene and light."""
    drive_s_per_s: float
    """Time of the drive per simulated second."""
    sense_s_per_s: float
    """Core-seconds of sensing and writing per simulated second."""
    bytes_once: float
    """Of each run, for what it publishes once."""
    bytes_per_s: float
    memory: int
    """Peak memory [byte] of the process."""


def figures_of(experiments: Sequence[Experiment], out: Path, progress: Progress) -> Figures | None:
    """Return the figures of experiments of one environment, motion and rig, measured or from the cache.

    Files are written below OUT and removed again. None if no experiment can be measured.
    """
    first = experiments[0]
    rig = json.dumps(first.rig.model_dump(mode="json"))
    maps = dict(first.layout) if CENTRE in first.layout else {}  # a site's layout is what it is
    key = cache_key(("fieldtruth.pipeline",), world_key(first.environment), maps, rig, motion_of(first), cpu_count())
    path = cache_folder() / f"cost-{first.world_name}-{key}.json"

    def make() -> Figures:
        with progress.stage(f"measure {first.world_name}"):
            for experiment in experiments[:_TRIES]:
                figures = _in_own_process(experiment, out / f".measurement-{path.stem}")
                if figures is not None:
                    return figures
        raise _NotMeasuredError

    try:
        return load_or_make(path, _read, make, _write)
    except _NotMeasuredError:
        return None


def _read(path: Path) -> Figures:
    return Figures.model_validate_json(path.read_bytes()[:-SEAL_SIZE])


def _write(path: Path, figures: Figures) -> None:
    path.write_text(figures.model_dump_json(), encoding="utf-8")


def _in_own_process(experiment: Experiment, folder: Path) -> Figures | None:
    """Measure a run in ``folder``, which is removed before, as a killed process may have left it, and afterwards."""
    with output_errors(folder):
        remove(folder)
        folder.mkdir(parents=True)
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_send_figures, args=(theirs, experiment, folder), daemon=True)
    process.start()
    theirs.close()
    try:
        return Figures.model_validate_json(ours.recv_bytes())
    except EOFError:  # it ended without figures
        return None
    finally:
        process.kill()
        process.join()
        remove(folder)


def _send_figures(channel: Connection, experiment: Experiment, folder: Path) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends it
    end_with_parent()
    warnings.simplefilter("ignore", FieldtruthWarning)  # the run itself will say it
    try:
        channel.send_bytes(measured(experiment, folder).model_dump_json().encode())
    except Exception:  # the run itself will say why
        sys.exit(1)


def measured(experiment: Experiment, folder: Path) -> Figures:
    """Measure the beginning of a run in this process; raises as ``generate``."""
    stages = Stages()
    workers = min(2, cpu_count())
    short = _shortened(experiment, min(MEASURED_S, simulated_s(experiment)))
    bag = generate(short, folder, workers=workers, progress=stages)
    memory = peak_memory() or 0
    start = monotonic()
    world = world_of(short)
    load_s = monotonic() - start
    took = stages.took_s
    if experiment.frames is not None or experiment.drive is not None:
        drive_s_per_s = 0.0
    elif isinstance(experiment.route, RandomRouteConfig):  # it was driven to its end when it was planned
        drive_s_per_s = took[DRIVE] / simulated_s(experiment.model_copy(update={"seconds": None}))
    else:
        drive_s_per_s = _slope(lambda seconds: drive(world, short.model_copy(update={"seconds": seconds})))
    fixed = sum(seconds for name, seconds in took.items() if name not in (WORLD, *stages.timed))
    once = _bytes_once(bag, short.rig)
    sensing = sum(took[name] for name in stages.timed) * workers
    return Figures(
        world_s=took[WORLD],
        fixed_s=load_s + fixed,
        drive_s_per_s=drive_s_per_s,
        sense_s_per_s=sensing / simulated_s(short),
        bytes_once=once,
        bytes_per_s=(bag.stat().st_size - once) / simulated_s(short),
        memory=memory,
    )


def _bytes_once(path: Path, rig: Rig) -> float:
    """Size [byte] in a bag of what is published once, which in a large world are its objects."""
    once = [topic.name for topic in topics_of(rig, latched=True) if topic.latched]
    with open_bag(path) as bag:
        return sum(len(compressed(raw.data)) for raw in bag.messages([name for name in once if name in bag.counts]))


def _shortened(experiment: Experiment, seconds: float) -> Experiment:
    if experiment.frames is None:
        return with_overrides(experiment, seconds=seconds)
    frames = experiment.frames.model_copy(update={"count": round(seconds * FRAME_RATE)})
    return experiment.model_copy(update={"frames": frames})


def _slope(work: Callable[[float], object]) -> float:
    times = []
    for seconds in _DRIVES_S:
        start = monotonic()
        work(seconds)
        times.append(monotonic() - start)
    return max(0.0, times[1] - times[0]) / (_DRIVES_S[1] - _DRIVES_S[0])


class Estimate(NamedTuple):
    """Expected cost of the runs that are left."""

    time_s: float
    bytes: float
    memory: float
    """Of all processes together [byte]."""
    unknown: int
    """Runs that could not be measured; they are not counted."""


def estimate(runs: Sequence[PlannedRun], out: Path, *, jobs: int, workers: int, progress: Progress) -> Estimate:
    """Estimate runs that ``jobs`` processes of ``workers`` threads make.

    One run is measured per environment, kind of motion, and rig. Measurements are cached; files of new ones are written
    below OUT and removed again.
    """
    groups = grouped([run.experiment for run in runs])
    figures = [figures_of(group, out, progress) for group in groups]
    return combined(groups, figures, jobs=jobs, workers=workers)


def grouped(experiments: Sequence[Experiment]) -> list[list[Experiment]]:
    """Return the experiments that share figures: of one environment and kind of motion, and rig while there are few."""
    rigs: list[Rig] = []
    for experiment in experiments:
        if experiment.rig not in rigs and len(rigs) <= _MOST_RIGS:
            rigs.append(experiment.rig)
    many = len(rigs) > _MOST_RIGS
    groups: dict[tuple[str, str, int], list[Experiment]] = {}
    for experiment in experiments:
        rig = 0 if many else rigs.index(experiment.rig)
        groups.setdefault((experiment.world_name, motion_of(experiment), rig), []).append(experiment)
    return list(groups.values())


def combined(
    groups: Sequence[Sequence[Experiment]], figures: Sequence[Figures | None], *, jobs: int, workers: int
) -> Estimate:
    """Add up the groups by their figures, for ``jobs`` runs at a time of ``workers`` threads each."""
    time_s = count = memory = 0.0
    unknown = 0
    for experiments, found in zip(groups, figures, strict=True):
        if found is None:
            unknown += len(experiments)
            continue
        simulated = sum(map(simulated_s, experiments))
        worlds = len({(e.seed, str(e.layout)) for e in experiments})
        per_second = found.drive_s_per_s + found.sense_s_per_s / workers
        time_s += found.world_s * (worlds - 1) + found.fixed_s * len(experiments) + per_second * simulated
        count += found.bytes_once * len(experiments) + found.bytes_per_s * simulated
        memory = max(memory, found.memory)
    at_once = max(1, min(jobs, sum(map(len, groups))))
    return Estimate(time_s / at_once, count, memory * at_once, unknown)


def check_resources(expected: Estimate, out: Path) -> None:
    """Check that disk and memory hold what is expected.

    Raises:
        OutputError: what is needed and what there is.
    """
    free = free_bytes(out)
    if expected.bytes > free:
        raise OutputError(
            f"{out} needs about {size(expected.bytes)}, but {size(free)} are free; free some space, "
            "choose another --out, or make a part of the runs with --shard"
        )
    check_memory(int(expected.memory), "the campaign", "use fewer --jobs")


def free_bytes(path: Path) -> int:
    """Free space [byte] for a folder that may not exist yet."""
    with output_errors(path):
        return shutil.disk_usage(next(p for p in (path, *path.absolute().parents) if p.exists())).free
