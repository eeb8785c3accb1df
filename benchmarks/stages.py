# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Cost of a run besides its sensors: world, light, drive, start-up and threads.

Run: python benchmarks/stages.py [ENVIRONMENT ...], by default in the park. Worlds and light are cached in a temporary
folder, so that nothing of an earlier run is used but compiled kernels. Docs: docs/benchmarks.md.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from views import record

import fieldtruth as ft
from fieldtruth.bench import settings_of, table
from fieldtruth.bench.sensors import stretches_of
from fieldtruth.core.parallel import peak_memory
from fieldtruth.drive.plan import experiments_in
from fieldtruth.drive.simulate import drive
from fieldtruth.experiment.files import with_overrides
from fieldtruth.world.build import world_of

DRIVE_SECONDS, PAIRS = 60.0, 24
FIGURES = (
    "world_build_s",
    "light_bake_s",
    "world_load_s",
    "first_frame_s",
    "drive_realtime_factor",
    "two_workers_speedup",
    "peak_rss_mb",
)
FIRST_FRAME = """
import sys
import fieldtruth as ft
world = ft.load_world(sys.argv[1], 0)
pose = ft.transforms.pose((0, 0, float(world.terrain.field.height_at(0, 0)) + 0.8)) @ ft.OPTICAL
ft.Camera(ft.CameraConfig(), ft.bake(ft.Scene(world))).render(pose)
"""


def seconds(work: Callable[[], object]) -> float:
    start = perf_counter()
    work()
    return perf_counter() - start


def stages(environment: str) -> dict[str, float]:
    """Measure one environment; the cache folder must be empty."""
    experiment, found = settings_of(environment).experiment, {}
    build_s = seconds(lambda: world_of(experiment))  # and write it to the cache
    load_s = seconds(lambda: world_of(experiment))
    world = world_of(experiment)
    scene_s, scene = seconds(lambda: ft.Scene(world)), ft.Scene(world)
    found["light_bake_s"] = seconds(lambda: ft.bake(scene, experiment.light))
    found["world_build_s"] = build_s + scene_s + found["light_bake_s"]
    found["world_load_s"] = load_s + scene_s + seconds(lambda: ft.bake(scene, experiment.light))
    start_python = [sys.executable, "-c", FIRST_FRAME, environment]
    found["first_frame_s"] = seconds(lambda: subprocess.run(start_python, check=True))
    factors = []
    for each in experiments_in(environment):
        short = with_overrides(each, seconds=DRIVE_SECONDS)
        start = perf_counter()
        track = drive(world, short)
        factors.append(track.duration_s / (perf_counter() - start))
    found["drive_realtime_factor"] = min(factors)
    rig = experiment.rig.model_copy(update={"sensors": experiment.rig.enabled(ft.CameraConfig)})
    baked, rates = ft.bake(scene, experiment.light), {1: 0.0, 2: 0.0}
    for _ in range(2):
        for workers in rates:
            took, images, _ = record(baked, track, rig, stretches_of(track.duration_s, PAIRS, 2), workers=workers)
            rates[workers] = max(rates[workers], images / took)
    found["two_workers_speedup"] = rates[2] / rates[1]
    return found | {"peak_rss_mb": (peak_memory() or 0) / 1e6}


def main() -> None:
    if sys.argv[1:2] == ["--json"]:
        print(json.dumps(stages(sys.argv[2])))
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("environments", nargs="*", default=["park"])
    environments = parser.parse_args().environments
    with TemporaryDirectory() as warm:  # kernels are compiled before the clock runs
        environment = os.environ | {"XDG_CACHE_HOME": warm}
        subprocess.run([sys.executable, "-c", FIRST_FRAME, "park"], check=True, env=environment)
        for name in environments:  # each in its own process, for its own peak memory
            for path in Path(warm, "fieldtruth").glob("*.npz"):
                path.unlink()
            command = [sys.executable, __file__, "--json", name]
            done = subprocess.run(command, check=True, env=environment, capture_output=True, text=True)
            figures = json.loads(done.stdout)
            print(f"{name}\n{table({key: figures[key] for key in FIGURES if key in figures})}\n", flush=True)


if __name__ == "__main__":
    main()
