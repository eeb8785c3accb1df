# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Time, bytes and memory of a campaign before it starts, and whether the machine has them."""

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from fieldtruth.campaign.amounts import size
from fieldtruth.campaign.draw import PlannedRun
from fieldtruth.campaign.duration import motion_of, simulated_s
from fieldtruth.campaign.measure import Figures, figures_of
from fieldtruth.core.errors import OutputError
from fieldtruth.core.files import output_errors
from fieldtruth.core.memory import check_memory
from fieldtruth.core.progress import Progress
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.rig import Rig

_MOST_RIGS: Final = 4
"""With more rigs, as from a distribution, runs of the first one stand for all."""


class Estimate(NamedTuple):
    """What is expected of the runs that are left."""

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
        groups.setdefault((experiment.environment, motion_of(experiment), rig), []).append(experiment)
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
