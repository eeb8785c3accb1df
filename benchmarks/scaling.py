# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Cost of dense vegetation and many trees: photographs in two worlds in turns, so that other load slows both equally.

Run: python benchmarks/scaling.py

- forest_over_park_image: time of a photograph in the forest over one in the park.
- ten_times_trees: time of a photograph in the forest with ten times its trees over one in the forest as it is. The
  additional trees surround it at the same density, so that the camera sees as much leaf and trunk and only the number
  of trees differs; a forest thinned to a tenth would show more sky instead, which costs nothing.
"""

import argparse
from dataclasses import replace
from itertools import product
from time import perf_counter

import numpy as np
from views import poses_on_route

from fieldtruth.bench import Settings, settings_of
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.render.bake import bake
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.sensing import Camera
from fieldtruth.world.build import load_world
from fieldtruth.world.model import Instance, World

TRIES = 3


def with_trees_around(world: World, times: int = 10) -> World:
    """Add copies of the world's trees, moved by whole lengths and widths of it, until there are ``times`` as many."""
    steps = sorted(
        product(range(-times, times + 1), repeat=2),
        key=lambda s: (np.hypot(s[0] * world.size[0], s[1] * world.size[1]), s),
    )
    moves = [np.array(step) * world.size for step in steps[1:times]]
    trees = [instance for instance in world.instances if is_tree(world, instance)]
    copies = [_moved(world, tree, move) for move in moves for tree in trees]
    return replace(world, instances=(*world.instances, *copies))


def is_tree(world: World, instance: Instance) -> bool:
    """Return whether an object has a crown, unlike fallen and dead trees."""
    names = world.meshes[instance.mesh].materials
    return any(world.materials[name].label == Label.TREETOP for name in names)


def _moved(world: World, tree: Instance, move: Array) -> Instance:
    height_at = world.terrain.field.height_at
    pose = tree.world_from_object.copy()
    before = float(height_at(*pose[:2, 3]))
    pose[:2, 3] += move
    pose[2, 3] += float(height_at(*pose[:2, 3])) - before
    return replace(tree, world_from_object=pose)


def image_time_ratio(first: tuple[World, Settings], second: tuple[World, Settings]) -> float:
    """Time of photographs along the first route over that along the second; the best try of each view counts."""
    total = np.zeros(2)
    sides = [_views(*side) for side in (first, second)]
    for poses in zip(*(poses for _, poses in sides), strict=True):
        tries = [[_seconds(camera, pose) for (camera, _), pose in zip(sides, poses, strict=True)] for _ in range(TRIES)]
        total += np.min(tries, axis=0)
    return float(total[0] / total[1])


def _views(world: World, settings: Settings) -> tuple[Camera, list[Array]]:
    experiment = settings.experiment
    config = experiment.rig.stereo
    poses = poses_on_route(experiment.route, world, experiment.rig, settings.views)
    base_from_optical = config.imagers()[0].base_from_optical
    camera = Camera(config, bake(Scene(world), experiment.light), reuse=True)
    camera.render(poses[0] @ base_from_optical)  # kernels are compiled before the clock runs
    return camera, [pose @ base_from_optical for pose in poses]


def _seconds(camera: Camera, pose: Array) -> float:
    start = perf_counter()
    camera.render(pose)
    return perf_counter() - start


def main() -> None:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    park, forest = settings_of("park"), settings_of("forest")
    meadow, wood = (load_world(each.experiment.environment, each.experiment.seed) for each in (park, forest))
    print(f"forest_over_park_image {image_time_ratio((wood, forest), (meadow, park)):.3f}", flush=True)
    print(f"ten_times_trees {image_time_ratio((with_trees_around(wood), forest), (wood, forest)):.3f}")


if __name__ == "__main__":
    main()
