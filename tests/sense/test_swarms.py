# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Every instance of a swarm is hit, with the swarm's instance id and the class of its mesh."""

from dataclasses import replace

import numpy as np
import pytest
from sense_worlds import at, box, make_world, trace_rays

from fieldtruth.core.classes import Label
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.world.model import Swarm, World


def swarming() -> World:
    """A wall with instance id 2, and a swarm with id 3: stones and trunks alternating along y."""
    stone, trunk = box("stone", [0.5, 0.5, 0.5]), box("trunk", [0.25, 0.25, 2.0], "bark")
    world = make_world([(box("wall", [0.1, 9.0, 1.0], "wood"), at(15, 0, 1))])
    poses = np.tile(np.eye(4), (10, 1, 1))
    poses[:, 1, 3] = 2.0 * np.arange(10) - 9.0
    poses[:, 0, 3] = 5.0
    poses[:, :3, :3] *= 1.2
    swarm = Swarm(
        name="mixed",
        kind="mixed",
        object_id=3,
        meshes=("stone", "trunk"),
        mesh=np.arange(10, dtype=np.int32) % 2,
        world_from_object=poses,
        tint=np.ones((10, 3), np.float32),
    )
    meshes = {**world.meshes, "stone": stone, "trunk": trunk}
    return replace(world, meshes=meshes, swarms=(swarm,), object_names=("husky", "ground", "wall", "mixed"))


def test_ranges_classes_and_ids_of_a_swarm() -> None:
    scene = Scene(swarming())
    y = np.array([*(2.0 * np.arange(10) - 9.0), 0.0])
    rays = trace_rays(scene, np.column_stack([np.zeros(11), y, np.full(11, 0.3)]), np.tile([1.0, 0.0, 0.0], (11, 1)))
    assert rays.range_m[:10] == pytest.approx(np.where(np.arange(10) % 2, 5 - 0.3, 5 - 0.6), abs=1e-4)
    assert rays.label[:10].tolist() == [Label.ROCK, Label.TRUNK] * 5
    assert set(rays.instance[:10].tolist()) == {3}
    assert (rays.range_m[10], rays.label[10], rays.instance[10]) == (pytest.approx(14.9, abs=1e-4), Label.BENCH, 2)


def test_camera_labels_a_swarm() -> None:
    images = LabelCamera(StereoConfig(width=128, height=72), Scene(swarming())).label(at(0, 0, 0.5) @ OPTICAL)
    assert {Label.ROCK, Label.TRUNK, Label.BENCH} <= set(np.unique(images.label).tolist())
    assert set(np.unique(images.instance[images.label == Label.ROCK])) == {3}
