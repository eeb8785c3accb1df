# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Photographs of bodies that move: their shadows and their light, rolling shutters and exposure times."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation
from sense_worlds import F8, at, box, make_world

from fieldtruth.core import transforms
from fieldtruth.drive.track import standing_at
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.sense.interval import Moving
from fieldtruth.sense.moving import MovingBody
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig, CameraSignal
from fieldtruth.sensors.camera.sensing import Camera, IdealCamera

pytestmark = pytest.mark.usefixtures("small_sky")

STAMP = 2_000_000_000
NORTH = LightConfig(sun_azimuth_deg=0.0, sun_elevation_deg=40.0)
HALF = (0.5, 0.8, 0.3)
CRATE_ID = 5


def crate(height: float, velocity: tuple[float, float, float], half: tuple[float, float, float] = HALF) -> MovingBody:
    """A box that is above the origin at STAMP."""

    def poses(stamps: NDArray[np.int64]) -> F8:
        found = np.tile(at(0, 0, height), (len(stamps), 1, 1))
        found[:, :3, 3] += ((stamps - STAMP) / 1e9)[:, None] * velocity
        return found

    return MovingBody(name="crate", object_id=CRATE_ID, mesh=box("crate", half, "wood"), pose=poses)


def config(**signal: Any) -> CameraConfig:
    return CameraConfig(
        width=320,
        height=240,
        horizontal_fov_deg=40.0,
        vertical_fov_deg=30.0,
        mount=Mount(xyz=(0.0, 0.0, 0.0)),
        far=100.0,
        signal=CameraSignal(**signal) if signal else None,
    )


@pytest.fixture(scope="module")
def meadow() -> BakedScene:
    return bake(Scene(make_world(side=24.0), Moving([crate(1.5, (2, 1, 0))])), NORTH)


def meets_crate(points: F8, towards: F8, centre: F8, margin: float) -> NDArray[np.bool_]:
    """Return whether rays from points (n, 3) meet the box about a centre, larger by a margin [m] on each side."""
    along = np.where(np.abs(towards) < 1e-9, 1e-9, towards)
    half = np.array(HALF) + margin
    first, second = (centre - half - points) / along, (centre + half - points) / along
    near, far = np.minimum(first, second).max(axis=1), np.maximum(first, second).min(axis=1)
    return np.asarray((near < far) & (far > 0))


@pytest.mark.parametrize("since", [0, 300_000_000])
def test_a_body_casts_the_shadow_of_its_instant_on_the_ground(meadow: BakedScene, since: int) -> None:
    camera = IdealCamera(config(), meadow)
    eye = transforms.pose((-1.0, 0.3, 9.0), (0, 90, 0)) @ OPTICAL
    bare = IdealCamera(config(), replace(meadow, scene=meadow.scene.still))
    bare.render(eye, stamp_ns=STAMP + since)
    before = bare._framebuffer.linear.copy()
    images = camera.render(eye, stamp_ns=STAMP + since)
    ratio = camera._framebuffer.linear[..., 1] / before[..., 1]
    ground = (images.label != 0) & (images.instance == 1)
    v, u = np.nonzero(ground)
    lens, depth = camera.intrinsics, images.depth[ground].astype(np.float64)
    rays = np.stack([(u - lens.cx) / lens.fx * depth, (v - lens.cy) / lens.fy * depth, depth], axis=-1)
    points, sun = transforms.transform(eye, rays), meadow.shading.light.sun
    centre = np.array([2.0, 1.0, 0.0]) * since / 1e9 + [0, 0, 1.5]
    shaded, lit = meets_crate(points, sun, centre, -0.06), ~meets_crate(points, sun, centre, 0.06)
    assert shaded.sum() > 300
    assert ratio[ground][shaded].max() < 0.75
    beyond = ~binary_dilation(images.instance == CRATE_ID, iterations=3)[ground]
    assert ratio[ground][lit & beyond] == pytest.approx(1.0, abs=1e-5)


def test_the_side_of_a_body_towards_the_sun_is_brighter_and_a_roof_above_it_takes_the_sun(meadow: BakedScene) -> None:
    world = make_world(side=24.0)
    roof = replace(crate(2.0, (0, 0, 0), (4.0, 4.0, 0.1)), name="roof", object_id=6)
    roof = replace(roof, mesh=box("roof", (4.0, 4.0, 0.1), "stone"))
    low = crate(0.5, (0, 0, 0))
    found = []
    for bodies in ([low], [low, roof]):
        baked = bake(Scene(world, Moving(bodies)), NORTH)
        for turn in (0.0, 180.0):
            camera = IdealCamera(config(), baked)
            away = -5.0 if turn == 0.0 else 5.0
            images = camera.render(transforms.pose((away, 0, 0.5), (0, 0, turn)) @ OPTICAL, stamp_ns=STAMP)
            found.append(float(camera._framebuffer.linear[images.instance == CRATE_ID].mean()))
    dark, sunny, dark_below, sunny_below = found
    assert sunny > 1.8 * dark
    assert sunny_below < 0.6 * sunny
    assert dark_below == pytest.approx(dark, rel=0.05)


def test_a_body_is_as_open_to_the_light_below_its_origin_as_above(meadow: BakedScene) -> None:
    near = meadow.shading.light.vertex_near[-len(meadow.scene.meshes[-1].vertices) :]
    assert near.min() > 0.95  # a convex body has nothing of its own near


@pytest.fixture(scope="module")
def backlit() -> BakedScene:
    """A black post that moves to the left with 5 m/s, 4.8 m before the camera, before an evenly bright sky."""
    post = crate(3.0, (0, 5, 0), (0.2, 0.3, 3.0))
    baked = bake(Scene(make_world(side=60.0), Moving([post])))
    light, none = baked.shading.light, np.zeros(3, np.float32)
    dome = light.dome._replace(rgb=np.full_like(light.dome.rgb, 0.1), mean=none, horizon=none)
    dark = light._replace(dome=dome, sun_rgb=none, disc=none, volume=np.zeros_like(light.volume))
    return replace(baked, shading=baked.shading._replace(light=dark))


EYE = transforms.pose((-5.0, 0, 1.0), (0, 0, 0))


def widths(camera: Camera) -> tuple[F8, F8]:
    """Middle [pixel] of the post in each row above the horizon, and the pixels that it covers in part."""
    light = camera.linear[:110, :, 1].astype(np.float64)
    cover = 1.0 - light / light.max()
    columns = np.arange(cover.shape[1])
    return (cover * columns).sum(axis=1) / cover.sum(axis=1), ((cover > 0.02) & (cover < 0.98)).sum(axis=1)


def test_rows_of_a_rolling_shutter_see_a_body_at_their_own_times(backlit: BakedScene) -> None:
    camera = Camera(config(readout_ms=40.0), backlit, seed=1)
    imager = camera.config.imagers()[0]
    pose = EYE @ OPTICAL @ transforms.inverse(imager.base_from_optical)
    images = camera.expose(imager, STAMP, standing_at(pose), 0.0)
    middle, _ = widths(camera)
    strip = np.arange(110) // 4 * 4 + 2.0
    seconds = (strip / 240 - 0.5) * 0.04
    lens = camera.intrinsics
    expected = lens.cx - lens.fx * 5.0 * seconds / 4.8
    assert np.ptp(expected) > 6.0
    assert np.abs(middle - expected).max() < 0.6
    own = np.nonzero(images.instance[:110] == CRATE_ID)[1]  # labels are those of the stamp
    assert own.mean() == pytest.approx(lens.cx, abs=0.6)


def test_a_body_is_blurred_by_its_motion_while_the_shutter_is_open(backlit: BakedScene) -> None:
    camera = Camera(config(exposure_time_ms=10.0, blur_samples=32), backlit, seed=1)
    imager = camera.config.imagers()[0]
    pose = EYE @ OPTICAL @ transforms.inverse(imager.base_from_optical)
    camera.expose(imager, STAMP, standing_at(pose), 0.03)
    middle, partly = widths(camera)
    moved = camera.intrinsics.fx * 5.0 * 0.03 / 4.8
    assert moved > 10.0
    assert middle == pytest.approx(camera.intrinsics.cx, abs=0.6)
    assert partly == pytest.approx(2 * moved, rel=0.2)  # at both of its sides
