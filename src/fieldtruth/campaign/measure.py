# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A measurement of two simulated seconds of a run, in a process of its own, so that its peak memory is known."""

import json
import multiprocessing
import resource
import signal
import sys
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from time import monotonic
from typing import Final

from fieldtruth.bag.reader import open_bag
from fieldtruth.bag.topics import topics_of
from fieldtruth.bag.writer import compressed
from fieldtruth.campaign.duration import motion_of, simulated_s
from fieldtruth.campaign.ends import end_with_parent
from fieldtruth.campaign.stages import DRIVE, WORLD, Stages
from fieldtruth.core.cache import SEAL_SIZE, cache_folder, cache_key
from fieldtruth.core.cache_folder import load_or_make
from fieldtruth.core.files import output_errors, remove
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Progress
from fieldtruth.drive.simulate import drive
from fieldtruth.experiment.config import FRAME_RATE, Experiment, RandomRouteConfig
from fieldtruth.experiment.fields import Frozen
from fieldtruth.experiment.files import with_overrides
from fieldtruth.experiment.rig import Rig
from fieldtruth.pipeline import generate
from fieldtruth.world.build import world_key, world_of

MEASURED_S: Final = 2.0
"""Simulated time [s]: two slices."""
_TRIES: Final = 3
"""Experiments that are tried; in some, no route may be found."""
_DRIVES_S: Final = (1.0, 5.0)


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
    key = cache_key(("fieldtruth.pipeline",), world_key(first.environment), rig, motion_of(first), cpu_count())
    path = cache_folder() / f"cost-{first.environment}-{key}.json"

    def make() -> Figures:
        with progress.stage(f"measure {first.environment}"):
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
    try:
        channel.send_bytes(measured(experiment, folder).model_dump_json().encode())
    except Exception:  # the run itself will say why
        sys.exit(1)


def measured(experiment: Experiment, folder: Path) -> Figures:
    """Measure the beginning of a run in this process; raises as ``generate``."""
    stages = Stages()
    workers = min(int(MEASURED_S), cpu_count())
    short = _shortened(experiment, min(MEASURED_S, simulated_s(experiment)))
    bag = generate(short, folder, workers=workers, progress=stages)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
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
