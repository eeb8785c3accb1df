# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Relief of ground textures: what hides what, sun and shadow, equal light at every distance; wet ground."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import F8, make_world

from fieldtruth.core import transforms
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.kernels.camera_rays import View
from fieldtruth.kernels.packets import LabelBuffers
from fieldtruth.kernels.photograph import new_framebuffer, render_linear
from fieldtruth.kernels.textures import LEVELS, SUN_ONE, linear_from_srgb, patch_offsets, srgb_from_linear
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.render.materials import (
    THROUGH,
    WATER,
    make_atlas,
    material_table,
    mean_reflectance,
    sun_factors,
    wet_albedo,
)
from fieldtruth.sense.lens import intrinsics_of
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.camera.sensing import Camera, CameraImages
from fieldtruth.world.model import World
from fieldtruth.world.textures import make_texture

SEED = np.random.SeedSequence(3)
RED, BLUE = (150, 40, 40), (40, 40, 150)
SUN = LightConfig(sun_azimuth_deg=0.0, sun_elevation_deg=40.0)


def waves(n: int = 256, ridges: int = 8) -> NDArray[np.uint8]:
    """Ridges across u, whose flanks are red where they rise with u, blue where they fall."""
    phase = (np.arange(n) + 0.5) / n * ridges % 1
    flank = np.where((phase < 0.5)[:, None], RED, BLUE)
    line = np.column_stack([flank, np.rint(255 * (1 - np.abs(2 * phase - 1)))])
    return np.broadcast_to(line, (n, n, 4)).astype(np.uint8)


def ground_of(texture: NDArray[np.uint8], *, relief: float, repeat: float, side: float = 44.0) -> World:
    """A plane of one material."""
    world = make_world(side=side, spacing=1.0)
    soil = replace(world.materials["soil"], texture="own", relief=relief, repeat=repeat, ground_type="earth")
    return replace(world, materials={**world.materials, "soil": soil}, textures={**world.textures, "own": texture})


def baked(world: World, light: LightConfig = SUN) -> BakedScene:
    return bake(Scene(world), light)


def seen(scene: BakedScene, position: tuple[float, float, float], yaw: float, down: float) -> CameraImages:
    config = StereoConfig(width=320, height=200, horizontal_fov_deg=32.0, vertical_fov_deg=20.0)
    return Camera(config, scene).render(transforms.pose(position, (0, down, yaw)) @ OPTICAL)


@cache
def ridged(relief: float) -> BakedScene:
    """Ridges under a sun overhead."""
    return baked(ground_of(waves(), relief=relief, repeat=0.8, side=20.0), LightConfig(sun_elevation_deg=89.0))


@cache
def texture_of(name: str) -> NDArray[np.uint8]:
    return make_texture(name, SEED)


@pytest.mark.parametrize(("yaw", "shown", "hidden"), [(0, 0, 2), (180, 2, 0)])
def test_a_ridge_shows_the_side_that_faces_the_camera(yaw: float, shown: int, hidden: int) -> None:
    """A camera that looks towards +x sees the flanks that rise with x; a wrong sign would show those behind."""
    photo = seen(ridged(0.06), (0.0, 0.0, 1.0), yaw, 25.0).photo.astype(float).mean(axis=(0, 1))
    assert photo[shown] > 1.5 * photo[hidden]
    photo = seen(ridged(0.0), (0.0, 0.0, 1.0), yaw, 25.0).photo.astype(float).mean(axis=(0, 1))
    assert photo[shown] == pytest.approx(photo[hidden], rel=0.12)


def test_labels_and_depth_do_not_depend_on_relief_or_wetness() -> None:
    images = []
    for relief in (0.0, 0.05):
        scene = baked(ground_of(waves(), relief=relief, repeat=0.8, side=20.0))
        images.append(seen(scene, (0.0, 0.0, 1.0), 20.0, 25.0))
    wet = scene.shading._replace(materials=material_table(scene.scene.world, scene.shading.light.sun, 1.0))
    images.append(seen(BakedScene(scene=scene.scene, shading=wet), (0.0, 0.0, 1.0), 20.0, 25.0))
    for name in ("label", "instance", "depth"):
        assert len({getattr(image, name).tobytes() for image in images}) == 1
    assert len({image.photo.tobytes() for image in images}) == 3


def test_flanks_towards_the_sun_are_bright_and_walls_cast_shadows() -> None:
    """A wall of 20 mm shades level ground behind it for 20 mm / tan 40 deg; its mean light is that of level ground."""
    sun = np.array([np.cos(np.radians(40.0)), 0.0, np.sin(np.radians(40.0))])  # at +x, along u
    wave = waves(ridges=2)
    factor = sun_factors(wave, 0.02, 0.5, sun)[100]
    falling = wave[100, :, 2] > wave[100, :, 0]  # to +x: they face the sun
    assert factor[falling].mean() > 1.3 * factor[~falling].mean()
    assert np.average(factor, weights=wave[100, :, :3].mean(axis=-1)) == pytest.approx(1.0, abs=0.01)
    wall = np.full((256, 256, 4), 128, np.uint8)
    wall[..., 3] = np.where(np.abs(np.arange(256) - 128) < 3, 255, 0)
    line = sun_factors(wall, 0.02, 0.256, sun)[7]  # texels of 1 mm
    behind = np.flatnonzero(line[:124] < (1 + THROUGH) / 2 * line[20])
    assert 125.5 - behind.min() == pytest.approx(20.0 / np.tan(np.radians(40.0)), abs=1.6)
    assert line[140:250] == pytest.approx(np.full(110, line[20]))
    across = np.ascontiguousarray(np.swapaxes(wall, 0, 1))  # the same wall across v, which runs against the rows
    turned = sun_factors(across, 0.02, 0.256, np.array([0.0, -sun[0], sun[2]]))[:, 7]
    assert turned == pytest.approx(line, abs=1e-3)


def test_mip_maps_keep_colour_and_sunlight() -> None:
    texture = texture_of("lawn")
    sun = np.array([0.5, -0.58, 0.643])
    atlas = make_atlas([texture], {0: sun_factors(texture, 0.02, 1.5, sun)})
    wanted = linear_from_srgb(texture[..., :3] / 255.0).mean(axis=(0, 1))
    for level in range(LEVELS):
        start, size = atlas.start[0, level], atlas.size[0, level]
        texels = atlas.texels[start : start + size * size]
        colour = np.stack([atlas.linear[texels >> shift & 255] for shift in (0, 8, 16)], axis=-1).astype(float)
        assert colour.mean(axis=0) == pytest.approx(wanted, rel=0.03)
        lit = colour.mean(axis=-1) * (texels >> 24) / SUN_ONE
        assert lit.mean() == pytest.approx(wanted.mean(), rel=0.03)
    assert atlas.mean[0] == pytest.approx(wanted, rel=1e-4)


@pytest.mark.parametrize(("name", "relief"), [("lawn", 0.026), pytest.param("path", 0.01, marks=pytest.mark.slow)])
def test_ground_is_as_bright_from_afar_as_from_nearby(name: str, relief: float) -> None:
    """Followed through the relief at 2 m, averaged at 14 m, which is below haze, seen under the same angle."""
    scene = baked(ground_of(texture_of(name), relief=relief, repeat=1.5))
    config = StereoConfig(width=320, height=200, horizontal_fov_deg=32.0, vertical_fov_deg=20.0)
    size = (config.height, config.width)
    labels = LabelBuffers(np.zeros(size, np.uint8), np.zeros(size, np.uint32), np.zeros(size, np.float32))
    framebuffer = new_framebuffer(*size)
    for yaw in (0, 90, 180):  # against the sun, across, along
        light = []
        for height in (1.0, 7.0):
            pose = transforms.pose((0, 0, height), (0, 30, yaw)) @ OPTICAL
            render_linear(scene.shading, framebuffer, View(pose, intrinsics_of(config), config.far), labels)
            light.append(float(framebuffer.linear.mean()))
        assert light[0] == pytest.approx(light[1], rel=0.08), yaw


def test_patches_show_other_parts_of_the_tile_without_drift() -> None:
    x, y = (f.ravel().astype(np.float32) for f in np.meshgrid(np.arange(0, 12, 0.05), np.arange(0, 12, 0.05)))
    shift = np.empty((len(x), 2), np.float32)
    patch_offsets(x, y, np.float32(1.2), shift)
    assert ((shift >= 0) & (shift < 1)).all()
    different = np.unique(shift, axis=0)
    assert 81 <= len(different) <= 170  # 100 patches and those that reach in from the sides
    assert abs(different.mean() - 0.5) < 0.1
    patch_offsets(x, y, np.float32(0.0), shift)
    assert not shift.any()


def fresnel(cosine: F8, n: float) -> F8:
    inside = np.sqrt(1 - (1 - cosine**2) / n**2)
    across = (cosine - n * inside) / (cosine + n * inside)
    along = (n * cosine - inside) / (n * cosine + inside)
    return np.asarray((across**2 + along**2) / 2)


def test_reflectance_is_the_mean_of_fresnels_equations() -> None:
    cosine = (np.arange(100_000) + 0.5) / 100_000
    for n in (WATER, 1.5):
        assert mean_reflectance(n) == pytest.approx(float((2 * cosine * fresnel(cosine, n)).mean()), abs=1e-5)


def test_wet_ground_is_darker_and_more_colourful_by_the_formula() -> None:
    """Photons counted one reflection after another give the same albedo as the closed form."""
    p = 1 - (1 - mean_reflectance(WATER)) / WATER**2
    for dry in (0.05, 0.15, 0.4):
        inside, out = (1 - mean_reflectance(WATER)) * dry, 0.0
        for _ in range(60):
            out, inside = out + (1 - p) * inside, p * inside * dry
        assert wet_albedo(np.array([dry]), 1.0)[0] == pytest.approx(out, rel=1e-6)
        assert wet_albedo(np.array([dry]), 0.5)[0] == pytest.approx((out + dry) / 2, rel=1e-6)
    plain = np.broadcast_to(np.rint(srgb_from_linear(np.array([0.3, 0.2, 0.1])) * 255), (8, 8, 3)).astype(np.uint8)
    world = ground_of(plain, relief=0.0, repeat=1.0)
    dry_table, wet_table = (material_table(world, wetness=wetness) for wetness in (0.0, 1.0))
    row = list(world.textures).index("own")
    assert wet_table.atlas.mean[row] == pytest.approx(wet_albedo(dry_table.atlas.mean[row], 1.0), rel=0.03)
    assert wet_table.gloss[list(world.materials).index("soil")] > dry_table.gloss[list(world.materials).index("soil")]
