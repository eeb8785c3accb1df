# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Cost of the signal of a LiDAR: scans with it beside ideal scans, in turns, in one process.

Processor time of one thread, the least of several repetitions of each pose: ``python benchmarks/signals.py park``.
"""

import argparse
import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core import transforms
from fieldtruth.experiment.catalogue import datasheet_of
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.lidar.config import LidarConfig, LidarSignal
from fieldtruth.sensors.lidar.sensing import Lidar
from fieldtruth.world.build import load_world
from fieldtruth.world.model import World

signal_of = LidarSignal.model_validate

MODEL = "os1_64_gen1"


def poses_in(world: World, count: int) -> Iterator[NDArray[np.float64]]:
    """Poses 1 m above the ground."""
    rng, ground = np.random.default_rng(0), world.terrain.surface
    for _ in range(count):
        x, y = rng.uniform(-0.3, 0.3, 2) * np.array(world.size)
        yield transforms.pose((x, y, float(ground.height_at(x, y)) + 1.0), (0.0, 0.0, float(rng.uniform(0, 360))))


def configurations(sheet: dict[str, object]) -> dict[str, LidarConfig]:
    """LiDARs by name, the ideal one first."""
    rays = {f"{count} rays": LidarConfig(signal=signal_of({**sheet, "sub_rays": count})) for count in (3, 5, 7)}
    two = LidarConfig(signal=signal_of({**sheet, "sub_rays": 3, "returns": "two"}))
    return {
        "ideal": LidarConfig(),
        "power and noise": LidarConfig(signal=signal_of(sheet)),
        **rays,
        "3 rays, two returns": two,
    }


def main() -> None:
    """Print a row for each LiDAR: time of a scan, its ratio to the ideal one, points, and shares of what differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("environment", nargs="?", default="park")
    parser.add_argument("--poses", type=int, default=8)
    parser.add_argument("--repetitions", type=int, default=5)
    options = parser.parse_args()
    world = load_world(options.environment)
    scene, poses = Scene(world), list(poses_in(world, options.poses))
    lidars: dict[str, Lidar] = {
        name: Lidar(config, scene) for name, config in configurations(datasheet_of("lidar", MODEL)).items()
    }
    seconds = np.zeros((options.repetitions, len(lidars), len(poses)))
    for lidar in lidars.values():
        lidar.scan(poses[0])
    for repetition in range(options.repetitions):
        for p, pose in enumerate(poses):
            for row, lidar in enumerate(lidars.values()):
                begin = time.thread_time()
                lidar.scan(pose)
                seconds[repetition, row, p] = time.thread_time() - begin
    least = seconds.min(axis=0).mean(axis=1)
    print(f"{options.environment}, {len(poses)} poses, 64 x 512 beams, figures of {MODEL}")
    for (name, lidar), spent in zip(lidars.items(), least, strict=True):
        scans = [lidar.scan(pose) for pose in poses]
        points = sum(len(scan.label) for scan in scans) / len(poses)
        mixed = np.mean(np.concatenate([getattr(scan, "mixed", np.zeros(1)) for scan in scans]))
        print(f"{name:22} {1e3 * spent:7.2f} ms  {spent / least[0]:5.2f}  {points:8.0f} points  {mixed:6.1%} mixed")


if __name__ == "__main__":
    main()
