# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The benchmark of this machine in one environment: sensors, recording, memory."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from fieldtruth.bench.recording import SECONDS, pairs_per_second
from fieldtruth.bench.sensors import measure_cameras, measure_lidar, poses_on_route
from fieldtruth.core.errors import ConfigurationError, UnknownNameError
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.drive.expected_path import experiments_in
from fieldtruth.drive.simulate import drive
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import with_overrides
from fieldtruth.render.bake import bake
from fieldtruth.sense.scene import Scene
from fieldtruth.world.build import world_of
from fieldtruth.world.environments import ENVIRONMENTS

UNITS: Final = {
    "lidar_mrays_per_s": "Mrays/s",
    "lidar_bare_mrays_per_s": "Mrays/s",
    "lidar_over_bare": "x",
    "camera_bare_mrays_per_s": "Mrays/s",
    "label_image_over_bare": "x",
    "photograph_over_bare": "x",
    "stereo_pairs_per_s": "pairs/s",
    "image_efficiency": "x",
    "peak_rss_mb": "MB",
}
"""Figures and their units; docs/benchmarks.md explains them."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is measured, and how often."""

    experiment: Experiment
    views: int = 12
    """Poses along the route."""
    repeats: int = 3
    """Tries of each view, the best of which counts."""
    pairs: int = 24
    """Stereo pairs that are recorded."""


def settings_of(environment: str) -> Settings:
    """Settings for an environment: its first built-in experiment.

    Raises:
        UnknownNameError: the environment does not exist.
        ConfigurationError: it has no built-in experiment.
    """
    if environment not in ENVIRONMENTS:
        raise UnknownNameError("environment", environment, ENVIRONMENTS)
    experiments = experiments_in(environment)
    if not experiments:
        raise ConfigurationError(f"cannot measure {environment}: it has no built-in experiment")
    return Settings(experiment=experiments[0])


def measure(settings: Settings, progress: Progress | None = None) -> dict[str, float]:
    """Measure the figures of ``UNITS`` in about a minute; without peak memory on Windows."""
    progress, experiment = progress or Silent(), settings.experiment
    rig = experiment.rig
    found: dict[str, float] = {}
    with progress.stage("build the world"):
        world = world_of(experiment)
    with progress.stage("bake the light"):
        baked = bake(Scene(world), experiment.light)
    poses = poses_on_route(experiment.route, world, rig, settings.views)
    with progress.stage("LiDAR"):
        found |= measure_lidar(baked.scene, rig, poses, settings.repeats)
    with progress.stage("cameras"):
        found |= measure_cameras(baked, rig, poses, settings.repeats)
    with progress.stage("stereo pairs"):
        track = drive(world, with_overrides(experiment, seconds=SECONDS))
        rate = pairs_per_second(baked, track, rig, pairs=settings.pairs, workers=cpu_count())
    found["stereo_pairs_per_s"] = rate
    pixels = rig.stereo.width * rig.stereo.height
    found["image_efficiency"] = image_efficiency(rate, cpu_count(), pixels, found["camera_bare_mrays_per_s"])
    return found | peak_memory()


def image_efficiency(pairs_per_s: float, cores: int, pixels: int, bare_mrays_per_s: float) -> float:
    """Time that bare Embree needs for one ray per pixel, over the cores' time for an image that is recorded.

    The latter is all that ``cores`` do or wait for: rays at edges, shadows, shading, encoding, tag image, writing.
    """
    return pixels / (1e6 * bare_mrays_per_s) * 2.0 * pairs_per_s / cores


def peak_memory() -> dict[str, float]:
    """Peak memory [10^6 bytes] of this process so far, as ``peak_rss_mb``; empty on Windows."""
    try:
        import resource
    except ImportError:
        return {}
    unit = 1e6 if sys.platform == "darwin" else 1e6 / 1024  # bytes on macOS, else kilobytes (getrusage(2))
    return {"peak_rss_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit}


def table(figures: Mapping[str, float], units: Mapping[str, str] = UNITS) -> str:
    """Figures as lines of text: name, value, unit."""
    lines = [f"{'figure':<28}{'value':>9}  unit"]
    for key, value in figures.items():
        shown = f"{value:.0f}" if value >= 1000 else f"{value:#.3g}"
        lines.append(f"{key:<28}{shown:>9}  {units[key]}")
    return "\n".join(lines)
