# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What more and denser trees cost: photographs of two places in turns, so that a busy machine slows both alike.

Two questions, two figures. How much dearer is a dense place than an open one: the forest's photograph over the park's.
And what does number alone cost: the forest over the same forest with a tenth of its trees, where the camera sees as
much leaf and trunk, because the other nine tenths stand around it in as dense a wood. Thinning the trees out instead
would measure how much sky is seen.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from time import perf_counter
from typing import Final

import numpy as np

from fieldtruth.bench.measure import Settings, empty_cache, settings_of
from fieldtruth.bench.sensing import poses_along
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.core.progress import Progress
from fieldtruth.experiment.rig import CAMERA_FROM_OPTICAL
from fieldtruth.render.bake import bake
from fieldtruth.render.camera import Camera
from fieldtruth.sense.scene import Scene
from fieldtruth.world.build import load_world
from fieldtruth.world.model import Instance, World

TIMES: Final = 10
OPEN, DENSE = "park", "forest"


def with_trees_around(world: World, times: int = TIMES) -> World:
    """Return the world with ``times`` as many trees: copies of its own, moved by whole sizes of it to all sides.

    They stand on the ground as its edge has it, at the same density, so that it looks like the middle of a larger wood.
    """
    steps = sorted(
        product(range(-times, times + 1), repeat=2),
        key=lambda s: (np.hypot(s[0] * world.size[0], s[1] * world.size[1]), s),
    )
    moves = [np.array(step) * world.size for step in steps[1:times]]
    trees = [instance for instance in world.instances if is_tree(world, instance)]
    copies = [_moved(world, tree, move) for move in moves for tree in trees]
    return replace(world, instances=(*world.instances, *copies))


def is_tree(world: World, instance: Instance) -> bool:
    """Whether an object has a crown; fallen and dead trees have none."""
    names = world.meshes[instance.mesh].materials
    return any(world.materials[name].label == Label.TREETOP for name in names)


def _moved(world: World, tree: Instance, move: Array) -> Instance:
    height_at = world.terrain.field.height_at
    pose = tree.world_from_object.copy()
    before = float(height_at(*pose[:2, 3]))
    pose[:2, 3] += move
    pose[2, 3] += float(height_at(*pose[:2, 3])) - before
    return replace(tree, world_from_object=pose)


def measure_ratios(environments: Sequence[str], progress: Progress) -> dict[str, float]:
    """Figures of ``RATIOS``, as far as these environments allow; caches stay as they are."""
    found: dict[str, float] = {}
    with empty_cache():
        if not {OPEN, DENSE} <= set(environments):
            return found
        with progress.stage(f"build {OPEN} and {DENSE}"):
            settings = {name: settings_of(name) for name in (OPEN, DENSE)}
            worlds = {name: load_world(name, settings[name].experiment.seed) for name in settings}
        with progress.stage("forest over park"):
            found["forest_over_park_image"] = image_time_ratio(
                (worlds[DENSE], settings[DENSE]), (worlds[OPEN], settings[OPEN])
            )
        with progress.stage("ten times the trees"):
            many = with_trees_around(worlds[DENSE])
            found["ten_times_trees"] = image_time_ratio((many, settings[DENSE]), (worlds[DENSE], settings[DENSE]))
    return found


def image_time_ratio(first: tuple[World, Settings], second: tuple[World, Settings]) -> float:
    """Time of photographs along the first route by that along the second; of each view the best try counts."""
    total = np.zeros(2)
    sides = [_views(*side) for side in (first, second)]
    for poses in zip(*(poses for _, poses in sides), strict=True):
        tries = [
            [_seconds(camera, pose) for (camera, _), pose in zip(sides, poses, strict=True)]
            for _ in range(max(first[1].repeats, second[1].repeats))
        ]
        total += np.min(tries, axis=0)
    return float(total[0] / total[1])


def _views(world: World, settings: Settings) -> tuple[Camera, list[Array]]:
    experiment = settings.experiment
    config = experiment.rig.cameras
    poses = poses_along(experiment.route, world, experiment.rig, settings.views)
    base_from_optical = config.left.base_from_sensor @ CAMERA_FROM_OPTICAL
    camera = Camera(config, bake(Scene(world), experiment.light), reuse=True)
    camera.render(poses[0] @ base_from_optical)  # light is baked, and kernels compiled, before the clock runs
    return camera, [pose @ base_from_optical for pose in poses]


def _seconds(camera: Camera, pose: Array) -> float:
    start = perf_counter()
    camera.render(pose)
    return perf_counter() - start
