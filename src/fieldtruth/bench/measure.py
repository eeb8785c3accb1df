# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The order of the measurements: world, light, drive, sensors, recording; then memory; then what needs a second world.

Kernels are compiled on a corner of the world first, so that no figure but the first frame's depends on what the disk
remembers of them.
"""

import os
import resource
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from tempfile import TemporaryDirectory
from time import perf_counter

from fieldtruth.bench.figures import FIGURES
from fieldtruth.bench.recording import pairs_per_second
from fieldtruth.bench.sensing import measure_cameras, measure_lidar, poses_along
from fieldtruth.core import frames
from fieldtruth.core.errors import ConfigurationError, UnknownNameError
from fieldtruth.core.parallel import cpu_count
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.drive.expected_path import experiments_in
from fieldtruth.drive.simulate import drive
from fieldtruth.drive.track import Track
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment, with_overrides
from fieldtruth.experiment.rig import OPTICAL, CameraConfig, LidarConfig
from fieldtruth.render.bake import bake
from fieldtruth.render.camera import Camera
from fieldtruth.sense.lidar import Lidar
from fieldtruth.sense.scene import Scene
from fieldtruth.world.build import world_of
from fieldtruth.world.environments import ENVIRONMENTS
from fieldtruth.world.model import World

FIRST_FRAME = """
import sys
import fieldtruth as ft
world = ft.load_world(sys.argv[1], int(sys.argv[2]))
pose = ft.frames.pose((0, 0, float(world.terrain.field.height_at(0, 0)) + 0.8)) @ ft.OPTICAL
ft.Camera(ft.CameraConfig(), ft.bake(ft.Scene(world))).render(pose)
"""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How much is measured."""

    experiment: Experiment = field(default_factory=lambda: load_experiment("park_1"))
    more_drives: tuple[Experiment, ...] = ()
    """Others in the same world; the slowest drive of all counts."""
    views: int = 12
    """Poses along the route from which each sensor looks."""
    repeats: int = 3
    """Tries of each view, the best of which counts."""
    drive_seconds: float = 60.0
    """Simulated time [s] of each drive."""
    pairs: int = 24
    """Stereo pairs that are recorded in the drive's first seconds."""


def settings_of(environment: str) -> Settings:
    """Return the settings that measure an environment by its built-in experiments, the first above all.

    Raises:
        UnknownNameError: there is no such environment; lists those that there are.
        ConfigurationError: no experiment drives there.
    """
    if environment not in ENVIRONMENTS:
        raise UnknownNameError("environment", environment, [*ENVIRONMENTS, "all"])
    experiments = experiments_in(environment)
    if not experiments:
        raise ConfigurationError(f"no built-in experiment drives in {environment}, so there is nothing to measure")
    return Settings(experiment=experiments[0], more_drives=tuple(experiments[1:]))


def run(settings: Settings | None = None, progress: Progress | None = None) -> dict[str, float]:
    """Measure everything, in about two minutes; keys and units are those of ``FIGURES``.

    Nothing is kept on disk, and no cache of an earlier run is used but that of compiled kernels: while it runs, this
    process's ``XDG_CACHE_HOME`` is a temporary folder.
    """
    settings = Settings() if settings is None else settings
    progress = Silent() if progress is None else progress
    experiment = settings.experiment
    with empty_cache():
        found = _measure_run(settings, progress)
        # ru_maxrss: kilobytes on Linux, bytes on macOS (getrusage(2)).
        unit = 1e6 if sys.platform == "darwin" else 1e6 / 1024
        found["peak_rss_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
        with progress.stage("load the world"):
            found["world_load_s"] = _seconds(lambda: bake(Scene(_load(experiment)), experiment.light))
        with progress.stage("first frame"):
            start_python = [sys.executable, "-c", FIRST_FRAME, experiment.environment, str(experiment.seed)]
            for _ in range(2):  # the second finds whatever can be cached
                found["first_frame_s"] = _seconds(lambda: subprocess.run(start_python, check=True))
    return {figure.key: found[figure.key] for figure in FIGURES}


def _measure_run(settings: Settings, progress: Progress) -> dict[str, float]:
    """Everything that a run does, in its order; world, scene and track go when it is done."""
    experiment = settings.experiment
    rig, found = experiment.rig, {}
    with progress.stage("build the world"):
        start = perf_counter()
        world = _load(experiment)
        build_s = perf_counter() - start
    with progress.stage("compile"):
        _compile(world)
    with progress.stage("bake the light"):
        start = perf_counter()
        scene = Scene(world)
        build_s += perf_counter() - start
        start = perf_counter()
        baked = bake(scene, experiment.light)
        found["light_bake_s"] = perf_counter() - start
        found["world_build_s"] = build_s + found["light_bake_s"]
    with progress.stage("drive"):
        drives = [_timed_drive(world, each, settings.drive_seconds) for each in (experiment, *settings.more_drives)]
        track = drives[0][0]
        found["drive_realtime_factor"] = min(factor for _, factor in drives)
    poses = poses_along(experiment.route, world, rig, settings.views)
    with progress.stage("LiDAR"):
        found |= measure_lidar(scene, rig, poses, settings.repeats)
    with progress.stage("cameras"):
        found |= measure_cameras(baked, rig, poses, settings.repeats)
    cores = cpu_count()
    rates = dict.fromkeys((1, 2, cores), 0.0)
    with progress.stage("stereo pairs"):
        for _ in range(2):
            for workers in rates:
                rate = pairs_per_second(baked, track, rig, pairs=settings.pairs, workers=workers)
                rates[workers] = max(rates[workers], rate)
    found["stereo_pairs_per_s"] = rates[cores]
    found["two_workers_speedup"] = rates[2] / rates[1]
    return found


def _timed_drive(world: World, experiment: Experiment, seconds: float) -> tuple[Track, float]:
    """Drive so many simulated seconds; returns the track, and simulated time by time."""
    start = perf_counter()
    track = drive(world, with_overrides(experiment, seconds=seconds))
    return track, track.duration_s / (perf_counter() - start)


def _load(experiment: Experiment) -> World:
    return world_of(experiment)


@contextmanager
def empty_cache() -> Iterator[None]:
    """Let worlds and light be cached in a folder that goes with the context."""
    with TemporaryDirectory() as folder:
        before = os.environ.get("XDG_CACHE_HOME")
        os.environ["XDG_CACHE_HOME"] = folder
        try:
            yield
        finally:
            if before is None:
                del os.environ["XDG_CACHE_HOME"]
            else:
                os.environ["XDG_CACHE_HOME"] = before


def _compile(world: World) -> None:
    """Use every kernel once: on a square metre, with the smallest object of each kind."""
    by_size = sorted(world.instances, key=lambda instance: -len(world.meshes[instance.mesh].faces))
    some = tuple({instance.kind: instance for instance in by_size}.values())
    meshes = {instance.mesh: world.meshes[instance.mesh] for instance in some}
    scene = Scene(replace(world, size=(1.0, 1.0), meshes=meshes, instances=some, swarms=(), backdrop=None))
    pose = frames.pose((0.0, 0.0, float(world.terrain.field.height_at(0, 0)) + 1.0))
    Lidar(LidarConfig(), scene).scan(pose)
    camera = Camera(CameraConfig(width=64, height=48), bake(scene))
    camera.label(pose @ OPTICAL)
    camera.render(pose @ OPTICAL)


def _seconds(work: Callable[[], object]) -> float:
    start = perf_counter()
    work()
    return perf_counter() - start
