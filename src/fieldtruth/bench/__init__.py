# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The speed of this machine: each sensor against bare Embree on the same rays, recording, and memory."""

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Final

from fieldtruth.bench.sensors import measure_sensors, recording, stretches_of
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.parallel import cpu_count, peak_memory
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.core.readings import Image
from fieldtruth.drive.plan import experiments_in
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import with_overrides
from fieldtruth.sensors.known import sensor_class
from fieldtruth.simulation.first_run import wait_for_kernels
from fieldtruth.simulation.stepped import Simulation
from fieldtruth.world.build import check_layout

_UNITS: Final = {
    "_mrays_per_s": "Mrays/s",
    "images_per_s": "images/s",
    "pairs_per_s": "pairs/s",
    "_mb": "MB",
    "_s": "s",
}
"""Units of figures by the end of their names, other than a ratio; docs/benchmarks.md explains the figures."""
DRIVE_S: Final = 60.0
"""Simulated time [s] of the drive, along which the views are."""
_SCANS: Final = 10  # of each LiDAR in each stretch: they are short, so that a single interruption matters


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The experiment that is measured, and the number of views."""

    experiment: Experiment
    views: int = 12
    """Stamps at which each camera is measured, or a few more: as many in each of some stretches of the drive."""


def settings_of(environment: str) -> Settings:
    """Return settings for an environment, a name or a file: its first experiment.

    Raises:
        UnknownNameError: the environment does not exist.
        ConfigurationError: it has no built-in experiment.
    """
    check_layout(environment, None)
    experiments = experiments_in(environment)
    if not experiments:
        raise ConfigurationError(f"cannot measure {environment}: it has no built-in experiment")
    return Settings(experiment=experiments[0])


def measure(settings: Settings, progress: Progress | None = None) -> dict[str, float]:
    """Measure the figures of the sensors that see; without peak memory on Windows.

    With world, light and kernels in the cache it takes about a minute. Figures are sums over the sensors of a kind.
    """
    progress, workers = progress or Silent(), cpu_count()
    made = settings.experiment
    sensors = tuple(each for each in made.rig.in_order() if each.sees)
    rig = made.rig.model_copy(update={"sensors": sensors}).with_each(lambda each: {"rate_hz": max(1.0, each.rate_hz)})
    simulation = Simulation(with_overrides(made, seconds=min(made.seconds or DRIVE_S, DRIVE_S)))
    with progress.stage("build the world"):
        simulation.world  # noqa: B018
    with progress.stage("drive"):
        driven = simulation.drive()
    with progress.stage("bake the light"):
        baked, track = driven.sensor_world.baked, driven.track
    wait_for_kernels(progress)
    stretches, found, peak = stretches_of(track.duration_s, settings.views, workers), dict[str, float](), peak_memory()
    for each in dict.fromkeys(map(sensor_class, rig.sensors)):
        alike = tuple(config for config in rig.sensors if sensor_class(config) is each)
        with progress.stage(alike[0].noun), ExitStack() as stack:
            if issubclass(alike[0].gives, Image):
                alone = rig.model_copy(update={"sensors": alike})
                slices = stack.enter_context(recording(baked, track, alone, stretches, workers))
                peak = peak_memory()  # of what a run needs; what only the comparison needs comes after
                found |= measure_sensors(driven, alike, stretches, workers, slices)
            else:
                found |= measure_sensors(driven, alike, stretches._replace(views=_SCANS), workers)
    return found | ({"peak_rss_mb": peak / 1e6} if peak else {})


def unit_of(figure: str) -> str:
    """Return the unit of a figure; of a ratio x."""
    return next((unit for end, unit in _UNITS.items() if figure.endswith(end)), "x")


def table(figures: Mapping[str, float]) -> str:
    """Figures as lines of text: name, value, unit."""
    lines = [f"{'figure':<28}{'value':>9}  unit"]
    for key, value in figures.items():
        shown = f"{value:.0f}" if value >= 1000 else f"{value:#.3g}"
        lines.append(f"{key:<28}{shown:>9}  {unit_of(key)}")
    return "\n".join(lines)
