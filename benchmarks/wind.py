# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Cost of wind: time of a scan and of a photograph in wind over that in the still world, side by side.

Run: python benchmarks/wind.py [park lake forest hillside] [--repeats N] [--readings scan ...]

The table has medians [ms] of readings at 10 Hz of both worlds in turn, in one process, each at a stamp of its own, so
that the plants are built for each; with a pair of cameras or other sensors at one stamp they are built once for all.
The last column is what the plants' poses and their Embree scene take of it.
"""

import argparse
import statistics
import time
from typing import Any, Final

import numpy as np

from fieldtruth.core import transforms
from fieldtruth.core.errors import UnknownNameError
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.wind_config import WindConfig
from fieldtruth.render.bake import bake
from fieldtruth.sense.interval import Moving
from fieldtruth.sense.scene import Scene
from fieldtruth.sense.wind import leaning_of
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.sensing import IdealCamera
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import IdealLidar
from fieldtruth.world.build import load_world
from fieldtruth.world.environments import ENVIRONMENTS

PERIOD_NS: Final = 100_000_000
READINGS: Final = ("scan", "spinning", "photograph")
BLOWING: Final = WindConfig(speed_m_s=8.0)
LIDAR: Final = LidarConfig(columns=1024, rings=64)
CAMERA: Final = CameraConfig(width=640, height=360)


def readings_of(scene: Scene, name: str) -> Any:
    """Return the function that makes a reading at a stamp, from the middle of the world."""
    ground = float(scene.world.terrain.surface.height_at(0.0, 0.0))
    pose = transforms.pose((0.0, 0.0, ground + 1.0))
    if name == "photograph":
        camera = IdealCamera(CAMERA, bake(scene), reuse=True)
        return lambda stamp: camera.render(pose @ OPTICAL, stamp_ns=stamp)
    lidar, poses = IdealLidar(LIDAR, scene), pose
    if name == "spinning":
        poses = np.tile(pose, (LIDAR.columns + 1, 1, 1))
    return lambda stamp: lidar.scan(poses, stamp)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("environments", nargs="*", default=["park", "lake", "forest", "hillside"])
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--readings", nargs="+", default=READINGS, choices=READINGS)
    options = parser.parse_args()
    if options.repeats < 1:
        parser.error(f"argument --repeats: must be at least 1, got {options.repeats}")
    if unknown := [name for name in options.environments if name not in ENVIRONMENTS]:
        parser.error(str(UnknownNameError("environment", unknown[0], [*ENVIRONMENTS])))
    print(f"{'world':9} {'plants':>7}  {'reading':11} {'still':>8} {'wind':>8}  ratio  {'of it plants':>12}")
    for environment in options.environments:
        world = load_world(environment, 1)
        leaning = leaning_of(BLOWING, world, 1)
        assert leaning is not None
        scenes = Scene(world), Scene(world, Moving(leaning=leaning))
        for name in options.readings:
            reads, times = [readings_of(scene, name) for scene in scenes], [list[float](), list[float](), list[float]()]
            for number in range(options.repeats + 1):
                stamp = (number + 10) * PERIOD_NS
                for own, read in zip(times, reads, strict=False):
                    began = time.process_time()
                    read(stamp)
                    own += [1e3 * (time.process_time() - began)] * (number > 0)
                began = time.process_time()
                later = stamp + 1000 * PERIOD_NS
                scenes[1].interval(later, later + (name == "spinning"), np.zeros(3), 0.0)
                times[2] += [1e3 * (time.process_time() - began)] * (number > 0)
            still, windy, plants = map(statistics.median, times)
            print(
                f"{environment:9} {len(leaning.rows):7}  {name:11} {still:8.1f} {windy:8.1f}  {windy / still:5.2f}"
                f"  {plants:12.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
