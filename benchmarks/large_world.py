# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A large forest against the built-in one: making, size and memory, and what a scan and a photograph cost in it.

Run: python benchmarks/large_world.py [side in metres, 1000 by default]

Times are processor time, which other work slows little. The poses are those of forest_1 in both worlds; scans and
photographs are made in turns, and the best try of each pose counts.
"""

import argparse
import resource
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import TypeVar

from views import poses_on_route

from fieldtruth.bench import Settings, settings_of
from fieldtruth.core.arrays import Array
from fieldtruth.render.bake import bake
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.sensing import Camera
from fieldtruth.sensors.lidar.sensing import Lidar
from fieldtruth.world.build import build_world, load_world, read_world, save_world
from fieldtruth.world.model import World

T = TypeVar("T")
TRIES = 3
Sensor = Callable[[Array], object]


def timed(name: str, make: Callable[[], T]) -> T:
    """Call, and print processor time [s] and the process's peak memory [GB] so far."""
    start = process_time()
    result = make()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"{name:8} {process_time() - start:7.1f} s of processor time, peak {peak:.2f} GB", flush=True)
    return result


def stored(world: World) -> World:
    """Write a world and read it again, as the cache does."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "world.npz"
        timed("store", lambda: save_world(path, world))
        print(f"file     {path.stat().st_size / 1e6:7.0f} MB", flush=True)
        return timed("load", lambda: read_world(path))


def sensors(world: World, settings: Settings, folder: Path | None) -> tuple[tuple[Sensor, Sensor], list[Array]]:
    """A scan and a photograph as functions of the robot's pose, and the poses."""
    rig = settings.experiment.rig
    scene = timed("scene", lambda: Scene(world))
    lidar = Lidar(rig.lidar, scene)
    baked = timed("light", lambda: bake(scene, settings.experiment.light, folder=folder))
    camera = Camera(rig.stereo, baked, reuse=True)
    base_from_optical = rig.imagers[0].base_from_optical
    poses = poses_on_route(settings.experiment.route, world, rig, settings.views)

    def scan(pose: Array) -> object:
        return lidar.scan(pose @ rig.lidar.mount.base_from_sensor)

    return (scan, lambda pose: camera.render(pose @ base_from_optical)), poses


def compare(first: World, second: World, settings: Settings) -> None:
    """Print time of each sensor in the first world over that in the second."""
    with tempfile.TemporaryDirectory() as folder:
        (large, large_poses), (usual, usual_poses) = (
            sensors(world, settings, Path(folder)) for world in (first, second)
        )
    for name, row in (("lidar", 0), ("photo", 1)):
        total = [0.0, 0.0]
        for poses in zip(large_poses, usual_poses, strict=True):
            for side, (sensor, pose) in enumerate(zip((large[row], usual[row]), poses, strict=True)):
                sensor(pose)  # warm: compiled, and in the processor's cache
                total[side] += min(_seconds(sensor, pose) for _ in range(TRIES))
        print(f"{name:8} {total[0] / total[1]:7.3f} of the time in the built-in world", flush=True)


def _seconds(sensor: Sensor, pose: Array) -> float:
    start = process_time()
    sensor(pose)
    return process_time() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("side", nargs="?", type=float, default=1000.0)
    side = parser.parse_args().side
    settings = settings_of("forest")
    world = timed("build", lambda: build_world("forest", settings.experiment.seed, {"size": (side, side)}))
    members = sum(len(swarm.mesh) for swarm in world.swarms)
    print(f"objects  {len(world.instances)} with names, {members} in swarms", flush=True)
    world = stored(world)
    compare(world, load_world("forest", settings.experiment.seed), settings)


if __name__ == "__main__":
    main()
