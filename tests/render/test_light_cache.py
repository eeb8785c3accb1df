# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Baked light and the materials in it are read back as they were made, only for the same scene, sun and code."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from sense_worlds import at, box, make_world

import fieldtruth
from fieldtruth.core.cache import import_closure
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.render.bake import Lit, bake, cached_light, light_key, lit_scene
from fieldtruth.render.daylight import sun_direction
from fieldtruth.render.light import _leaf_sun, bake_light
from fieldtruth.sense.scene import Scene
from fieldtruth.world.model import World

SUN = LightConfig()


def small_world() -> World:
    return make_world([(box("crown", (0.5, 0.5, 0.5), "leaf"), at(0, 0, 2)), (box("rock", (1, 1, 1)), at(2, 0, 1))])


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene(replace(small_world(), size=(4.0, 4.0)))


@pytest.fixture(scope="module")
def baked(scene: Scene) -> Lit:
    shading = lit_scene(scene, SUN, None, 2).shading
    return Lit(bake_light(scene, SUN, 2, materials=shading.materials), shading.materials)


typeof: Any = numba.typeof  # has no annotations


def never() -> Lit:
    raise AssertionError("the cache was not used")


def assert_equal(a: Any, b: Any, name: str = "") -> None:
    """Compare tables, and tables in them; kernels that are compiled for one take the other."""
    assert typeof(a) == typeof(b), name
    if isinstance(a, tuple):
        for k, (x, y) in enumerate(zip(a, b, strict=True)):
            assert_equal(x, y, f"{name}.{getattr(a, '_fields', range(len(a)))[k]}")
    else:
        assert np.array_equal(a, b), name


def test_cached_light_equals_computed_light(scene: Scene, baked: Lit, tmp_path: Path) -> None:
    made = cached_light(scene, SUN, tmp_path, lambda: baked)
    assert made is baked
    assert_equal(cached_light(scene, SUN, tmp_path, never), baked)


def test_scene_with_cached_light_makes_no_materials(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = bake(scene, SUN, workers=2, folder=tmp_path)
    monkeypatch.setattr("fieldtruth.render.bake.material_table", lambda *a: never())
    assert_equal(bake(scene, SUN, workers=2, folder=tmp_path).shading, first.shading)


def test_light_is_computed_again_if_its_file_is_damaged(scene: Scene, baked: Lit, tmp_path: Path) -> None:
    cached_light(scene, SUN, tmp_path, lambda: baked)
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:5000])
    assert cached_light(scene, SUN, tmp_path, lambda: baked) is baked
    assert_equal(cached_light(scene, SUN, tmp_path, never), baked)


def test_light_does_not_depend_on_workers(scene: Scene, baked: Lit) -> None:
    assert_equal(bake_light(scene, SUN, 1, materials=baked.materials), baked.light)


def test_unwritable_cache_is_ignored(scene: Scene, baked: Lit, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert cached_light(scene, SUN, tmp_path / "file", lambda: baked) is baked


def test_key_covers_sun_and_everything_that_lets_light_through(scene: Scene) -> None:
    world = scene.world
    stone = world.materials["stone"]
    changed = [
        replace(world, materials={**world.materials, "stone": other})
        for other in (replace(stone, mirror=0.5), replace(stone, translucency=0.5))
    ]
    moved = replace(world, instances=(*world.instances[:1], replace(world.instances[1], world_from_object=at(2, 1, 1))))
    keys = [light_key(Scene(each), SUN) for each in (world, *changed, moved)]
    keys.append(light_key(scene, LightConfig(sun_elevation_deg=20.0)))
    assert keys[0] == light_key(scene, SUN)
    assert len(set(keys)) == len(keys)


@pytest.mark.parametrize("module", ["kernels/packets.py", "sense/embree.py", "kernels/light.py", "render/daylight.py"])
def test_key_covers_every_module_that_bakes(module: str) -> None:
    root = Path(fieldtruth.__file__).parents[1]
    assert root / "fieldtruth" / module in import_closure(["fieldtruth.render.light"], root)


def test_many_copies_share_the_light_of_a_few_that_are_turned_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twelve boxes of twelve faces, one of them turned: at 96 faces two of a direction have light of their own."""
    crown, turned = box("crown", (0.5, 0.5, 0.5), "leaf"), at(0, 0, 2)
    turned[:2, :2] = [[0.0, -1.0], [1.0, 0.0]]
    scene = Scene(
        replace(make_world([*((crown, at(3 * k, 0, 2)) for k in range(1, 12)), (crown, turned)]), size=(4.0, 4.0))
    )
    sun = sun_direction(SUN.values.azimuth_deg, SUN.values.elevation_deg)
    with ThreadPoolExecutor(1) as pool:
        assert len(_leaf_sun(scene, pool, sun)[0]) == 12 * 12
        monkeypatch.setattr("fieldtruth.render.light._MOST_LEAVES", 96)
        leaf_sun, top_leaf = _leaf_sun(scene, pool, sun)
    assert len(leaf_sun) == 3 * 12
    rows = top_leaf[top_leaf >= 0].tolist()
    assert sorted(set(rows)) == [0, 12, 24]
    assert rows.count(24) == 1  # the turned one
    assert abs(rows.count(0) - rows.count(12)) <= 1
