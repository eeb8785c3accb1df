# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A wire darkens the sky by its width over a pixel's, at any distance and angle and with any lens; labels stay."""

from dataclasses import replace

import numpy as np
import pytest
from sense_worlds import F8, Placed, at, box, make_world

from fieldtruth.core import transforms
from fieldtruth.experiment.imaging_config import OPTICAL, LensConfig
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.kernels.camera_rays import View
from fieldtruth.kernels.packets import LabelBuffers
from fieldtruth.kernels.photograph import new_framebuffer, offsets_of, render_linear, render_mean, strips_of
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.sense.lens import intrinsics_of, ray_table
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig, StereoConfig
from fieldtruth.world.power_lines import CONDUCTOR_RADIUS, hang, make_cable

PIXELS, FOCAL = 160, 300.0
HEIGHT = 8.0
LENS = LensConfig(fx=FOCAL)
FISHEYE = LensConfig(model="equidistant", coefficients=(0.0, 0.0, 0.0, 0.0), fx=FOCAL)


def wire(distance: float, *, analytic: bool = True, sides: int = 5) -> Placed:
    """A taut wire across the x axis at a distance [m] from the camera."""
    reach = 2.0 * distance
    line = hang([distance, -reach, HEIGHT], [distance, reach, HEIGHT], sag=1e-4 * distance)
    mesh, pose = make_cable("wire", line, sides=sides)
    mesh = replace(mesh, materials=("stone",))
    return (mesh if analytic else replace(mesh, axis=None)), pose


def scene(*objects: Placed) -> BakedScene:
    return bake(Scene(make_world(objects, height=-50.0, side=12.0)), LightConfig())


def camera(focal: float = FOCAL, lens: LensConfig = LENS, pixels: int = PIXELS) -> CameraConfig:
    return StereoConfig(width=pixels, height=pixels, lens=lens.model_copy(update={"fx": focal}))


def light(baked: BakedScene, config: CameraConfig, roll: float = 0.0, *, frames_: int = 0, black: bool = True) -> F8:
    """Light (h, w, 3) of a view along x; wires are black, and so is the air before them if ``black``."""
    shading = baked.shading._replace(exposure=np.float32(1.0))
    if black:
        dome = shading.light.dome
        shading = shading._replace(
            wires=shading.wires._replace(albedo=0 * shading.wires.albedo),
            light=shading.light._replace(dome=dome._replace(horizon=0 * dome.horizon)),
        )
    h, w = config.height, config.width
    buffers, pose = new_framebuffer(h, w), transforms.pose((0, 0, HEIGHT + 0.013), (roll, 0, 0)) @ OPTICAL
    labels = LabelBuffers(np.zeros((h, w), np.uint8), np.zeros((h, w), np.uint32), np.zeros((h, w), np.float32))
    view = View(pose, intrinsics_of(config), config.far, ray_table(config))
    if frames_:
        poses = np.tile(pose, (frames_, strips_of(h), 1, 1))
        render_mean(shading, buffers, view, poses, np.zeros(poses.shape[:2]), offsets_of(frames_))
    else:
        render_linear(shading, buffers, view, labels)
    return buffers.linear.astype(np.float64)


@pytest.fixture(scope="module")
def empty() -> BakedScene:
    return scene()


@pytest.mark.parametrize("distance", [10.0, 30.0, 100.0])
def test_each_cross_section_is_darkened_by_the_width(distance: float, empty: BakedScene) -> None:
    baked, width = scene(wire(distance)), 2.0 * CONDUCTOR_RADIUS * FOCAL / distance
    for roll in (0.0, 3.0, 30.0, 45.0, 90.0):
        dark = 1.0 - light(baked, camera(), roll) / light(empty, camera(), roll)
        sums = dark[..., 1].sum(axis=0 if roll <= 45.0 else 1)
        angle = np.radians(roll if roll <= 45.0 else 90.0 - roll)
        assert np.allclose(sums[25:-25], width / np.cos(angle), rtol=0.03), roll


@pytest.mark.parametrize(("lens", "count"), [(FISHEYE, 0), (LENS, 4), (FISHEYE, 4)])
def test_lenses_and_subframes_see_the_same_width(lens: LensConfig, count: int, empty: BakedScene) -> None:
    baked, width = scene(wire(30.0)), 2.0 * CONDUCTOR_RADIUS * FOCAL / 30.0
    config = camera(lens=lens)
    dark = 1.0 - light(baked, config, 30.0, frames_=count) / light(empty, config, 30.0, frames_=count)
    middle = slice(PIXELS // 2 - 25, PIXELS // 2 + 25)
    assert np.allclose(dark[..., 1].sum(axis=0)[middle], width / np.cos(np.radians(30.0)), rtol=0.03)


def test_light_of_a_wire_is_the_mean_over_its_width(empty: BakedScene) -> None:
    """A round tube that is 40 pixels wide, rendered as a mesh, is the oracle."""
    distance, finer = 10.0, 100
    tube = scene(wire(distance, analytic=False, sides=48))
    fine = camera(FOCAL * finer, pixels=128)
    seen = light(tube, fine, black=False)
    on = light(empty, fine, black=False)[..., 2] != seen[..., 2]
    assert 35 < on.sum(axis=0).min() <= on.sum(axis=0).max() < 44
    expected = seen[on].mean(axis=0)
    wired = scene(wire(distance))
    coarse = light(wired, camera(), black=False)
    black = light(wired, camera())
    background = light(empty, camera(), black=False)
    share = (1.0 - black / background).sum(axis=(0, 1))
    assert np.allclose((coarse - black).sum(axis=(0, 1)) / share, expected, rtol=0.04)


def test_what_is_before_a_wire_hides_it(empty: BakedScene) -> None:
    wall = box("wall", (0.1, 1.0, 1.0)), at(8.0, 0.0, HEIGHT)
    both, alone = light(scene(wire(10.0), wall), camera()), light(scene(wall), camera())
    hidden = slice(PIXELS // 2 - 30, PIXELS // 2 + 30)
    assert np.array_equal(both[:, hidden], alone[:, hidden])
    beyond = light(scene(wire(6.0), wall), camera()) / alone
    assert (1.0 - beyond[:, hidden, 1]).sum(axis=0).min() > 0.2
    assert not np.allclose(light(scene(wire(10.0)), camera()), light(empty, camera()))


def test_labels_are_those_of_the_mesh() -> None:
    config = camera()
    images = []
    for analytic in (True, False):
        baked = scene(wire(10.0, analytic=analytic))
        h, w = config.height, config.width
        labels = LabelBuffers(np.zeros((h, w), np.uint8), np.zeros((h, w), np.uint32), np.zeros((h, w), np.float32))
        pose = transforms.pose((0, 0, HEIGHT + 0.013), (17.0, 0, 0)) @ OPTICAL
        view = View(pose, intrinsics_of(config), config.far, ray_table(config))
        render_linear(baked.shading, new_framebuffer(h, w), view, labels)
        images.append(labels)
    assert (images[0].instance == 2).sum() > 20
    first, second = images
    assert np.array_equal(first.label, second.label)
    assert np.array_equal(first.instance, second.instance)
    assert np.array_equal(first.depth, second.depth)


def test_wires_cast_shadows() -> None:
    """Geometry with the mask of wires stops shadow rays: thick tubes above the ground shade a strip of it."""
    line = hang([0.0, -8.0, 1.0], [0.0, 8.0, 1.0], sag=0.001)
    mesh, pose = make_cable("wire", line, radius=0.3)
    sun = bake(Scene(make_world([(replace(mesh, materials=("stone",)), pose)]))).shading.light.ground_sun
    assert (sun.values < 0.1).any()
