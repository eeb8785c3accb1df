# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Instance ids of any size reach clouds and images unchanged; some would be equal if they were cut to 16 bits."""

from dataclasses import replace

import numpy as np
import pytest
from sense_worlds import at, box, make_world

from fieldtruth.core import transforms
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.render.bake import bake
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.sensors.camera.sensing import Camera
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import IdealLidar
from fieldtruth.world.model import World

pytestmark = pytest.mark.usefixtures("small_sky")

IDS = (2, 65_535, 65_536 + 2, 3 * 65_536 + 2)
"""From left to right; the last two are 2 in 16 bits."""


@pytest.fixture(scope="module")
def world() -> World:
    cube = box("cube", (0.5, 0.5, 2.0))
    tiny = make_world([(cube, at(6.0, 1.4 - k, 1.0)) for k in range(4)])
    instances = tuple(replace(each, object_id=own) for each, own in zip(tiny.instances, IDS, strict=True))
    return replace(tiny, instances=instances)


def test_cloud_and_images_have_the_ids_of_the_world(world: World) -> None:
    assert world.has_wide_ids
    assert not replace(world, instances=world.instances[:2]).has_wide_ids
    scene, pose = Scene(world), transforms.pose((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    scan = IdealLidar(LidarConfig(columns=512, rings=9), scene).scan(pose)
    near = (scan.xyz[:, 0] > 5.0) & (np.abs(scan.xyz[:, 0] - 5.5) < 0.01)
    expected = np.array(IDS)[np.clip((1.9 - scan.xyz[near, 1]).astype(int), 0, 3)]
    np.testing.assert_array_equal(scan.instance[near], expected)
    assert set(expected) == set(IDS)
    config = StereoConfig(width=64, height=32)
    baked = bake(scene, LightConfig())
    for images in (LabelCamera(config, scene).label(pose @ OPTICAL), Camera(config, baked).render(pose @ OPTICAL)):
        row = images.instance[12]
        assert tuple(dict.fromkeys(row[row > 1].tolist())) == IDS
