# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A real camera that moves: rolling shutter, motion blur, exposure; and what must not change: truth, order, workers."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import F8, Placed, at, box, make_world

from fieldtruth.core import transforms
from fieldtruth.drive.track import sweep_steps
from fieldtruth.experiment.catalogue import datasheet_of
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.files import load_experiment
from fieldtruth.kernels.photograph import render_strips, strips_of
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraSignal, StereoConfig
from fieldtruth.sensors.camera.sensing import Camera, CameraImages

pytestmark = pytest.mark.usefixtures("small_sky")

WIDTH, HEIGHT = 320, 240
STAMP = 2_000_000_000
ALL = datasheet_of("camera", "zed_2") | {"max_exposure_time_ms": 60.0, "exposure_time_ms": 40.0}
Poses = Callable[[Any], F8]


def camera_config(**signal: Any) -> StereoConfig:
    return StereoConfig(
        width=WIDTH,
        height=HEIGHT,
        horizontal_fov_deg=30.0,
        vertical_fov_deg=22.7,
        mount=Mount(xyz=(0.0, 0.0, 0.0)),
        forward="x",
        signal=CameraSignal(**signal),
    )


FOCAL = camera_config().projection.fx


def turning(rate: float, *, forward: float = 0.0) -> Poses:
    """Poses of a base 1 m above the ground that turns to the left with a rate [rad/s] and drives [m/s] along x."""

    def poses(stamps: Any) -> F8:
        seconds = (np.atleast_1d(stamps) - STAMP) / 1e9
        found = np.stack([transforms.pose((forward * s, 0, 1.0), (0, 0, float(np.degrees(rate * s)))) for s in seconds])
        return found if isinstance(stamps, np.ndarray) else found[0]

    return poses


@pytest.fixture(scope="module")
def post() -> BakedScene:
    """A black post of 0.4 x 0.4 m and 6 m height, 4.2 m ahead of the left camera, before an evenly bright sky."""
    baked = bake(Scene(make_world([(box("post", (0.2, 0.2, 3.0)), at(4.2, 0.06, 3.0))], side=60.0)))
    light, none = baked.shading.light, np.zeros(3, np.float32)
    dome = light.dome._replace(rgb=np.full_like(light.dome.rgb, 0.1), mean=none, horizon=none)
    dark = light._replace(dome=dome, sun_rgb=none, disc=none, volume=np.zeros_like(light.volume))
    return replace(baked, shading=baked.shading._replace(light=dark))


@pytest.fixture(scope="module")
def clutter() -> BakedScene:
    rng = np.random.default_rng(8)
    objects: list[Placed] = [
        (box(f"box_{k}", rng.uniform(0.1, 0.4, 3).tolist(), ["stone", "bark", "wood"][k % 3]),
         transforms.pose((rng.uniform(3, 9), rng.uniform(-2, 2), rng.uniform(0, 2)), rng.uniform(0, 90, 3).tolist()))
        for k in range(25)
    ]  # fmt: skip
    return bake(Scene(make_world(objects, side=30.0)))


def capture(scene: BakedScene, poses: Poses, k: int = 0, side: int = 0, **signal: Any) -> CameraImages:
    config = camera_config(**signal)
    return Camera(config, scene, seed=3).capture(config.imagers()[side], k, STAMP, poses)


def light_of(scene: BakedScene, poses: Poses, **signal: Any) -> NDArray[np.float64]:
    """Luminance (h, w) of the light in an exposure."""
    config = camera_config(**signal)
    camera = Camera(config, scene, seed=3)
    assert config.signal is not None
    exposure_ms = config.signal.exposure_time_ms
    camera.expose(config.imagers()[0], STAMP, poses, exposure_ms / 1e3)
    return np.asarray(camera.linear.mean(axis=-1), np.float64)


def left_edges(light: NDArray[np.float64]) -> F8:
    """Column (h,) of the left edge of the post, to a fraction of a pixel, where it stands before the sky."""
    return np.asarray(light[:, : WIDTH // 2].sum(axis=1) / light.max() - 0.5)


SKY = slice(0, HEIGHT // 2 - 8)


@pytest.mark.parametrize("rate", [0.8, -0.8])
def test_rolling_shutter_skews_a_post_by_rate_times_readout(post: BakedScene, rate: float) -> None:
    """To the left the camera turns, to the right moves the image; lower rows are later."""
    readout = 0.04
    edges = left_edges(light_of(post, turning(rate), readout_ms=1e3 * readout))[SKY]
    slope = np.polyfit(np.arange(HEIGHT)[SKY], edges, 1)[0]
    u = (edges.mean() - (WIDTH - 1) / 2) / FOCAL  # tangent of the edge's angle
    due = rate * readout / HEIGHT * FOCAL * (1.0 + u * u)
    assert slope == pytest.approx(due, rel=0.03)
    still = left_edges(light_of(post, turning(rate)))[SKY]
    assert abs(np.polyfit(np.arange(HEIGHT)[SKY], still, 1)[0]) < 0.02 * abs(due)
    middle = HEIGHT / 2 - 0.5  # its exposure is at the stamp
    assert np.polyval(np.polyfit(np.arange(HEIGHT)[SKY], edges, 1), middle) == pytest.approx(still.mean(), abs=0.25)


@pytest.mark.parametrize(("rate", "time"), [(0.6, 0.05), (-0.6, 0.05), (0.6, 0.1)])
def test_blur_is_as_wide_as_the_motion_during_the_exposure(post: BakedScene, rate: float, time: float) -> None:
    """An edge becomes a ramp: the variance of its slope is width^2 / 12."""
    signal = {"exposure_time_ms": 1e3 * time, "blur_samples": 64}
    sharp, blurred = (light_of(post, turning(rate), **s)[SKY, 20 : WIDTH // 2].mean(axis=0) for s in ({}, signal))
    means, variances = [], []
    for profile in (sharp, blurred):
        slope = np.diff(profile)
        u = np.arange(len(slope))
        share = slope / slope.sum()
        means.append(share @ u)
        variances.append(share @ (u - share @ u) ** 2)
    tangent = (means[0] + 20.5 - (WIDTH - 1) / 2) / FOCAL
    width = abs(rate) * time * FOCAL * (1.0 + tangent**2)
    assert 12.0 * (variances[1] - variances[0]) == pytest.approx(width**2, rel=0.05)
    assert means[1] == pytest.approx(means[0], abs=0.25)  # around the stamp


def test_longer_exposure_of_a_camera_that_stands_is_the_same_photograph(clutter: BakedScene) -> None:
    still = capture(clutter, turning(0.0), response="srgb")
    long = capture(clutter, turning(0.0), response="srgb", exposure_time_ms=100.0, readout_ms=30.0)
    assert np.array_equal(still.photo, long.photo)


def test_strips_with_one_pose_are_the_ideal_photograph(clutter: BakedScene) -> None:
    camera = Camera(camera_config(readout_ms=10.0), clutter, seed=3)
    pose = turning(0.0)(STAMP) @ camera.config.imagers()[0].base_from_optical
    camera.render(pose)
    ideal = camera.linear.copy()
    poses = np.tile(pose, (strips_of(HEIGHT), 1, 1))
    render_strips(
        camera._shading, camera._framebuffer, camera._view(pose), poses, np.zeros(len(poses)), camera._scratch
    )
    assert np.array_equal(camera.linear, ideal)


def test_signal_without_effects_is_the_ideal_camera(clutter: BakedScene) -> None:
    poses = turning(0.3)
    config = camera_config()
    ideal = Camera(config, clutter).render(poses(STAMP) @ config.imagers()[0].base_from_optical)
    found = capture(clutter, poses)
    nearly = capture(clutter, poses, exposure_ev=1e-9)  # through every step, none of which changes more than rounding
    for name in ("photo", "label", "instance", "depth"):
        assert np.array_equal(getattr(found, name), getattr(ideal, name)), name
    assert np.abs(nearly.photo.astype(int) - ideal.photo).max() <= 1


def test_truth_is_that_of_the_stamp(clutter: BakedScene) -> None:
    poses = turning(0.7, forward=2.0)
    config = camera_config()
    ideal = Camera(config, clutter).render(poses(STAMP) @ config.imagers()[0].base_from_optical)
    real = capture(clutter, poses, **ALL)
    for name in ("label", "instance", "depth"):
        assert np.array_equal(getattr(real, name), getattr(ideal, name)), name
    assert np.abs(real.photo.astype(int) - ideal.photo).mean() > 5.0


def test_photographs_depend_on_their_number_alone(clutter: BakedScene) -> None:
    """Of cameras in two threads, in any order; noise differs between numbers, views and seeds."""
    config = camera_config(**ALL)
    left, right = config.imagers()

    def photos(order: list[int], seed: int = 3) -> dict[int, NDArray[np.uint8]]:
        camera, poses = Camera(config, clutter, seed=seed, reuse=True), turning(0.5)
        return {k: camera.capture(left, k, STAMP + k * 40_000_000, poses).photo.copy() for k in order}

    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(photos, ([0, 1, 2, 3], [3, 0, 2, 1]))
    assert all(np.array_equal(first[k], second[k]) for k in range(4))
    still = turning(0.0)
    camera = Camera(config, clutter, seed=3)
    a, b, c = (camera.capture(view, k, STAMP, still).photo for view, k in ((left, 0), (left, 1), (left, 0)))
    assert np.array_equal(a, c)
    assert not np.array_equal(a, b)
    assert not np.array_equal(a, Camera(config, clutter, seed=4).capture(left, 0, STAMP, still).photo)
    assert camera.metered(STAMP, still)[0] == Camera(config, clutter, seed=3).metered(STAMP, still)[0]
    assert not np.array_equal(a, camera.capture(right, 0, STAMP, still).photo)


def test_automatic_exposure_brings_a_photograph_to_its_target(clutter: BakedScene) -> None:
    for target in (0.3, 0.5):
        signal: dict[str, Any] = {"exposure": "automatic", "metering_target": target, "response": "srgb"}
        photo = capture(clutter, turning(0.0), **signal).photo
        assert (photo / 255.0 @ [0.2126, 0.7152, 0.0722]).mean() == pytest.approx(target, abs=0.03)


def test_fixed_exposure_doubles_light_with_each_stop(clutter: BakedScene) -> None:
    dark, bright = (
        capture(clutter, turning(0.0), response="linear", exposure_ev=ev).photo.astype(float) for ev in (0.0, 1.0)
    )
    middle = (dark > 30) & (dark < 100)
    assert middle.sum() > 1000
    assert (bright / np.maximum(dark, 1))[middle].mean() == pytest.approx(2.0, rel=0.01)


def test_drive_lasts_until_the_last_row_is_exposed() -> None:
    values = load_experiment("park_1").model_dump()
    assert sweep_steps(Experiment.model_validate(values).rig) == 0
    values["rig"]["cameras"] = {"signal": {"readout_ms": 18.4, "exposure_time_ms": 1.0, "max_exposure_time_ms": 5.0}}
    assert sweep_steps(Experiment.model_validate(values).rig) == 12  # half of 23.4 ms


@pytest.mark.parametrize(("width", "height"), [(2, 2), (3, 5), (33, 17)])
def test_images_of_any_size_have_light_in_every_pixel(clutter: BakedScene, width: int, height: int) -> None:
    signal = CameraSignal(mosaic="rggb", bits=12, exposure_time_ms=8.0, readout_ms=5.0)
    config = camera_config().model_copy(update={"width": width, "height": height, "signal": signal})
    seen = Camera(config, clutter, seed=3).capture(config.imagers()[0], 0, STAMP, turning(0.5))
    assert seen.photo.shape == (height, width, 3)
    light = Camera(config, clutter, seed=3)
    light.expose(config.imagers()[0], STAMP, turning(0.5), 0.008)
    assert np.isfinite(light.linear).all()
    assert (light.linear.max(axis=-1) > 0.0).all()
