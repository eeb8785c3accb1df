# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The benchmark of this machine in one environment: sensors, recording, memory."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from fieldtruth.bench.recording import SECONDS, images_per_second
from fieldtruth.bench.sensors import measure_cameras, measure_lidars, poses_on_route
from fieldtruth.core.errors import ConfigurationError
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
    "normals_over_bare": "x",
    "flow_over_bare": "x",
    "images_per_s": "images/s",
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
    images: int = 24
    """Images of each camera that are recorded."""


def settings_of(environment: str) -> Settings:
    """Settings for an environment: its first built-in experiment.

    Raises:
        UnknownNameError: the environment does not exist.
        ConfigurationError: it has no built-in experiment.
    """
    ENVIRONMENTS.find(environment)
    experiments = experiments_in(environment)
    if not experiments:
        raise ConfigurationError(f"cannot measure {environment}: it has no built-in experiment")
    return Settings(experiment=experiments[0])


def measure(settings: Settings, progress: Progress | None = None) -> dict[str, float]:
    """Measure the figures of ``UNITS`` that the rig has, in about a minute; without peak memory on Windows.

    Figures are sums over the sensors of a kind. Pairs are counted if the only cameras are a stereo pair.
    """
    progress, experiment = progress or Silent(), settings.experiment
    rig = experiment.rig
    found: dict[str, float] = {}
    with progress.stage("build the world"):
        world = world_of(experiment)
    with progress.stage("bake the light"):
        baked = bake(Scene(world), experiment.light)
    poses = poses_on_route(experiment.route, world, rig, settings.views)
    with progress.stage("LiDAR"):
        found |= measure_lidars(baked.scene, rig, poses, settings.repeats)
    with progress.stage("cameras"):
        found |= measure_cameras(baked, rig, poses, settings.repeats)
    if rig.cameras:
        with progress.stage("images"):
            track = drive(world, with_overrides(experiment, seconds=SECONDS))
            rate = images_per_second(baked, track, rig, images=settings.images, workers=cpu_count())
        found["images_per_s"] = rate
        if len(rig.cameras) == 1 and len(rig.imagers) == 2:
            found["stereo_pairs_per_s"] = rate / 2.0
        pixels = float(np.mean([imager.config.width * imager.config.height for imager in rig.imagers]))
        found["image_efficiency"] = image_efficiency(rate, cpu_count(), pixels, found["camera_bare_mrays_per_s"])
    return found | peak_memory()


def image_efficiency(images_per_s: float, cores: int, pixels: float, bare_mrays_per_s: float) -> float:
    """Time that bare Embree needs for one ray per pixel, over the cores' time for an image that is recorded.

    The latter is all that ``cores`` do or wait for: rays at edges, shadows, shading, encoding, tag image, writing.
    """
    return pixels / (1e6 * bare_mrays_per_s) * images_per_s / cores


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
