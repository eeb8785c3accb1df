# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Light on short grass and on crumbs: grass has no solid surface, so only crumbs shade the ground in photographs."""

from dataclasses import replace

import numpy as np
import pytest
from sense_worlds import F8, make_world

from fieldtruth.core import transforms
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.kernels.camera_rays import Intrinsics, View, new_batch, trace
from fieldtruth.kernels.packets import new_packet
from fieldtruth.render.bake import bake
from fieldtruth.render.materials import CRUMBS
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.camera.sensing import Camera
from fieldtruth.world.materials import GROUND_TYPES
from fieldtruth.world.model import World

LOW_SUN = LightConfig(sun_azimuth_deg=0.0, sun_elevation_deg=20.0)


def covered(name: str) -> World:
    """Flat ground of one colour below the layer of a ground type, uncorrelated from node to node."""
    layer = GROUND_TYPES[name].layer
    assert layer is not None
    world = make_world(side=3.0, spacing=0.05)
    noise = np.random.default_rng(1).standard_normal(world.terrain.field.heights.shape)
    heights = np.maximum(layer.mean + layer.deviation * noise, 0.0).astype(np.float32)
    return replace(world, terrain=replace(world.terrain, layer=heights))


def seen(world: World) -> F8:
    """Brightness of the ground from straight above."""
    config = StereoConfig(width=160, height=160, horizontal_fov_deg=50.0, vertical_fov_deg=50.0)
    baked = bake(Scene(world), LOW_SUN)
    camera = Camera(config, replace(baked, shading=baked.shading._replace(exposure=np.float32(0.8))))
    return np.asarray(camera.render(transforms.pose((0, 0, 2.0), (0, 90, 0)) @ OPTICAL).photo.mean(axis=2))


def contrast(world: World) -> float:
    """Standard deviation of the ground's brightness over that of bare ground."""
    return float((seen(world) / seen(make_world(side=3.0, spacing=0.05))).std())


@pytest.mark.parametrize("name", ["lawn", "dry_grass"])
def test_short_grass_is_shaded_as_the_ground_without_it(name: str) -> None:
    """Only where it is lower than ``CRUMBS``, at one node of twenty, are there facets that light shows."""
    world = covered(name)
    assert world.terrain.layer is not None
    assert (world.terrain.layer < CRUMBS).mean() < 0.055
    assert contrast(world) < 0.035


def test_crumbs_of_earth_are_seen() -> None:
    assert contrast(covered("earth")) > 0.035


def test_texture_detail_follows_each_facet() -> None:
    """A slope of 0.6 that rises to +x: a level ray towards +x sees 0.6 m^2 of it per square metre of the map."""
    scene = Scene(make_world(height=lambda x, _: 0.6 * x, side=6.0, spacing=0.05))
    batch, view = new_batch(1), View(transforms.pose((-1.0, 0, 0)) @ OPTICAL, Intrinsics(1.0, 1.0, 0.0, 0.0), 100.0)
    for down, seen in ((0.0, 0.6), (1.0, 1.6 / np.sqrt(2.0))):
        batch.image[:, 0] = 0.0, down
        trace(scene.rays.alone, scene.hits.geometry_top, new_packet(coherent=False), view, batch, 1)
        assert batch.foreshortening[0] == pytest.approx(seen, rel=1e-4)
